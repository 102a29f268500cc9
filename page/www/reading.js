// Has files read that the program of the page does not read itself.

import { needs_readers } from "./penup_page.js";
import { Helper } from "./workers.js";

/** The reader, from the first file that needs it. */
let reader = null;

/**
 * What is handed to a sheet or a session for a file: its `bytes`, and whether it `isRead`, that is
 * whether these are what the reader made of it. Fails with a sentence for the user.
 */
export async function handed(name, bytes, options) {
  if (!needs_readers(name, options)) return { bytes, isRead: false };
  let broke = "";
  reader ??= new Helper(({ text }) => (broke = text), "reader.js");
  try {
    return { bytes: await reader.ask("read", { name, bytes, options }), isRead: true };
  } catch (text) {
    if (!broke && typeof text === "string") throw inWords(text);
    // What broke is not used again.
    reader.end();
    reader = null;
    throw (
      `${name} cannot be read: it is nested too deeply, or too large for this browser ` +
      "(the program penup reads it)."
    );
  }
}

/** Names the controls of the page where the messages of the readers name flags. */
const inWords = (text) => text.replace(/--([a-z][a-z-]*)/g, "“$1”");
