// Has files read that the program of the page does not read itself.

import { needs_readers } from "./penup_page.js";
import { isServedByProgram } from "./socket.js";
import { Helper } from "./workers.js";

/** The reader, from the first file that needs it. */
let reader = null;

/**
 * What is handed to a sheet or a session for a file: its `bytes`, and whether it `isRead`, that is
 * whether these are what the reader made of it. Fails with a sentence for the user.
 */
export async function handed(name, bytes, options) {
  if (!needs_readers(name, options)) return { bytes, isRead: false };
  if (isServedByProgram())
    return { bytes: await readByProgram(name, bytes, options), isRead: true };
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

/** Has the program read a file, for it has the fonts of this computer for texts. */
async function readByProgram(name, bytes, options) {
  const asked = JSON.stringify({ name, options: JSON.parse(options) });
  const body = new Blob([asked, "\n", bytes]);
  const answer = await fetch("read", { method: "POST", body }).catch(() => null);
  if (!answer) throw "The program penup does not answer any more: start “penup page” again.";
  if (answer.headers.get("Content-Type") !== "application/json") throw inWords(await answer.text());
  return new Uint8Array(await answer.arrayBuffer());
}

/** Names the controls of the page where the messages of the readers name flags. */
const inWords = (text) => text.replace(/--([a-z][a-z-]*)/g, "“$1”");
