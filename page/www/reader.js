// Reads files of the large formats and arranges plans, in a worker of its own: a file that is
// nested too deeply ends it, and nothing else.

import init, { read } from "./penup_page_files.js";

let ready = null;

onmessage = async ({ data: { id, call, args } }) => {
  if (call === "start") return postMessage({ id });
  try {
    ready ??= init({ module_or_path: fetch("penup_page_files_bg.wasm") });
    await ready;
    const bytes = read(args.name, await uncompressed(args.bytes), args.options);
    postMessage({ id, value: bytes }, [bytes.buffer]);
  } catch (error) {
    postMessage({ id, ...(typeof error === "string" ? { error } : { broke: String(error) }) });
  }
};

/** The bytes of a file, without the compression of gzip, which SVG files may have. */
async function uncompressed(bytes) {
  if (bytes[0] !== 0x1f || bytes[1] !== 0x8b) return bytes;
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  // The reader says what is wrong with a file that is damaged.
  const whole = new Response(stream).arrayBuffer();
  return whole.then((buffer) => new Uint8Array(buffer)).catch(() => bytes);
}
