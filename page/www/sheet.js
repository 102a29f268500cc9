// Draws the sheet: the picture of the camera, the ordered drawing, and what the plotter has drawn.

/** The colours of the pens, as in the pictures that penup writes. */
const INK = "#1b1f3b";
const INKS = ["#c1121f", "#0077b6", "#2d6a4f", "#e07a00", "#7b2cbf", "#8a5a2b", "#d81b84"];
const TRAVEL = "#3d7edb";
const START = "#2a9d5c";
const END = "#d7433b";
const PAPER = "#ffffff";
/** The width of a line of ink in mm, and the least in pixels. */
const PEN_WIDTH = 0.3;
const LEAST_PIXELS = 0.9;
/** The numbers of a line, and of a sample of a path. */
const LINE = 5,
  SAMPLE = 4;

/** How many pieces are drawn at once, and how many in a frame at first, at least and at most. */
const CHUNK = 500,
  FIRST_BUDGET = 3_000,
  LEAST_BUDGET = 1_000,
  MOST_BUDGET = 8_000;
/** How far ink may be from the samples of its path, in pixels. */
const STRAIGHT = 0.25;
/** How many arrows are drawn at once, and how many lines take as long as one. */
const ARROWS = 64,
  ARROW_COST = 8;
/** The times between frames in ms that let the budget of a frame shrink, or grow. */
const SLOW = 55,
  FAST = 25;
/** In which order the lines of a large picture are drawn: an eighth of them at a time. */
const EIGHTHS = [0, 4, 2, 6, 1, 5, 3, 7];

export const inkOf = (pen) => (pen < 2 ? INK : INKS[(pen - 2) % INKS.length]);

/** The view of the sheet, and what is on it. */
export class SheetView {
  constructor(canvas) {
    this.canvas = canvas;
    this.page = [210, 297];
    this.zoom = 1;
    this.offset = [0, 0];
    /**
     * What is drawn: a generator that gets the brush, and yields how many pieces it has drawn. A
     * large picture takes several frames, so that the page never freezes; while it moves, only its
     * beginning is seen.
     */
    this.paint = function* () {};
    this.isDue = false;
    this.budget = FIRST_BUDGET;
    this.rest = null;
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Draws at the next frame of the screen. */
  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame((now) => {
      this.isDue = false;
      this.drawNow();
      this.goOn(now);
    });
  }

  /** Draws the next part of the picture, and the rest in the frames that follow. */
  goOn(now) {
    let drawn = 0,
      step;
    do {
      step = this.rest.next();
      drawn += step.value ?? 0;
    } while (!step.done && drawn < this.budget);
    const { rest } = this;
    if (step.done && drawn < LEAST_BUDGET) return;
    requestAnimationFrame((next) => {
      // How long the browser takes for the lines is known when the next frame comes.
      if (next - now > SLOW) this.budget = Math.max(LEAST_BUDGET, Math.round(drawn / 2));
      else if (next - now < FAST) this.budget = Math.min(MOST_BUDGET, Math.round(drawn * 1.5));
      // Another picture may have begun.
      if (!step.done && this.rest === rest && !this.isDue) this.goOn(next);
    });
  }

