// A pipe of bytes to a plotter at a USB or serial port, by WebSerial.

/** The speed of the line in bits per second. USB ignores it. */
const BAUD = 115200;

/** Why this browser cannot use a port; empty if it can. */
export const cannot = () =>
  "serial" in navigator
    ? ""
    : "This browser has no WebSerial: use Chromium, Chrome or Edge, " +
      "or the program: penup page --port …";

/**
 * Lets the user choose a port and joins it to `pipe`, which is a message port. `onend` is called
 * once, with a sentence if the line broke. Returns a function that closes the port.
 */
export async function join(pipe, onend) {
  let port;
  try {
    port = await navigator.serial.requestPort();
  } catch (error) {
    if (error.name === "NotFoundError") throw "No port was chosen.";
    throw `No port can be chosen: ${error.message}.`;
  }
  try {
    await port.open({ baudRate: BAUD, bufferSize: 4096 });
  } catch (error) {
    throw (
      `The port cannot be opened: ${error.message}. Does another program hold it, ` +
      "and may you use it (on Linux: group dialout)?"
    );
  }
  const writer = port.writable.getWriter();
  let reader,
    ended = false,
    reason = "";
  const end = async (text) => {
    if (ended) return;
    ended = true;
    reason = text;
    pipe.postMessage({ closed: true });
    // What is broken already cannot be closed once more.
    await reader?.cancel().catch(() => {});
    await writer.abort().catch(() => {});
    writer.releaseLock();
    await port.close().catch(() => {});
    onend(reason);
  };
  pipe.onmessage = ({ data }) => {
    if (ended) return;
    writer
      .write(data.bytes)
      .catch((error) => end(`The line to the plotter broke: ${error.message}.`));
  };
  (async () => {
    // After a damaged byte the stream ends with an error that is not the end of the port.
    while (port.readable && !ended) {
      reader = port.readable.getReader();
      try {
        for (;;) {
          const { value, done } = await reader.read();
          if (done) break;
          if (value.length) pipe.postMessage({ bytes: value });
        }
        if (!ended) await end("The port was closed.");
      } catch (error) {
        const goes_on = ["BreakError", "BufferOverrunError", "FramingError", "ParityError"];
        if (goes_on.includes(error.name)) {
          // The byte 0xFF stands for what was damaged: the plotter's code then asks again.
          pipe.postMessage({ bytes: new Uint8Array([0xff]) });
        } else {
          await end(
            error.name === "NetworkError"
              ? "The plotter was unplugged. It goes on drawing if it has power; " +
                  "connect again to follow it."
              : `The line to the plotter broke: ${error.message}.`,
          );
        }
      } finally {
        reader.releaseLock();
      }
    }
    await end("The plotter was unplugged.");
  })();
  return () => end("");
}
