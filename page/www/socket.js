// A pipe of bytes to a plotter that the program penup has joined: `penup page --port …`.

/** The code with which a connection is closed that nobody refused. */
const NORMAL = 1000;

/** Whether the program penup serves this page: nothing else serves it behind a token. */
export const isServedByProgram = () => /^\/[0-9a-f]{32}\//.test(location.pathname);

/** The name of the plotter that the program has joined; empty if there is none. */
export async function joined() {
  if (!isServedByProgram()) return "";
  const answer = await fetch("plotter.json");
  return (answer.ok && (await answer.json()).plotter) || "";
}

/**
 * Joins the program's plotter to `pipe`, which is a message port. `onend` is called once, with a
 * sentence if the line broke or was refused; `onpath` gets what the pins of an emulated board have
 * drawn. Returns a function that closes the line, and one that tells the board an order.
 */
export function join(pipe, onend, onpath) {
  const address = new URL("plotter", location.href);
  address.protocol = "ws:";
  address.hash = "";
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  const waiting = [];
  const send = (data) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(data);
    else if (socket.readyState === WebSocket.CONNECTING) waiting.push(data);
  };
  let hasEnded = false;
  const end = (text) => {
    if (hasEnded) return;
    hasEnded = true;
    pipe.postMessage({ closed: true });
    socket.close(NORMAL);
    onend(text);
  };
  pipe.onmessage = ({ data }) => send(data.bytes);
  socket.onopen = () => waiting.splice(0).forEach((data) => socket.send(data));
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") onpath(new Float32Array(JSON.parse(data).path));
    else pipe.postMessage({ bytes: new Uint8Array(data) });
  };
  socket.onclose = ({ reason }) =>
    end(
      reason ||
        "The program penup does not answer any more: start “penup page” again. " +
          "A real plotter goes on drawing if it has power.",
    );
  return { close: () => end(""), order: (order) => send(JSON.stringify(order)) };
}