  /** Pixels of the canvas in a mm. */
  get scale() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const margin = Math.min(36, width * 0.05);
    const fits = Math.min(
      (width - 2 * margin) / this.page[0],
      (height - 2 * margin) / this.page[1],
    );
    return Math.max(0.01, fits) * this.zoom;
  }

  /** Zooms by a factor about a point of the canvas, in pixels from its corner. */
  zoomBy(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const zoom = Math.max(0.3, Math.min(60, this.zoom * factor));
    const real = zoom / this.zoom;
    const from = [x - this.canvas.clientWidth / 2, y - this.canvas.clientHeight / 2];
    this.offset = this.offset.map((c, i) => from[i] + (c - from[i]) * real);
    this.zoom = zoom;
    this.draw();
  }

  moveBy(dx, dy) {
    this.offset = [this.offset[0] + dx, this.offset[1] + dy];
    this.draw();
  }

  fit() {
    this.zoom = 1;
    this.offset = [0, 0];
    this.draw();
  }

  drawNow() {
    const { canvas } = this;
    const ratio = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (
      canvas.width !== Math.round(width * ratio) ||
      canvas.height !== Math.round(height * ratio)
    ) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const brush = canvas.getContext("2d");
    brush.setTransform(1, 0, 0, 1, 0, 0);
    brush.clearRect(0, 0, canvas.width, canvas.height);
    const scale = this.scale * ratio;
    const [w, h] = this.page;
    // From mm with y upwards to pixels.
    brush.setTransform(
      scale,
      0,
      0,
      -scale,
      (width / 2 + this.offset[0]) * ratio - (w / 2) * scale,
      (height / 2 + this.offset[1]) * ratio + (h / 2) * scale,
    );
    brush.save();
    brush.shadowColor = "rgb(0 0 0 / 28%)";
    brush.shadowBlur = 14 * ratio;
    brush.shadowOffsetY = 2 * ratio;
    brush.fillStyle = PAPER;
    brush.fillRect(0, 0, w, h);
    brush.restore();
    brush.globalAlpha = 1;
    brush.lineCap = brush.lineJoin = "round";
    this.pixel = ratio / scale;
    brush.lineWidth = Math.max(PEN_WIDTH, LEAST_PIXELS * this.pixel);
    this.rest = this.paint(brush);
  }

  /**
   * Draws lines: x1, y1, x2, y2 and the pen of each. Of more lines than a frame has time for, those
   * that are drawn first are spread over the picture. `alpha` is how dark they are.
   */
  *lines(brush, lines, alpha = 1) {
    brush.globalAlpha = alpha;
    const count = lines.length / LINE;
    const isLarge = count > this.budget;
    for (const first of isLarge ? EIGHTHS : [0]) {
      yield* this.someLines(brush, lines, first, isLarge ? EIGHTHS.length : 1);
    }
    brush.globalAlpha = 1;
  }

  *someLines(brush, lines, first, every) {
    let pen = NaN,
      drawn = 0;
    for (let at = first * LINE; at < lines.length; at += LINE * every) {
      if (lines[at + 4] !== pen || drawn === CHUNK) {
        if (!Number.isNaN(pen)) {
          brush.stroke();
          yield drawn;
        }
        drawn = 0;
        pen = lines[at + 4];
        brush.strokeStyle = inkOf(pen);
        brush.beginPath();
      }
      brush.moveTo(lines[at], lines[at + 1]);
      brush.lineTo(lines[at + 2], lines[at + 3]);
      drawn++;
    }
    if (!Number.isNaN(pen)) brush.stroke();
    yield drawn;
  }

  /**
   * Draws the samples of a path from `first` on, up to the index `end`: time, x, y and pen of
   * each. `faint` ink is still to be drawn. There are many more samples than lines that differ from
   * them by what can be seen.
   */
  *path(brush, path, end, { first = 0, faint = false } = {}) {
    const alpha = faint ? 0.28 : 1;
    const far = STRAIGHT * this.pixel;
    const [x, y, penOf] = [1, 2, 3].map((part) => (at) => path[at * SAMPLE + part]);
    let drawn = 0,
      at = Math.max(first, 1);
    while (at < end) {
      const pen = penOf(at);
      if (!pen) {
        at++;
        continue;
      }
      brush.globalAlpha = alpha;
      brush.strokeStyle = inkOf(pen);
      brush.beginPath();
      brush.moveTo(x(at - 1), y(at - 1));
      while (at < end && penOf(at) === pen && drawn < CHUNK) {
        at = straightTo(path, at, end, far);
        brush.lineTo(x(at), y(at));
        at++;
        drawn++;
      }
      brush.stroke();
      brush.globalAlpha = 1;
      if (drawn < CHUNK) continue;
      yield drawn;
      drawn = 0;
    }
    yield drawn;
  }

  /**
   * Draws the moves with the pen up between strokes, with an arrow at the middle of each. `ends`
   * are x and y where each stroke begins and where it ends.
   */
  *moves(brush, ends) {
    const size = Math.max(0.9, 4 * this.pixel);
    const count = ends.length / 4;
    for (let first = 1; first < count; first += ARROWS) {
      const end = Math.min(count, first + ARROWS);
      const width = brush.lineWidth;
      brush.strokeStyle = brush.fillStyle = TRAVEL;
      brush.lineWidth = Math.max(0.15, 0.7 * this.pixel);
      brush.beginPath();
      for (let at = first; at < end; at++) {
        brush.moveTo(ends[4 * at - 2], ends[4 * at - 1]);
        brush.lineTo(ends[4 * at], ends[4 * at + 1]);
      }
      brush.globalAlpha = 0.6;
      brush.stroke();
      brush.globalAlpha = 1;
      brush.beginPath();
      for (let at = first; at < end; at++) {
        arrow(brush, ends.subarray(4 * at - 2, 4 * at), ends.subarray(4 * at, 4 * at + 2), size);
      }
      brush.fill();
      brush.lineWidth = width;
      yield ARROW_COST * (end - first);
    }
  }

  /** Marks the start of the first stroke and the end of the last one. */
  marks(brush, ends) {
    if (!ends.length) return;
    const radius = Math.max(0.7, 3.2 * this.pixel);
    brush.fillStyle = START;
    disc(brush, ends.subarray(0, 2), radius);
    brush.fill();
    brush.strokeStyle = END;
    const width = brush.lineWidth;
    brush.lineWidth = Math.max(0.2, 1.4 * this.pixel);
    disc(brush, ends.subarray(-2), radius * 1.4);
    brush.stroke();
    brush.lineWidth = width;
  }

  /** Shows where the pen is: a filled disc if it is down, and a ring if it is up. */
  pen(brush, point, pen) {
    const radius = Math.max(0.9, 5 * this.pixel);
    const width = brush.lineWidth;
    brush.lineWidth = Math.max(0.2, 2 * this.pixel);
    brush.strokeStyle = brush.fillStyle = pen ? END : TRAVEL;
    disc(brush, point, radius);
    if (pen) brush.fill();
    else brush.stroke();
    brush.lineWidth = width;
  }
}

