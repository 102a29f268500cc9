// Plots: on the emulated plotter of the page, on a real one by WebSerial, or on the one that the
// program penup has joined. All are the same session, at the end of a pipe of bytes.

import { Helper } from "./workers.js";
import { clock, figures, length } from "./drawing.js";
import { cannot, join } from "./serial.js";
import { join as joinProgram } from "./socket.js";
import { passes } from "./penup_page.js";

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

/** What is said while the machine moves by hand, by its state. */
const MOVES = {
  Home: "Looking for the switches…",
  Jog: "Moving…",
  Run: "Moving…",
};

/** What is said about each kind of plotter. */
const HINTS = {
  emulated: "The plotter's own program, on pins of memory. Nothing needs to be plugged in.",
  serial: "Chromium, Chrome or Edge, and a plotter that runs penup. The page talks to it.",
  program: "The program penup has its line, so any browser will do. One page at a time holds it.",
};
/** The settings of the emulated machine that these options say. */
const machineOf = (options = "[]") => new Map(JSON.parse(options)).get("set") ?? "";
/** How dark the lines are that are still to be drawn. */
const PLANNED = 0.28;
/** The side of the test square in mm. */
const SQUARE = 20;

export class Plotting {
  /** `program` is the name of the plotter that the program penup has joined, or empty. */
  constructor(view, { job, lines, announce, program }) {
    Object.assign(this, { view, job, lines, announce, session: null, board: null, close: null });
    /** Tells an emulated board that the program runs; null if there is none. */
    this.order = null;
    if (program) {
      const option = $("plotter").querySelector("[value=program]");
      Object.assign(option, { textContent: program, hidden: false });
      $("plotter").value = "program";
    }
    this.phase = "closed";
    this.clear();
    /** The job that is drawn several times, how often in all, and how often it is still begun. */
    this.passes = { job: null, all: 1, left: 0 };
    /** A sentence about the passes that were not begun; empty if all were. */
    this.missing = "";
    this.place = null;
    this.isHeld = false;
    /** What the machine does by hand, in words; empty if nothing moves by hand. */
    this.moves = "";
    /** What is sent once the emulated plotter is ready, and the promise that it starts. */
    this.waiting = this.starting = null;
    $("plotter").addEventListener("change", () => this.choose());
    $("connect").addEventListener("click", () => this.connect());
    $("disconnect").addEventListener("click", () => this.close?.());
    $("plot").addEventListener("click", () => this.plot());
    $("hold").addEventListener("click", () => this.tell("hold"));
    $("resume").addEventListener("click", () =>
      $("pen-change").hidden ? this.tell("resume") : this.penIsIn(),
    );
    $("give-up").addEventListener("click", () => this.tell("give_up"));
    $("slower").addEventListener("click", () => this.tell("override", { by: -1 }));
    $("faster").addEventListener("click", () => this.tell("override", { by: 1 }));
    $("as-set").addEventListener("click", () => this.tell("override", { by: 0 }));
    $("go-on").addEventListener("click", () => this.goOn(false));
    $("go-on-origin").addEventListener("click", () => this.goOn(true));
    $("test-square").addEventListener("click", () => this.tell("testSquare", { mm: SQUARE }));
    $("pen-up").addEventListener("click", () => this.tell("movePen", { isDown: false }));
    $("pen-down").addEventListener("click", () => this.tell("movePen", { isDown: true }));
    $("heights-read").addEventListener("click", () => this.tell("command", { text: "$$" }));
    for (const field of document.querySelectorAll("[data-setting]")) {
      field.addEventListener("change", () => {
        if (!field.reportValidity() || field.value === "") return;
        this.tell("command", { text: `$${field.dataset.setting}=${field.value}` });
      });
    }
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
      button.addEventListener("click", () => {
        const mm = Number($("jog-mm").value);
        const [x, y] = button.dataset.jog.split(",").map((way) => way * mm);
        this.tell("command", { text: `$J=G91 G21 X${x} Y${y} F3000` });
      });
    }
    this.choose();
  }

  get kind() {
    return $("plotter").value;
  }

  /** Whether the plotter must be joined first. */
  get isFar() {
    return this.kind !== "emulated";
  }

  /** Whether the path of the pen is told by the pins of an emulated board. */
  get hasPins() {
    return !this.isFar || this.count > 0;
  }

  /** Another plotter is chosen: what was joined to the last one ends. */
  choose() {
    this.close?.();
    this.end();
    this.clear();
    this.planned = null;
    this.view.draw();
    const missing = this.kind === "serial" ? cannot() : "";
    $("plotter-hint").textContent = missing || HINTS[this.kind];
    $("pace-control").hidden = this.isFar;
    $("connect").disabled = Boolean(missing);
    this.buttons();
  }

  /** Ends the workers of a session. */
  end() {
    this.session?.end();
    this.board?.end();
    this.session = this.board = this.close = this.order = this.line = null;
    this.waiting = this.starting = null;
    this.endPasses();
    this.enter("closed");
  }

  begin(pipe, kind) {
    this.problem(this.missing);
    this.missing = "";
    this.session = new Helper((said) => this.hear(said));
    this.session.ask("session", { pipe, kind }, [pipe]).catch((text) => this.problem(text));
  }

  /** Starts the emulated plotter for a job. Fails with a sentence if there is no such plotter. */
  emulate(job) {
    this.starting ??= this.start(job).finally(() => (this.starting = null));
    return this.starting;
  }

  async start(job) {
    const { port1, port2 } = new MessageChannel();
    this.board = new Helper((said) => {
      if (said.event === "path") this.draw(said.path);
      else this.hear(said);
    });
    const { room, options } = job ?? {};
    this.room = room;
    this.machine = machineOf(options);
    const pace = Number($("pace").value);
    try {
      await this.board.ask("board", { pipe: port1, pace, room, options }, [port1]);
    } catch (text) {
      this.end();
      throw text;
    }
    this.begin(port2, "emulated");
  }

  async connect() {
    const { port1, port2 } = new MessageChannel();
    if (this.kind === "program") {
      const ended = (text) => this.lose(text);
      const { close, order } = joinProgram(port1, ended, (path) => this.draw(path));
      Object.assign(this, { close, order });
      this.clear();
      this.begin(port2, "program");
      return this.buttons();
    }
    const line = (this.line = {});
    try {
      const close = await join(port1, (text) => {
        // A port takes a while to close: another session may have begun.
        if (this.line === line) this.lose(text);
      });
      // Meanwhile another plotter may have been chosen.
      if (this.line !== line) return close();
      this.close = close;
    } catch (text) {
      if (this.line !== line) return;
      return this.problem(
        typeof text === "string" ? text : `The port cannot be used: ${text.message ?? text}.`,
      );
    }
    this.begin(port2, "serial");
    this.buttons();
  }

  /** The line to the plotter has ended; if it broke, with a sentence. */
  lose(text) {
    const { missing } = this;
    this.end();
    // What was said already stays.
    if (text || this.missing !== missing) this.problem(`${text} ${this.missing}`.trim());
  }

  /** Plots the drawing. A second press before that has begun is none. */
  plot() {
    this.beginning ??= this.beginPlot().finally(() => (this.beginning = null));
  }

  async beginPlot() {
    this.missing = "";
    this.problem("");
    try {
      await this.plotJob(await this.job());
    } catch (error) {
      this.problem(error?.message ?? error);
    }
  }

  /** Has a job drawn. Fails with a sentence if nothing of it is sent. */
  async plotJob(job) {
    if (!job) return this.problem("There is no drawing: open a file first.");
    const all = passes(job.options);
    // An emulated plotter without room for a larger model, or of other settings, is replaced.
    const isSmall = (room) => Object.keys(room).some((own) => !(this.room?.[own] >= room[own]));
    const isOther = machineOf(job.options) !== this.machine;
    if (this.board && (isSmall(job.room) || isOther)) this.end();
    if (!this.session) {
      if (this.isFar) return this.problem("Connect the plotter first.");
      await this.emulate(job);
    }
    this.order?.("begin");
    this.clear();
    this.planned = this.lines();
    await this.board?.ask("begin_again");
    this.passes = { job, all, left: all - 1 };
    await this.tell("plot", job);
    this.view.draw();
  }

  /** Begins the next pass of the drawing. Returns whether there is one. */
  isDrawnAgain() {
    if (!this.passes.left) return false;
    this.passes.left--;
    const { job, all, left } = this.passes;
    this.log(`Pass ${all - left} of ${all} begins.`);
    this.tell("plot", job);
    return true;
  }

  async tell(call, args) {
    if (!this.session) {
      if (this.isFar) return this.problem("Connect the plotter first.");
      if (!["command", "testSquare", "movePen"].includes(call)) return;
      // The first command by hand starts the emulated plotter, and is sent when that is ready.
      this.waiting = [call, args];
      const job = await this.job().catch(() => null);
      return this.emulate(job).catch((text) => this.problem(text));
    }
    try {
      await this.session.ask(call, args);
      // What was wrong before this command may not be so any more.
      if (call === "command") {
        this.missing = "";
        this.problem("");
      }
    } catch (text) {
      this.problem(text);
    }
  }

  penIsIn() {
    $("pen-change").hidden = true;
    this.board?.ask("pen", { pen: this.pen });
    this.order?.({ pen: this.pen });
    this.tell("resume");
  }

  /** Goes on with the job that has stopped. */
  async goOn(isAtOrigin) {
    this.passes = { job: null, all: 1, left: 0 };
    this.problem("");
    this.order?.("begin");
    this.clear();
    this.planned = null;
    await this.tell("goOn", { isAtOrigin });
  }

  /** Shows a setting that the plotter has told, such as `$210=0`. */
  readSetting(text) {
    const [, number, value] = /^\$(\d+)=(-?[\d.]+)/.exec(text) ?? [];
    const field = document.querySelector(`[data-setting="${number}"]`);
    if (field) field.value = String(Number(value));
  }

  hear(said) {
    if (said.event === "broken") return this.problem(said.text);
    for (const event of said.events ?? []) this.take(event);
  }

  take(event) {
    switch (event.kind) {
      case "phase":
        this.enter(event.name);
        // The session has given the plotter up: the line to it is closed, and can be opened again.
        if (event.name === "closed") {
          this.close?.();
          if (this.session) this.end();
        }
        if (event.name === "ready" && this.waiting) {
          const waiting = this.waiting;
          this.waiting = null;
          this.tell(...waiting);
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
        this.log(event.text);
        break;
      case "reply":
        this.log(event.text);
        this.readSetting(event.text);
        break;
      case "failed":
        this.endPasses();
        this.log(event.text);
        this.problem(`${event.text} ${this.missing}`.trim());
        break;
      case "stopped":
        this.passes.left = 0;
        this.hasEnded = true;
        this.say("Given up: the pen is up.");
        break;
      case "drawn":
        if (this.isDrawnAgain()) break;
        this.hasEnded = true;
        this.say(`Drawn${this.timesDrawn()}: ${event.report ?? "all of it"}.`);
        $("progress").value = 1;
        break;
    }
  }

  /** Begins no further pass, and keeps in mind which are missing. */
  endPasses() {
    const { all, left } = this.passes;
    this.passes.left = 0;
    if (!left) return;
    const which =
      left === 1 ? `The last of ${all} passes is` : `The last ${left} of ${all} passes are`;
    this.missing = `${which} not drawn: set multipass to ${left} and plot again.`;
  }

  /** How often everything was drawn, in words. */
  timesDrawn() {
    const { all } = this.passes;
    return all > 1 ? ` ${all} times` : "";
  }

  enter(phase) {
    this.phase = phase;
    this.isHeld = false;
    this.moves = "";
    // How the last drawing ended stays until something else begins.
    if (phase !== "ready" || !this.hasEnded) $("plot-state").textContent = PHASES[phase];
    if (phase !== "ready") this.hasEnded = false;
    if (phase === "closed" && !this.isFar) $("plot-state").textContent = "Ready.";
    $("progress").hidden = !["sending", "computing", "drawing"].includes(phase);
    if (phase === "computing") $("progress").removeAttribute("value");
    if (!["drawing"].includes(phase)) $("pen-change").hidden = true;
    this.buttons();
  }

  follow({ state, position, strokes, ink, left, percent, stopped }) {
    if (position.length >= 2) this.place = position;
    $("percent").textContent = `${percent} %`;
    this.offer(this.phase === "ready" ? stopped : null);
    const held = state === "Hold";
    if (!held) $("pen-change").hidden = true;
    const moves = (this.phase === "ready" && MOVES[state]) || "";
    if (moves !== this.moves) {
      this.moves = moves;
      this.hasEnded = false;
      this.say(moves || PHASES[this.phase]);
      this.buttons();
    }
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
    if (this.isFar) this.view.draw();
  }

  /** Offers to go on with a job that has stopped, of which so many strokes are drawn. */
  offer(stopped) {
    $("stopped").hidden = !stopped;
    if (!stopped) return;
    const [done, all] = stopped;
    // How many there are is not known of a drawing that is computed part by part.
    const count = all === 0 ? `${done}` : `${done} of ${all}`;
    const strokes = `${count} ${(all || done) === 1 ? "stroke" : "strokes"}`;
    const said =
      `A job has stopped after ${strokes}. It can go on once the machine is ` +
      "homed (By hand: Home), or the pen was put at the origin by hand.";
    const shown = $("stopped").querySelector("p");
    // A screen reader reads it once.
    if (shown.textContent !== said) shown.textContent = said;
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

  /** The drawing is another one now: what was drawn before is not shown any more. */
  outdated() {
    if (!["closed", "ready"].includes(this.phase)) return;
    this.clear();
    this.view.draw();
  }

  buttons() {
    const busy = ["sending", "computing", "drawing"].includes(this.phase);
    const joined = Boolean(this.session);
    // The first plot joins an emulated plotter.
    const canPlot = this.phase === "ready" || (this.phase === "closed" && !this.isFar);
    $("plot").disabled = !canPlot || this.isHeld;
    const moves = Boolean(this.moves);
    $("hold").disabled = !(this.phase === "drawing" || moves) || this.isHeld;
    $("resume").disabled = !this.isHeld;
    $("give-up").disabled = !(busy || moves || this.isHeld);
    $("unlock").hidden = this.phase !== "alarm";
    $("connect").hidden = !this.isFar || joined;
    $("disconnect").hidden = !this.isFar || !joined;
    for (const id of ["slower", "faster", "as-set"]) $(id).disabled = this.phase !== "drawing";
    if (this.phase !== "ready") this.offer(null);
    $("plotter").disabled = busy;
    for (const button of document.querySelectorAll("[data-command], [data-jog], [data-hand]")) {
      // Homing ends an alarm, too.
      const isCure = this.phase === "alarm" && button.dataset.command === "$H";
      button.disabled = busy || (this.isFar && this.phase !== "ready" && !isCure);
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

  /** Whether there is something to see of what the plotter draws. */
  get isShown() {
    return this.count > 0 || (this.isFar && this.phase === "drawing");
  }

  /** What draws what the plotter has drawn over what it will draw; null before it has begun. */
  paint(brush) {
    return this.isShown ? this.pieces(brush) : null;
  }

  *pieces(brush) {
    const { count, path, planned, view } = this;
    // While the pen moves, a frame may have no time for more than the ink.
    yield* view.path(brush, path, count / SAMPLE);
    const last = path.subarray(count - SAMPLE, count);
    const place = this.hasPins ? [last[1], last[2]] : this.place;
    if (place && this.phase === "drawing") view.pen(brush, place, this.hasPins ? last[3] : 0);
    if (planned) yield* view.lines(brush, planned, PLANNED);
  }
}
