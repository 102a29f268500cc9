// Plots: on the emulated plotter of the page, or on a real one by WebSerial. Both are the same
// session, at the end of a pipe of bytes.

import { Helper } from "./workers.js";
import { clock, figures, length } from "./drawing.js";
import { cannot, join } from "./serial.js";

const $ = (id) => document.getElementById(id);
const SAMPLE = 4;

/** What the session does, in words. */
const PHASES = {
  closed: "Not connected.",
  finding: "Looking for the plotter…",
  ready: "Ready.",
  sending: "Sending the drawing…",
  computing: "The plotter computes the drawing…",
  drawing: "Drawing.",
  alarm: "Alarm.",
};

export class Plotting {
  constructor(view, { job, lines, announce }) {
    Object.assign(this, { view, job, lines, announce, session: null, board: null, close: null });
    this.phase = "closed";
    this.clear();
    this.place = null;
    this.isHeld = false;
    $("plotter").addEventListener("change", () => this.choose());
    $("connect").addEventListener("click", () => this.connect());
    $("disconnect").addEventListener("click", () => this.close?.());
    $("plot").addEventListener("click", () => this.plot());
    $("hold").addEventListener("click", () => this.tell("hold"));
    $("resume").addEventListener("click", () => this.tell("resume"));
    $("give-up").addEventListener("click", () => this.tell("give_up"));
    $("unlock").addEventListener("click", () => this.tell("command", { text: "$X" }));
    $("pen-in").addEventListener("click", () => this.penIsIn());
    $("pace").addEventListener("change", () =>
      this.board?.ask("pace", { pace: Number($("pace").value) }),
    );
    for (const button of document.querySelectorAll("[data-command]")) {
      button.addEventListener("click", () =>
        this.tell("command", { text: button.dataset.command }),
      );
    }
    for (const button of document.querySelectorAll("[data-jog]")) {
      const [x, y] = button.dataset.jog.split(",");
      button.addEventListener("click", () =>
        this.tell("command", { text: `$J=G91 G21 X${x} Y${y} F3000` }),
      );
    }
    this.choose();
  }

  get isSerial() {
    return $("plotter").value === "serial";
  }

  /** Another plotter is chosen: what was joined to the last one ends. */
  choose() {
    this.close?.();
    this.end();
    const missing = this.isSerial ? cannot() : "";
    $("plotter-hint").textContent =
      missing ||
      (this.isSerial
        ? "Chromium, Chrome or Edge, and a plotter that runs penup. The page talks to it by itself."
        : "The plotter's own program, on pins of memory. Nothing needs to be plugged in.");
    $("pace-control").hidden = this.isSerial;
    $("connect").disabled = Boolean(missing);
    this.buttons();
  }

  /** Ends the workers of a session. */
  end() {
    this.session?.end();
    this.board?.end();
    this.session = this.board = this.close = null;
    this.enter("closed");
  }

  begin(pipe, kind) {
    this.problem("");
    this.session = new Helper((said) => this.hear(said));
    this.session.ask("session", { pipe, kind }, [pipe]).catch((text) => this.problem(text));
  }

  /** Starts the emulated plotter. */
  emulate() {
    const { port1, port2 } = new MessageChannel();
    this.board = new Helper((said) => {
      if (said.event === "path") this.draw(said.path);
      else this.hear(said);
    });
    this.board
      .ask("board", { pipe: port1, pace: Number($("pace").value) }, [port1])
      .catch((text) => this.problem(text));
    this.begin(port2, "emulated");
  }

  async connect() {
    const { port1, port2 } = new MessageChannel();
    try {
      this.close = await join(port1, (text) => {
        this.end();
        if (text) this.problem(text);
      });
    } catch (text) {
      return this.problem(
        typeof text === "string" ? text : `The port cannot be used: ${text.message ?? text}.`,
      );
    }
    this.begin(port2, "serial");
    this.buttons();
  }

  async plot() {
    const job = this.job();
    if (!job) return this.problem("There is no drawing: open a file first.");
    if (!this.session) {
      if (this.isSerial) return this.problem("Connect the plotter first.");
      this.emulate();
    }
    this.problem("");
    this.clear();
    this.planned = this.lines();
    await this.board?.ask("begin_again");
    await this.tell("plot", job);
    this.view.draw();
  }

  async tell(call, args) {
    if (!this.session) {
      if (this.isSerial) return this.problem("Connect the plotter first.");
      if (call !== "command") return;
      // The first command by hand starts the emulated plotter, and is sent when that is ready.
      this.emulate();
      this.waiting = args;
      return;
    }
    try {
      await this.session.ask(call, args);
    } catch (text) {
      this.problem(text);
    }
  }

  penIsIn() {
    $("pen-change").hidden = true;
    this.board?.ask("pen", { pen: this.pen });
    this.tell("resume");
  }

  hear(said) {
    if (said.event === "broken") return this.problem(said.text);
    for (const event of said.events ?? []) this.take(event);
  }