/**
 * The last sample of the straight line from the one before `at` on: with the same pen, before
 * `end`, and with all between them not so `far` from the line as that, in mm.
 */
function straightTo(path, at, end, far) {
  const pen = path[at * SAMPLE + 3];
  const x0 = path[at * SAMPLE - 3],
    y0 = path[at * SAMPLE - 2];
  let ux = 0,
    uy = 0,
    reached = 0;
  for (; at < end && path[at * SAMPLE + 3] === pen; at++) {
    const dx = path[at * SAMPLE + 1] - x0,
      dy = path[at * SAMPLE + 2] - y0;
    if (!ux && !uy) {
      // The first sample that can be told from the beginning tells the direction.
      const length = Math.hypot(dx, dy);
      if (length >= far) [ux, uy, reached] = [dx / length, dy / length, length];
      continue;
    }
    const along = dx * ux + dy * uy;
    if (along < reached - far || Math.abs(dx * uy - dy * ux) > far) break;
    reached = Math.max(reached, along);
  }
  return at - 1;
}

function disc(brush, [x, y], radius) {
  brush.beginPath();
  brush.arc(x, y, radius, 0, 2 * Math.PI);
}

/** Adds an arrow to what is filled. */
function arrow(brush, from, to, size) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  if (length < 2.5 * size) return;
  const [ux, uy] = [dx / length, dy / length];
  const [x, y] = [(from[0] + to[0]) / 2 + (ux * size) / 2, (from[1] + to[1]) / 2 + (uy * size) / 2];
  brush.moveTo(x, y);
  brush.lineTo(x - ux * size - uy * size * 0.45, y - uy * size + ux * size * 0.45);
  brush.lineTo(x - ux * size + uy * size * 0.45, y - uy * size - ux * size * 0.45);
  brush.closePath();
}

/** The index of the first sample of a path behind `time`. */
export function indexAt(path, time) {
  let low = 0,
    high = path.length / SAMPLE;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (path[middle * SAMPLE] <= time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Where the pen of a path is at `time`: x, y, and the pen that is down or 0. */
export function penAt(path, time) {
  const end = indexAt(path, time);
  const sample = (at) => path.subarray(at * SAMPLE, at * SAMPLE + SAMPLE);
  if (end === 0) return path.length ? [path[1], path[2], 0] : null;
  const [t0, x0, y0, p0] = sample(end - 1);
  if (end * SAMPLE >= path.length) return [x0, y0, p0];
  const [t1, x1, y1, p1] = sample(end);
  const part = t1 > t0 ? (time - t0) / (t1 - t0) : 1;
  return [x0 + (x1 - x0) * part, y0 + (y1 - y0) * part, p1];
}
