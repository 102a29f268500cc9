// The whole drawing before the ink: order, moves with the pen up, time, and a replay at true speed.

import { Helper } from "./workers.js";
import { indexAt, penAt } from "./sheet.js";

const $ = (id) => document.getElementById(id);
const SAMPLE = 4;
const EXPORTS = ["export-svg", "export-png", "export-gcode", "export-hpgl"];
/** Dots of a PNG in a mm, and the most on a side: as of the program's. */
const DOTS = 8,
  MOST_DOTS = 4096;

/** A time in seconds as h:mm:ss or m:ss. */
export function clock(seconds) {
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, "0");
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

/** A length in mm, in m from a metre on. */
export const length = (mm) => (mm >= 1000 ? `${(mm / 1000).toFixed(2)} m` : `${mm.toFixed(1)} mm`);

/** Fills a list of terms and values. */
export function figures(list, rows) {
  list.replaceChildren(
    ...rows.flatMap(([term, value]) => [
      Object.assign(document.createElement("dt"), { textContent: term }),
      Object.assign(document.createElement("dd"), { textContent: value }),
    ]),
  );
}

export class Drawing {
  constructor(view, boards, { job, announce }) {
    Object.assign(this, { view, job, announce, computed: null, time: 0, playing: 0, helper: null });
    for (const { name, about } of boards) $("board").append(new Option(`${name} (${about})`, name));
    $("board").addEventListener("change", () => this.compute());
    $("play").addEventListener("click", () => this.play());
    $("at").addEventListener("input", () => {
      this.stop();
      this.seek(Number($("at").value));
    });
    $("stroke-next").addEventListener("click", () => this.stroke(1));
    $("stroke-back").addEventListener("click", () => this.stroke(-1));
    $("show-up").addEventListener("change", () => view.draw());
    for (const kind of ["svg", "gcode", "hpgl"])
      $(`export-${kind}`).addEventListener("click", () => this.save(kind, this.computed[kind]));
    $("export-png").addEventListener("click", () => this.savePng());
  }

  /** What was computed is not what is shown any more. */
  outdated() {
    this.helper?.end();
    this.helper = null;
    this.begun = null;
    this.stop();
    this.computed = null;
    $("check-state").textContent = "…";
    for (const button of EXPORTS) $(button).disabled = true;
  }

  /** Computes the drawing, by a session with an emulated plotter that runs ahead of time. */
  async compute() {
    this.outdated();
    const begun = (this.begun = {});
    let job;
    try {
      job = await this.job();
    } catch (text) {
      if (this.begun === begun) this.problem(text);
      return;
    }
    if (!job || this.begun !== begun) return;
    const state = $("check-state");
    const busy = () => (state.textContent = "Computing the drawing…");
    busy();
    $("check-problem").hidden = true;
    const helper = (this.helper = new Helper((said) => {
      if (said.event === "computing") {
        const [done, all] = said.strokes;
        state.textContent = `Computing the drawing: stroke ${done} of ${all}`;
      }
      if (said.event === "broken") this.problem(said.text);
    }));
    try {
      const computed = await helper.ask("compute", { ...job, memory: $("board").value });
      if (this.helper !== helper) return;
      this.take(computed, job);
    } catch (text) {
      if (this.helper === helper) this.problem(text);
    }
    helper.end();
    if (this.helper === helper) this.helper = null;
  }

  problem(text) {
    const board = $("board").selectedOptions[0];
    const who = board.value ? `The board ${board.value} would refuse this drawing. ` : "";
    $("check-problem").textContent = who + text;
    $("check-problem").hidden = false;
    $("check-state").textContent = "This is not drawn.";
    figures($("figures"), []);
    this.view.draw();
  }

  take(computed, job) {
    const { path, ends, pens, ink, up, notes, times } = computed;
    // The slider replays the first pass.
    const seconds = path.length ? path[path.length - SAMPLE] : 0;
    const all = clock(computed.seconds) + (times > 1 ? ` for ${times} passes` : "");
    const strokes = ends.length / 4;
    this.computed = { ...computed, seconds, name: job.name, page: job.page };
    this.allSeconds = computed.seconds;
    this.begins = computed.begins;
    figures($("figures"), [
      ["Time", all],
      ["Ink", length(ink)],
      ["Moves with the pen up", length(up)],
      ["Strokes", String(strokes)],
      ["Lifts between them", String(Math.max(0, strokes - 1))],
      ["Efficiency", `${((100 * ink) / Math.max(ink + up, 1e-9)).toFixed(1)} %`],
      ["Pens", pens.join(", ")],
    ]);
    $("check-state").textContent = `${all} with ${strokes} strokes`;
    $("check-problem").textContent = notes.join(" ");
    $("check-problem").hidden = !notes.length;
    $("at").max = String(seconds);
    for (const button of EXPORTS) $(button).disabled = false;
    this.seek(seconds);
  }

