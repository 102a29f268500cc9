// A serial port for tests, with the emulated plotter behind it. It runs in the page.

/** Puts a fake `navigator.serial` into the page, and `window.fakeSerial`, which controls it. */
export function fakeSerial() {
  const control = (window.fakeSerial = {
    /** Every so many bytes from the plotter are damaged; 0 for none. */
    damageEvery: 0,
    /** The name of the error with which the port refuses to be opened. */
    refuses: "",
    /** Promises for which the port waits before it is open, and before it is closed. */
    opens: null,
    closes: null,
    counts: { parts: 0, damaged: 0, errors: 0 },
  });
  let board,
    pipe,
    reading = null,
    count = 0;
  const asked = new Map();
  let last = 0;
  const ask = (call, args, transfer = []) =>
    new Promise((done) => {
      asked.set(++last, done);
      board.postMessage({ id: last, call, args }, transfer);
    });
  control.picture = (page) => ask("picture", { page });
  Object.defineProperty(control, "pace", { set: (pace) => ask("pace", { pace }) });

  /** The plotter stays when its cable is pulled. */
  const plugIn = async () => {
    if (board) return;
    board = new Worker("worker.js", { type: "module" });
    board.onmessage = ({ data }) => asked.get(data.id)?.(data.value);
    const module = await WebAssembly.compileStreaming(fetch("penup_page_bg.wasm"));
    await ask("start", { module });
    const { port1, port2 } = new MessageChannel();
    pipe = port1;
    pipe.onmessage = ({ data }) => receive(data.bytes);
    await ask("board", { pipe: port2, pace: 20 }, [port2]);
  };

  /** Hands bytes of the plotter on in small parts, some of them damaged. */
  const receive = (bytes) => {
    for (let at = 0; at < bytes.length && reading;) {
      const part = bytes.slice(at, at + 1 + (count % 7));
      at += part.length;
      for (const i of part.keys()) {
        count++;
        if (control.damageEvery && count % control.damageEvery === 0) {
          part[i] ^= 4;
          control.counts.damaged++;
        }
      }
      control.counts.parts++;
      reading.enqueue(part);
      if (control.damageEvery && count % 499 < part.length && control.counts.errors < 3) {
        control.counts.errors++;
        reading.error(new DOMException("a frame was wrong", "FramingError"));
        port.open_reading();
      }
    }
  };

  const port = {
    readable: null,
    writable: null,
    open_reading() {
      port.readable = new ReadableStream({
        start: (controller) => (reading = controller),
        cancel: () => (reading = null),
      });
    },
    async open() {
      if (control.refuses) throw new DOMException("the port is in use", control.refuses);
      await control.opens;
      await plugIn();
      port.open_reading();
      port.writable = new WritableStream({
        write: (bytes) => pipe.postMessage({ bytes: bytes.slice() }),
      });
    },
    async close() {
      await control.closes;
      reading = port.readable = port.writable = null;
    },
  };
  control.unplug = () => {
    const broken = reading;
    reading = port.readable = null;
    broken.error(new DOMException("the device has been lost", "NetworkError"));
  };
  Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
}
