// Starts workers, and asks them.

let module;

/** Loads the plotter's code once for all workers. */
export async function load() {
  const answer = await fetch("penup_page_bg.wasm");
  if (!answer.ok) throw new Error(`the server answers ${answer.status} for penup_page_bg.wasm`);
  module = await WebAssembly.compile(await answer.arrayBuffer());
  return module;
}

/** A worker that can be asked. `onevent` gets what it tells without being asked. */
export class Helper {
  constructor(onevent = () => {}, script = "worker.js") {
    this.asked = new Map();
    this.last = 0;
    this.worker = new Worker(script, { type: "module" });
    this.worker.onmessage = ({ data }) => {
      if (data.event) return onevent(data);
      const { resolve, reject } = this.asked.get(data.id);
      this.asked.delete(data.id);
      if ("broke" in data) reject(new Error(data.broke));
      else if ("error" in data) reject(data.error);
      else resolve(data.value);
    };
    this.worker.onerror = (event) => {
      const said = event.message || "it did not load";
      const text = `A part of the page cannot run: ${said}. Reload the page.`;
      for (const { reject } of this.asked.values()) reject(text);
      this.asked.clear();
      onevent({ event: "broken", text });
    };
    this.ask("start", { module }).catch((text) => onevent({ event: "broken", text }));
  }

  /** Asks, and promises the answer. It fails with a sentence for the user. */
  ask(call, args, transfer = []) {
    const id = ++this.last;
    return new Promise((resolve, reject) => {
      this.asked.set(id, { resolve, reject });
      this.worker.postMessage({ id, call, args }, transfer);
    });
  }

  /** Ends the worker; what it was asked for is never answered. */
  end() {
    this.worker.terminate();
  }
}