  seek(time) {
    this.time = Math.max(0, Math.min(time, this.computed?.seconds ?? 0));
    $("at").value = String(this.time);
    $("at-text").textContent = clock(this.time);
    const at = this.strokeAt();
    $("at").setAttribute(
      "aria-valuetext",
      `${clock(this.time)}, stroke ${at} of ${this.begins?.length ?? 0}`,
    );
    this.view.draw();
  }

  strokeAt() {
    const begins = this.begins ?? [];
    let low = 0,
      high = begins.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (begins[middle] <= this.time + 1e-3) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  stroke(by) {
    if (!this.computed) return;
    this.stop();
    const now = this.strokeAt() - 1;
    const next = Math.max(0, Math.min(this.begins.length - 1, now + by));
    this.seek(this.begins[next]);
    this.announce(`Stroke ${next + 1} of ${this.begins.length}`);
  }

  play() {
    if (this.playing) return this.stop();
    if (!this.computed) return;
    if (this.time >= this.computed.seconds) this.seek(0);
    $("play").textContent = "Stop";
    let last = performance.now();
    const step = (now) => {
      if (!this.computed) return;
      this.seek(this.time + ((now - last) / 1000) * Number($("speed").value));
      last = now;
      if (this.time >= this.computed.seconds) this.stop();
      else this.playing = requestAnimationFrame(step);
    };
    this.playing = requestAnimationFrame(step);
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    $("play").textContent = "Play";
  }

  /** What draws the computed drawing; null if there is none. */
  paint(brush) {
    return this.computed && this.pieces(brush);
  }

  *pieces(brush) {
    const { path, ends, seconds } = this.computed;
    const { time, view } = this;
    const end = indexAt(path, time);
    const showsUp = $("show-up").checked;
    const isDone = time >= seconds;
    if (isDone && showsUp) yield* view.moves(brush, ends);
    // During a replay a frame may have no time for more than the ink.
    yield* view.path(brush, path, end);
    const now = penAt(path, time);
    if (!isDone && now) yield* this.inkTo(brush, path, end, now);
    view.marks(brush, ends);
    if (!isDone && showsUp) yield* view.moves(brush, ends);
    const rest = { first: end, faint: true };
    if (!isDone) yield* view.path(brush, path, path.length / SAMPLE, rest);
  }

  /** Draws the ink from the last sample to where the pen is now, and the pen. */
  *inkTo(brush, path, end, [x, y, pen]) {
    if (pen && end > 0) {
      const before = path.subarray((end - 1) * SAMPLE, end * SAMPLE);
      yield* this.view.path(brush, new Float32Array([...before, this.time, x, y, pen]), 2);
    }
    this.view.pen(brush, [x, y], pen);
  }

  /** Saves what the pins draw as a file of this kind. */
  save(kind, blob) {
    const address = URL.createObjectURL(blob);
    const link = Object.assign(document.createElement("a"), {
      href: address,
      download: this.computed.name.replace(/\.\w+$/, "") + `.${kind}`,
    });
    link.click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
  }

  /** Saves the same picture in dots. */
  async savePng() {
    const { svg, page } = this.computed;
    const dots = Math.min(DOTS, MOST_DOTS / Math.max(...page));
    const [width, height] = page.map((side) => Math.max(1, Math.round(side * dots)));
    const address = URL.createObjectURL(svg);
    try {
      const picture = Object.assign(new Image(), { src: address });
      await picture.decode();
      const canvas = Object.assign(document.createElement("canvas"), { width, height });
      canvas.getContext("2d").drawImage(picture, 0, 0, width, height);
      const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
      if (!blob) throw new Error("the picture is too large for this browser");
      this.save("png", blob);
    } catch (error) {
      this.problem(`The PNG cannot be made: ${error.message}. Save the SVG instead.`);
    } finally {
      URL.revokeObjectURL(address);
    }
  }
}