  take(event) {
    switch (event.kind) {
      case "phase":
        this.enter(event.name);
        if (event.name === "ready" && this.waiting) {
          const args = this.waiting;
          this.waiting = null;
          this.tell("command", args);
        }
        break;
      case "sent":
        $("progress").hidden = false;
        $("progress").value = event.done / event.all;
        $("plot-state").textContent = `Sending the drawing: line ${event.done} of ${event.all}`;
        break;
      case "status":
        this.follow(event);
        break;
      case "pen":
        this.pen = event.pen;
        $("pen-change").querySelector("p").textContent =
          `The plotter has stopped and waits for pen ${event.pen}. Put it in.`;
        $("pen-change").hidden = false;
        break;
      case "note":
      case "reply":
        this.log(event.text);
        break;
      case "failed":
        this.log(event.text);
        this.problem(event.text);
        break;
      case "stopped":
        this.hasEnded = true;
        this.say("Given up: the pen is up.");
        break;
      case "drawn":
        this.hasEnded = true;
        this.say(`Drawn: ${event.report ?? "all of it"}.`);
        $("progress").value = 1;
        break;
    }
  }

  enter(phase) {
    this.phase = phase;
    this.isHeld = false;
    // How the last drawing ended stays until something else begins.
    if (phase !== "ready" || !this.hasEnded) $("plot-state").textContent = PHASES[phase];
    if (phase !== "ready") this.hasEnded = false;
    if (phase === "closed" && !this.isSerial) $("plot-state").textContent = "Ready.";
    $("progress").hidden = !["sending", "computing", "drawing"].includes(phase);
    if (phase === "computing") $("progress").removeAttribute("value");
    if (!["drawing"].includes(phase)) $("pen-change").hidden = true;
    this.buttons();
  }

  follow({ state, position, strokes, ink, left }) {
    if (position.length >= 2) this.place = position;
    const held = state === "Hold";
    if (held !== this.isHeld) {
      this.isHeld = held;
      this.say(held ? "Held: the pen goes up." : PHASES[this.phase]);
      this.buttons();
    }
    if (this.phase === "drawing" && strokes) {
      $("progress").hidden = false;
      $("progress").value = ink && ink[1] ? ink[0] / ink[1] : strokes[0] / Math.max(1, strokes[1]);
      figures($("plot-figures"), [
        ["Stroke", `${strokes[0]} of ${strokes[1]}`],
        ["Ink", ink ? `${length(ink[0])} of ${length(ink[1])}` : ""],
        ["Time left", left === null ? "" : clock(left)],
      ]);
    }
    if (this.isSerial) this.view.draw();
  }

  /** More of the path that the pins of the emulated plotter have made. */
  draw(more) {
    if (this.count + more.length > this.path.length) {
      const path = new Float32Array(2 * (this.count + more.length));
      path.set(this.path.subarray(0, this.count));
      this.path = path;
    }
    this.path.set(more, this.count);
    this.count += more.length;
    this.view.draw();
  }

  clear() {
    this.path = new Float32Array();
    /** How many numbers of the path are in use. */
    this.count = 0;
  }

  buttons() {
    const busy = ["sending", "computing", "drawing"].includes(this.phase);
    const joined = Boolean(this.session);
    $("plot").disabled =
      busy || this.phase === "alarm" || (this.isSerial && this.phase !== "ready");
    $("hold").disabled = this.phase !== "drawing" || this.isHeld;
    $("resume").disabled = !this.isHeld;
    $("give-up").disabled = !busy;
    $("unlock").hidden = this.phase !== "alarm";
    $("connect").hidden = !this.isSerial || joined;
    $("disconnect").hidden = !this.isSerial || !joined;
    $("plotter").disabled = busy;
    for (const button of document.querySelectorAll("[data-command], [data-jog]")) {
      button.disabled = busy || (this.isSerial && this.phase !== "ready");
    }
  }

  say(text) {
    $("plot-state").textContent = text;
    this.announce(text);
  }

  problem(text) {
    $("plot-problem").textContent = text;
    $("plot-problem").hidden = !text;
  }

  log(text) {
    const entry = $("log").appendChild(document.createElement("li"));
    entry.textContent = text;
    while ($("log").children.length > 100) $("log").firstChild.remove();
  }

  /** Draws what the plotter has drawn over what it will draw. Returns whether it has begun. */
  paint(brush) {
    const planned = this.planned;
    if (!this.count && !(this.isSerial && this.phase === "drawing")) return false;
    if (planned) {
      brush.globalAlpha = 0.28;
      this.view.lines(brush, planned);
      brush.globalAlpha = 1;
    }
    this.view.path(brush, this.path, this.count / SAMPLE);
    const last = this.path.subarray(this.count - SAMPLE, this.count);
    const place = this.isSerial ? this.place : [last[1], last[2]];
    if (place && this.phase === "drawing") this.view.pen(brush, place, this.isSerial ? 0 : last[3]);
    return true;
  }
}
