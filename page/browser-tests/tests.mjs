// Tests of the page in Chromium. `cargo xtask page-test` builds the page and runs them.

import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { mkdtemp, readFile, truncate, writeFile } from "node:fs/promises";
import { request } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { ball } from "./ball.mjs";
import { serve, start } from "./browser.mjs";
import { fakeSerial } from "./fake-serial.mjs";

const run = promisify(execFile);
const { PENUP, PENUP_ROOT, PENUP_PICTURES } = process.env;
const scene = (name) => join(PENUP_ROOT, "scenes", `${name}.obj`);

let server, browser, page, folder;
const problems = [];

before(async () => {
  folder = await mkdtemp(join(tmpdir(), "penup-tests-"));
  server = await serve();
  browser = await start();
});
after(async () => {
  await browser?.close();
  server?.end();
});

/** A page at this address. Whatever it says in the console, or asks of elsewhere, is a problem. */
async function fresh(hash = "", { before = null, address = server.address } = {}) {
  await page?.close();
  problems.length = 0;
  page = await browser.newPage();
  page.on("console", (message) => problems.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => problems.push(`error: ${error.message}`));
  page.on("request", (asked) => {
    if (!asked.url().startsWith(address) && !/^(blob|data):/.test(asked.url()))
      problems.push(`request: ${asked.url()}`);
  });
  if (before) await page.addInitScript(before);
  await page.goto(address + hash);
  await page.waitForSelector("html[data-ready]");
  return page;
}

const text = (selector) => page.textContent(selector);
const shown = (selector) => page.locator(selector).isVisible();
const saved = (name) => PENUP_PICTURES && page.screenshot({ path: join(PENUP_PICTURES, name) });

/** Waits until the page has read this file, and not only begun to. */
const opened = (name) =>
  page.waitForFunction(
    (said) => document.getElementById("file-name").textContent.startsWith(said),
    `${name}: `,
  );

/** Waits until the whole drawing is computed, and returns its figures. */
async function computed() {
  await page.waitForFunction(() => window.penup.drawing.computed);
  return page.evaluate(async () => {
    const { strokes: flat, svg, seconds } = window.penup.drawing.computed;
    const [strokes, pens] = [[], []];
    for (let at = 0; at < flat.length; at += 2 + 2 * flat[at + 1]) {
      pens.push(flat[at]);
      const points = Array.from({ length: flat[at + 1] }, (_, i) => at + 2 + 2 * i);
      strokes.push(points.map((point) => [flat[point], flat[point + 1]]));
    }
    return { strokes, pens, svg: await svg.text(), seconds };
  });
}

/** What `penup preview` makes of the command that the page shows. */
async function preview(file, ...more) {
  const words = (await page.inputValue("#command")).split(" ").slice(3);
  const [svg, json] = [join(folder, "plot.svg"), join(folder, "plot.json")];
  await run(PENUP, ["preview", file, ...words, ...more, "--svg", svg, "--json", json]);
  return { svg: await readFile(svg, "utf8"), ...JSON.parse(await readFile(json, "utf8")) };
}

/**
 * The longest time for a drawing on an emulated board, in milliseconds: many times what it takes on
 * an idle computer. Only what hangs takes longer.
 */
const LONGEST = 600_000;

/** Waits until the page says this of the plotter. An emulated board may take its time. */
const state = (expected, timeout = LONGEST) =>
  page.waitForFunction(
    (want) => document.getElementById("plot-state").textContent.startsWith(want),
    expected,
    { timeout },
  );

test("turned by mouse, hidden lines dashed: the strokes are those of penup preview", async () => {
  await fresh("#file=lattice3.obj");
  const box = await page.locator("#sheet").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let at = 1; at <= 12; at++) await page.mouse.move(x + at * 7, y - at * 2);
  await page.mouse.up();
  const eye = await page.inputValue("#option-eye");
  assert.match(eye, /^-?[\d.]+,-?[\d.]+,-?[\d.]+$/);
  await page.selectOption("#option-hidden", "dashed");
  assert.match(
    await page.inputValue("#command"),
    new RegExp(`^penup preview lattice3.obj --eye[= ]${eye} --at [\\d.,]+ --hidden dashed$`),
  );
  const drawn = await computed();
  await saved("page-see.png");
  const expected = await preview(scene("lattice3"));
  assert.deepEqual(drawn.strokes, expected.strokes);
  assert.deepEqual(drawn.pens, expected.stroke_pens);
  assert.equal(
    drawn.svg,
    expected.svg,
    "the picture of the pins is that of the client, byte for byte",
  );
  await page.click("#tab-check");
  await page.locator("#at").fill(String(drawn.seconds / 2));
  await saved("page-check.png");
  // The link shows the same.
  const link = new URL(page.url()).hash;
  await fresh(link);
  assert.deepEqual((await computed()).strokes, expected.strokes);
  assert.deepEqual(problems, []);
});

test("plot, hold, resume, finish: the ink is that of the preview", async () => {
  await fresh("#file=lattice3.obj&hidden=dotted&page=120x90");
  await page.click("#tab-draw");
  await page.selectOption("#pace", "5");
  await page.click("#plot");
  await state("Drawing");
  await page.waitForFunction(() => window.penup.plotting.count > 400);
  await page.click("#hold");
  await state("Held");
  // It slows down first; then it stands.
  const stands = async () => {
    const count = () => page.evaluate(() => window.penup.plotting.count);
    for (let last = -1, now = await count(); last !== now; [last, now] = [now, await count()])
      await page.waitForTimeout(400);
    return count();
  };
  const held = await stands();
  assert.equal(await page.locator("#hold").isDisabled(), true);
  await saved("page-draw.png");
  await page.click("#resume");
  await page.waitForFunction((count) => window.penup.plotting.count > count, held);
  await page.selectOption("#pace", "1000");
  await state("Drawn");
  const expected = await preview(scene("lattice3"));
  const picture = await page.evaluate(() =>
    window.penup.plotting.board.ask("picture", { page: [120, 90] }),
  );
  sameInk(picture, expected.svg);
  // Once more without a hold, on the same plotter: the same picture but for the way to the start.
  // The second press is none.
  await page.dblclick("#plot");
  await state("Sending");
  await state("Drawn");
  assert.equal(await text("#plot-problem"), "");
  const again = await page.evaluate(() =>
    window.penup.plotting.board.ask("picture", { page: [120, 90] }),
  );
  assert.deepEqual(inkOf(again), inkOf(expected.svg));
  assert.deepEqual(problems, []);
});

test("give up: the pen is up, and the next plot is drawn", async () => {
  await fresh("#file=notched.obj&page=80x60");
  await page.click("#tab-draw");
  await page.click("#plot");
  await state("Drawing");
  await page.click("#give-up");
  await state("Given up");
  await page.selectOption("#pace", "1000");
  await page.waitForFunction(() => !document.getElementById("plot").disabled);
  await page.click("#plot");
  await state("Drawn");
});

test("what the plotter has drawn is moved, and goes when the drawing changes", async () => {
  await fresh("#file=notched.obj&page=80x60");
  const help = (want) =>
    page.waitForFunction(
      (said) => document.getElementById("sheet-help").textContent.startsWith(said),
      want,
    );
  await page.click("#tab-draw");
  await help("Drag to turn");
  await page.selectOption("#pace", "1000");
  await page.click("#plot");
  await state("Drawn");
  await help("Drag to move");
  const box = await page.locator("#sheet").boundingBox();
  await page.mouse.move(box.x + 200, box.y + 200);
  await page.mouse.down();
  await page.mouse.move(box.x + 260, box.y + 230, { steps: 4 });
  await page.mouse.up();
  assert.equal(await page.inputValue("#option-eye"), "", "no camera turns unseen");
  assert.deepEqual(await page.evaluate(() => window.penup.view.offset), [60, 30]);
  // Another file takes the place of the ink.
  const count = () => page.evaluate(() => window.penup.plotting.count);
  assert.ok((await count()) > 0);
  await page.selectOption("#example", "lblock.obj");
  await opened("lblock.obj");
  assert.equal(await count(), 0);
  await help("Drag to turn");
  await page.click("#plot");
  await page.waitForFunction(() => window.penup.plotting.count > 0);
  await state("Drawn");
  // So does another option.
  await page.click("#tab-see");
  await page.selectOption("#option-hidden", "dashed");
  assert.equal(await count(), 0);
  assert.deepEqual(problems, []);
});

test("the pen and its newest ink are seen however long the plotter draws", async () => {
  await fresh("#file=notched.obj");
  const seen = await page.evaluate(() => {
    const { plotting, drawing, view } = window.penup;
    // An hour of strokes, each of 100 samples in a line, with 900 samples of moves between them.
    const all = 180_000;
    const path = new Float32Array(4 * all);
    for (let at = 0; at < all; at++) {
      const stroke = Math.floor(at / 1000);
      const along = Math.min(100, at % 1000);
      const pen = at % 1000 > 0 && at % 1000 <= 100 ? 1 : 0;
      path.set([at / 50, along, stroke, pen], 4 * at);
    }
    // A circle with more samples than can be told from each other.
    const round = 20_000;
    const circle = Float32Array.from({ length: 4 * round }, (_, at) => {
      const angle = (2 * Math.PI * (at >> 2)) / round;
      return [at / 4, 100 + 80 * Math.cos(angle), 100 + 80 * Math.sin(angle), 1][at % 4];
    });
    const lines = [];
    let place = [0, 0];
    const brush = {
      beginPath() {},
      stroke() {},
      fill() {},
      arc: (...disc) => lines.push({ disc }),
      moveTo: (...to) => (place = to),
      lineTo(...to) {
        lines.push({ line: [place, to] });
        place = to;
      },
    };
    // What is drawn, and how many pieces were counted, before the pen is drawn and in all.
    const drawn = (pieces) => {
      lines.length = 0;
      let counted = 0,
        beforePen = null;
      for (const count of pieces) {
        counted += count;
        if (beforePen === null && lines.some((it) => it.disc)) beforePen = counted;
      }
      return { counted, beforePen, lines: lines.filter((it) => it.line).map((it) => it.line) };
    };
    const strokes = drawn(view.path(brush, path, all));
    const whole = drawn(view.path(brush, circle, round));
    const planned = new Float32Array(5 * 50_000);
    Object.assign(plotting, { path, count: 4 * all, planned, phase: "drawing" });
    const plot = drawn(plotting.pieces(brush));
    const ends = new Float64Array(4 * 2000);
    drawing.computed = { path, ends, seconds: all / 50 };
    drawing.time = all / 50 - 1;
    const replay = drawn(drawing.pieces(brush));
    return { strokes, whole, plot, replay, pixel: view.pixel };
  });
  assert.deepEqual(
    seen.strokes.lines,
    Array.from({ length: 180 }, (_, at) => [[0, at], [100, at]]),
    "a stroke is a line, whatever samples it has",
  );
  assert.ok(seen.strokes.counted < 1000);
  assert.ok(seen.whole.counted < 2000, `${seen.whole.counted} lines of a circle`);
  for (const [, [x, y]] of seen.whole.lines)
    assert.ok(Math.abs(Math.hypot(x - 100, y - 100) - 80) < 0.001);
  for (const [[x0, y0], [x1, y1]] of seen.whole.lines) {
    const off = 80 - Math.hypot((x0 + x1) / 2 - 100, (y0 + y1) / 2 - 100);
    assert.ok(off < 0.5 * seen.pixel, `${off} mm from the circle`);
  }
  for (const [name, { beforePen }] of Object.entries({ plot: seen.plot, replay: seen.replay }))
    assert.ok(beforePen < 1000, `${name}: the pen is drawn after ${beforePen} pieces`);
});

test("a serial port that reads in parts and damages bytes draws the same", async () => {
  await fresh("#file=notched.obj&page=80x60", { before: fakeSerial });
  await page.click("#tab-draw");
  await page.selectOption("#plotter", "serial");
  await page.click("#connect");
  await state("Ready");
  await page.evaluate(() => (window.fakeSerial.damageEvery = 211));
  await page.click("#plot");
  await state("Drawn");
  const picture = await page.evaluate(() => window.fakeSerial.picture([80, 60]));
  const expected = await preview(scene("notched"));
  assert.deepEqual(inkOf(picture), inkOf(expected.svg));
  const counts = await page.evaluate(() => window.fakeSerial.counts);
  assert.ok(counts.damaged > 5 && counts.parts > 100 && counts.errors > 0, JSON.stringify(counts));
  // Homing ends an alarm, and nothing else by hand does.
  const locked = await page.evaluate(() => {
    window.penup.plotting.enter("alarm");
    return ["[data-command='$H']", "#pen-up"].map((it) => document.querySelector(it).disabled);
  });
  assert.deepEqual(locked, [false, true]);
  assert.deepEqual(problems, []);
});

test("a plotter that is unplugged is an error, and plugged in again it is found", async () => {
  await fresh("#file=notched.obj&page=80x60", { before: fakeSerial });
  await page.click("#tab-draw");
  await page.selectOption("#plotter", "serial");
  await page.evaluate(() => (window.fakeSerial.refuses = "InvalidStateError"));
  await page.click("#connect");
  await page.waitForFunction(() =>
    /cannot be opened/.test(document.getElementById("plot-problem").textContent),
  );
  await page.evaluate(() => (window.fakeSerial.refuses = ""));
  await page.click("#connect");
  await state("Ready");
  await page.evaluate(() => (window.fakeSerial.pace = 1));
  await page.click("#plot");
  await state("Drawing");
  await page.evaluate(() => window.fakeSerial.unplug());
  await page.waitForFunction(() =>
    /unplugged/.test(document.getElementById("plot-problem").textContent),
  );
  assert.equal(await shown("#plot-problem"), true);
  // The job goes on without the page, which joins it again.
  await page.click("#connect");
  await state("Drawing");
  await page.click("#hold");
  await state("Held");
  await page.click("#resume");
  await page.evaluate(() => (window.fakeSerial.pace = 1000));
  await state("Ready");
});

test("passes that a page no longer begins are named, also when it has joined again", async () => {
  await fresh("#file=notched.obj&page=80x60&multipass=3", { before: fakeSerial });
  await page.click("#tab-draw");
  await page.selectOption("#plotter", "serial");
  await page.click("#connect");
  await page.waitForFunction(() => window.penup.plotting.phase === "ready");
  await page.evaluate(() => (window.fakeSerial.pace = 1));
  await page.click("#plot");
  await state("Drawing");
  await page.evaluate(() => window.fakeSerial.unplug());
  const named = () =>
    page.waitForFunction(() =>
      /The last 2 of 3 passes are not drawn/.test(
        document.getElementById("plot-problem").textContent,
      ),
    );
  await named();
  assert.match(await text("#plot-problem"), /unplugged/);
  await page.click("#connect");
  await state("Drawing");
  await named();
  assert.equal(await shown("#plot-problem"), true);
  assert.deepEqual(problems, []);
});

test("another plotter that is chosen takes the place of a serial port at any time", async () => {
  await fresh("#file=notched.obj&page=80x60", { before: fakeSerial });
  await page.click("#tab-draw");
  await page.selectOption("#pace", "1000");
  await page.click("#plot");
  await state("Drawn");
  const { count, planned } = await page.evaluate(() => {
    const { plotting } = window.penup;
    const before = plotting.count;
    const plotter = document.getElementById("plotter");
    plotter.value = "serial";
    plotter.dispatchEvent(new Event("change"));
    return { count: [before > 0, plotting.count], planned: plotting.planned };
  });
  assert.deepEqual([count, planned], [[true, 0], null], "the ink of the emulated plotter goes");
  // While the port is being opened.
  const gate = (name) =>
    page.evaluate((own) => {
      window.fakeSerial[own] = new Promise((done) => (window.pass = done));
    }, name);
  // Lets the port go on, and waits until all that follows from it at once is done.
  const pass = () =>
    page.evaluate(async () => {
      window.pass();
      for (let at = 0; at < 20; at++) await new Promise((done) => setTimeout(done, 0));
    });
  await gate("opens");
  await page.click("#connect");
  await page.selectOption("#plotter", "emulated");
  await pass();
  assert.equal(await page.evaluate(() => window.penup.plotting.session), null);
  // While the port is being closed.
  await page.selectOption("#plotter", "serial");
  await page.click("#connect");
  await state("Ready");
  await page.waitForFunction(() => window.penup.plotting.phase === "ready");
  await gate("closes");
  await page.selectOption("#plotter", "emulated");
  await page.click("#plot");
  await page.waitForFunction(() => window.penup.plotting.session);
  await pass();
  assert.ok(await page.evaluate(() => Boolean(window.penup.plotting.session)), "it goes on");
  await state("Drawn");
  assert.deepEqual(problems, []);
});

test("keys, undo, names of controls", async () => {
  await fresh("#file=interpen.obj");
  await page.focus("#sheet");
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("ArrowUp");
  const turned = await page.inputValue("#option-eye");
  assert.notEqual(turned, "");
  await page.keyboard.press("PageUp");
  assert.notEqual(await page.inputValue("#option-eye"), turned);
  await page.keyboard.press("Control+z");
  assert.equal(await page.inputValue("#option-eye"), "", "keys in a row are one step");
  await page.keyboard.press("Control+Shift+z");
  assert.notEqual(await page.inputValue("#option-eye"), "");
  await page.focus("#tab-see");
  await page.keyboard.press("ArrowRight");
  assert.equal(await shown("#panel-check"), true);
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll("input, select, button, canvas, progress")]
      .filter(
        (it) => !(it.labels?.length || it.getAttribute("aria-label") || it.textContent.trim()),
      )
      .map((it) => it.outerHTML),
  );
  assert.deepEqual(nameless, []);
  // Whatever the table of options has is a control, with its help.
  const { stdout } = await run(PENUP, ["preview", "--help"]);
  const flags = [...stdout.matchAll(/^ +--([a-z-]+)/gm)].map(([, name]) => name);
  const own = new Set(
    "svg png json motion repeat board machine quiet gcode hpgl".split(" "),
  );
  for (const name of flags.filter((flag) => !own.has(flag))) {
    assert.equal(await page.locator(`#option-${name}`).count(), 1, name);
  }
  assert.deepEqual(problems, []);
});

test("a large model turns as outlines, and has all its lines when it rests", async () => {
  await fresh();
  const file = { name: "ball.obj", mimeType: "text/plain", buffer: ball(101) };
  await page.setInputFiles("#file", file);
  await opened("ball.obj");
  const count = () => page.evaluate(() => window.penup.lines().length / 5);
  await page.waitForFunction(() => window.penup.lines().length > 5 * 8000);
  const whole = await count();
  await page.focus("#sheet");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction((most) => window.penup.lines().length < most, 5 * 1000);
  assert.ok((await count()) > 50, "the outlines are drawn");
  // Nothing else is asked for.
  await page.waitForFunction(() => window.penup.frames.whole.length === 1);
  assert.ok((await count()) > 0.9 * whole, "all lines are drawn at rest");
  await page.keyboard.press("Control+z");
  await page.waitForFunction((all) => window.penup.lines().length === all, 5 * whole);
  assert.deepEqual(problems, []);
});

test("errors are said on the page, and what was open stays", async () => {
  await fresh("#file=cube-that-is-not.obj");
  assert.match(await text("#file-name"), /lattice3/);
  const garbage = join(folder, "garbage.obj");
  await writeFile(garbage, Buffer.from([0x76, 0x20, 0x31, 0, 0xff, 0xfe, 0x0a]));
  const huge = join(folder, "huge.obj");
  await writeFile(huge, "v 0 0 0\n");
  await truncate(huge, 200 << 20);
  const unknown = join(folder, "photo.bin");
  await writeFile(unknown, "GIF89a");
  for (const [file, said] of [
    [garbage, /garbage\.obj:1/],
    [huge, /210 MB/],
    [unknown, /an image of pixels/],
  ]) {
    await page.setInputFiles("#file", file);
    await page.waitForFunction(
      (want) => new RegExp(want).test(document.querySelector("#error p").textContent),
      said.source,
    );
    assert.match(await text("#file-name"), /lattice3/);
    await page.click("#error button");
  }
  await page.fill("#option-crease", "999");
  await page.press("#option-crease", "Enter");
  await page.waitForSelector("#option-crease-problem:not([hidden])");
  await page.fill("#option-crease", "10");
  await page.press("#option-crease", "Enter");
  await page.waitForSelector("#option-crease-problem", { state: "hidden" });
  // A board that is too small says so.
  await page.setInputFiles("#file", scene("lattice6"));
  await opened("lattice6.obj");
  await page.click("#tab-check");
  await page.selectOption("#board", "lm3s6965");
  await page.waitForFunction(() =>
    /lm3s6965 would refuse.*1000/.test(document.getElementById("check-problem").textContent),
  );
  assert.deepEqual(problems, []);
});

test("behind a file that is refused, what was open is drawn with all options", async () => {
  await fresh("#file=notched.obj");
  await computed();
  const lines = await page.evaluate(() => window.penup.lines().length);
  const garbage = { name: "bad.obj", mimeType: "text/plain", buffer: Buffer.from("v 1 2\n") };
  const refused = () =>
    page.waitForFunction(() => /bad\.obj/.test(document.querySelector("#error p").textContent));
  // An option that is refused does not lose the model.
  await page.fill("#option-crease", "999");
  await page.press("#option-crease", "Enter");
  await page.waitForSelector("#option-crease-problem:not([hidden])");
  await page.setInputFiles("#file", garbage);
  await refused();
  await page.fill("#option-crease", "");
  await page.press("#option-crease", "Enter");
  await computed();
  assert.equal(await page.evaluate(() => window.penup.lines().length), lines);
  // A picture that was being computed when the file was opened is not forgotten.
  await page.evaluate(() => {
    const bytes = new TextEncoder().encode("v 1 2\n");
    Blob.prototype.arrayBuffer = async () => bytes.buffer;
    const hidden = document.getElementById("option-hidden");
    hidden.value = "dashed";
    hidden.dispatchEvent(new Event("change", { bubbles: true }));
    const chosen = new DataTransfer();
    chosen.items.add(new File([bytes], "bad.obj"));
    const input = document.getElementById("file");
    input.files = chosen.files;
    input.dispatchEvent(new Event("change", { bubbles: true }));
  });
  await refused();
  await computed();
  assert.ok((await page.evaluate(() => window.penup.lines().length)) > lines);
  assert.deepEqual(problems, []);
});

test("of two files the one that was chosen last is opened, whichever is read first", async () => {
  await fresh("#file=notched.obj");
  await page.evaluate(() => {
    const read = Blob.prototype.arrayBuffer;
    const slow = new Promise((done) => (window.readSlow = done));
    Blob.prototype.arrayBuffer = async function () {
      if (this.name === "slow.obj") await slow;
      return read.call(this);
    };
  });
  const content = await readFile(scene("lblock"));
  const file = (name) => ({ name, mimeType: "text/plain", buffer: content });
  await page.setInputFiles("#file", file("slow.obj"));
  await page.setInputFiles("#file", file("fast.obj"));
  await opened("fast.obj");
  await page.evaluate(async () => {
    window.readSlow();
    await new Promise((done) => setTimeout(done, 0));
  });
  await computed();
  assert.match(await text("#file-name"), /^fast\.obj/);
  assert.deepEqual(problems, []);
});

test("a pasted link is opened, and the link to a file names no other", async () => {
  await fresh("#file=notched.obj");
  await page.evaluate(() => (location.hash = "#file=lblock.obj&hidden=dashed"));
  await opened("lblock.obj");
  await page.waitForSelector("html[data-ready]");
  assert.equal(await page.inputValue("#option-hidden"), "dashed");
  const link = async () => {
    await page.click("#copy-link");
    return new URL(await page.evaluate(() => navigator.clipboard.readText())).hash;
  };
  assert.equal(await link(), "#file=lblock.obj&hidden=dashed");
  await page.setInputFiles("#file", scene("interpen"));
  await opened("interpen.obj");
  assert.equal(await link(), "#hidden=dashed", "a file of one's own is in no link");
  const own = await program(scene("notched"));
  try {
    await fresh(own.hash, { address: own.folder });
    assert.equal(await link(), "#given=notched.obj");
    await page.selectOption("#example", "lblock.obj");
    await opened("lblock.obj");
    assert.equal(await link(), "#file=lblock.obj");
    assert.deepEqual(problems, []);
  } finally {
    own.end();
  }
});

test("without a network it works once it was loaded", async () => {
  const own = await serve();
  await fresh("", { address: own.address });
  await page.waitForFunction(() => navigator.serviceWorker.controller);
  own.end();
  await page.context().setOffline(true);
  await page.reload();
  await page.waitForSelector("html[data-ready]");
  assert.match(await text("#file-name"), /lattice3/);
  await page.context().setOffline(false);
});

test("an open page keeps its version while a newer one is loaded", async () => {
  let version = 1;
  // The browser may keep the files by itself, too.
  const own = await serve({
    headers: { "Cache-Control": "max-age=3600" },
    edited: (name, content) =>
      name === "worker.js" || name === "offline.js"
        ? `${content.toString().replace('"penup-', `"penup-${version}-`)}\n// Version ${version}.`
        : content,
  });
  const versionOf = async () =>
    /Version (\d)/.exec(await page.evaluate(async () => (await fetch("worker.js")).text()))[1];
  try {
    await fresh("", { address: own.address });
    await page.waitForFunction(() => navigator.serviceWorker.controller);
    assert.equal(await versionOf(), "1");
    version = 2;
    await page.evaluate(async () => {
      const registration = await navigator.serviceWorker.ready;
      await registration.update();
      const worker = registration.installing ?? registration.waiting ?? registration.active;
      const isSettled = () => ["installed", "activated", "redundant"].includes(worker.state);
      while (!isSettled())
        await new Promise((done) => {
          worker.addEventListener("statechange", done, { once: true });
        });
    });
    for (let at = 0; at < 20; at++)
      assert.equal(await versionOf(), "1", "an open page keeps its files");
    const waiting = await page.evaluate(async () =>
      Boolean((await navigator.serviceWorker.ready).waiting),
    );
    assert.ok(waiting, "the newer version waits");
    await page.goto("about:blank");
    // The newer one takes over once no page is open.
    await fresh("", { address: own.address });
    for (let tries = 0; (await versionOf()) === "1" && tries < 50; tries++)
      await fresh("", { address: own.address });
    assert.equal(await versionOf(), "2", "the files of the newer version, not those kept before");
  } finally {
    own.end();
  }
});

/** Starts `penup page` with these arguments. Returns its address, and how to end it. */
async function program(...more) {
  const own = ["--no-browser", "--folder", process.env.PENUP_PAGE];
  const started = spawn(PENUP, ["page", ...more, ...own]);
  let said = "";
  started.stderr.on("data", (text) => (said += text));
  const address = await new Promise((done, fail) => {
    started.stdout.once("data", (line) => done(String(line).trim()));
    started.once("exit", () => fail(new Error(`penup page ended: ${said}`)));
  });
  return { ...splitAddress(address), address, end: () => started.kill() };
}

function splitAddress(address) {
  const { origin, pathname, port, hash } = new URL(address);
  return { origin, pathname, port, hash, folder: origin + pathname };
}

/** Asks a server. Returns the status; 101 if it opens a WebSocket, which then is `socket`. */
function ask({ port }, path, headers) {
  return new Promise((done, fail) => {
    request({ host: "127.0.0.1", port, path, headers })
      .on("response", (answer) => {
        answer.resume();
        done({ status: answer.statusCode });
      })
      .on("upgrade", (_, socket, head) => done({ status: 101, socket, head }))
      .on("error", fail)
      .end();
  });
}

const WEBSOCKET = {
  Connection: "Upgrade",
  Upgrade: "websocket",
  "Sec-WebSocket-Version": "13",
  "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
};

test("penup page serves the file to its owner alone", async () => {
  const own = await program(scene("notched"));
  try {
    assert.match(own.address, /^http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\/#given=notched\.obj$/);
    const { pathname } = own;
    await fresh(own.hash, { address: own.folder });
    assert.match(await text("#file-name"), /^notched\.obj/);
    await computed();
    assert.deepEqual(problems, []);
    const status = async (path, headers) => (await ask(own, path, headers)).status;
    assert.equal(await status(pathname, {}), 200);
    assert.equal(await status("/", {}), 403, "no token");
    assert.equal(await status(pathname.replace(/[0-9a-f]/, "x"), {}), 403, "a wrong token");
    assert.equal(
      await status(pathname, { Host: "evil.example" }),
      403,
      "another name of this computer",
    );
    assert.equal(
      await status(pathname, { Origin: "http://evil.example" }),
      403,
      "a page from elsewhere",
    );
    assert.equal(await status(`${pathname}../../../etc/passwd`, {}), 404);
    const own_origin = { ...WEBSOCKET, Origin: own.origin };
    assert.equal(await status(`${pathname}plotter`, own_origin), 404, "no plotter is joined");
  } finally {
    own.end();
  }
  const huge = join(folder, "huge.svg");
  await writeFile(huge, "");
  await truncate(huge, 200 << 20);
  await assert.rejects(program(huge), /larger than 64 MB/);
});

test("penup page draws the texts of an SVG in the fonts of the computer", async () => {
  const svg = join(folder, "letter.svg");
  await writeFile(
    svg,
    `<svg xmlns="http://www.w3.org/2000/svg" width="80mm" height="60mm" viewBox="0 0 80 60">
    <rect x="5" y="5" width="70" height="50" fill="none" stroke="black"/>
    <text x="10" y="40" font-size="20">penup</text></svg>`,
  );
  const own = await program(svg);
  try {
    await fresh(own.hash, { address: own.folder });
    await opened("letter.svg");
    const drawn = await computed();
    const expected = await preview(svg);
    assert.ok(drawn.strokes.length > 5, "the rectangle, and letters");
    assert.deepEqual(drawn.strokes, expected.strokes);
    assert.equal(drawn.svg, expected.svg);
    // What is wrong is said, with the names of the controls.
    await page.fill("#option-hatch", "0,x");
    await page.press("#option-hatch", "Enter");
    await page.waitForSelector("#option-hatch-problem:not([hidden])");
    assert.deepEqual(problems, []);
    own.end();
    await page.setInputFiles("#file", svg);
    await page.waitForFunction(() => /start/.test(document.querySelector("#error p").textContent));
  } finally {
    own.end();
  }
});

test("through the client: turn, dash, plot, hold, resume; the ink is the preview's", async () => {
  const own = await program(scene("lattice3"), "--board", "lm3s6965");
  try {
    await fresh(`${own.hash}&page=100x80`, { address: own.folder });
    await page.focus("#sheet");
    for (let at = 0; at < 3; at++) await page.keyboard.press("ArrowLeft");
    await page.selectOption("#option-hidden", "dashed");
    const drawn = await computed();
    const expected = await preview(scene("lattice3"), "--board", "lm3s6965");
    assert.deepEqual(drawn.strokes, expected.strokes, "page and preview --board");
    await page.click("#tab-draw");
    assert.equal(await page.inputValue("#plotter"), "program");
    await page.click("#connect");
    await state("Ready");
    await page.click("#plot");
    await state("Drawing");
    await page.click("#hold");
    await state("Held");
    assert.equal(await page.locator("#hold").isDisabled(), true);
    const count = () => page.evaluate(() => window.penup.plotting.count);
    // It slows down first; then it stands.
    for (let last = -1, now = await count(); last !== now; [last, now] = [now, await count()])
      await page.waitForTimeout(400);
    const held = await count();
    // Another page, and others than the owner, do the job no harm.
    const other = await browser.newPage();
    await other.goto(own.folder + own.hash);
    await other.waitForSelector("html[data-ready]");
    await other.click("#tab-draw");
    await other.click("#connect");
    await other.waitForFunction(() =>
      /Another page/.test(document.getElementById("plot-problem").textContent),
    );
    await other.close();
    const path = `${own.pathname}plotter`;
    const status = async (from, headers) =>
      (await ask(own, from, { ...WEBSOCKET, ...headers })).status;
    assert.equal(await status(path, {}), 404, "no origin");
    assert.equal(await status(path, { Origin: "http://evil.example" }), 403);
    assert.equal(await status(path, { Origin: own.origin, Host: "evil.example" }), 403);
    assert.equal(await status("/0123/plotter", { Origin: own.origin }), 403, "a wrong token");
    // The page goes, and somebody with the token sends 200 MB, what is no frame, and garbage.
    await page.click("#disconnect");
    const masked = (size) => {
      const head = Buffer.alloc(14);
      head.writeUInt16BE(0x82ff);
      head.writeBigUInt64BE(BigInt(size), 2);
      return head;
    };
    /** A whole frame of this kind with a few letters, masked by zeros. */
    const frame = (kind, letters) => {
      const content = Buffer.from(letters, "latin1");
      return Buffer.concat([Buffer.from([kind, 0x80 | content.length, 0, 0, 0, 0]), content]);
    };
    for (const [bytes, code] of [
      [masked(200 << 20), 1009],
      [Buffer.from([0xf3, 0x81, 0, 0, 0, 0, 7]), 1002],
      [frame(0x82, "\x18\x00garbage\x7f"), 1003],
      [frame(0x81, "$X"), 1003],
      [frame(0x81, '{"pen":-1}'), 1003],
    ]) {
      assert.equal(await refusedWith(own, path, bytes), code);
    }
    // A page that comes back follows the job.
    await page.click("#connect");
    await state("Held");
    assert.equal(await count(), 0, "nothing moved meanwhile");
    await page.click("#resume");
    await page.waitForFunction(
      () => document.getElementById("plot-state").textContent === "Ready.",
      undefined,
      { timeout: LONGEST },
    );
    assert.ok(held > 0 && (await count()) > 0);
    // Once more, whole: the ink from the pins of the firmware is that of the preview.
    await page.click("#plot");
    await state("Drawn");
    const ink = await page.evaluate(() => {
      const { path, count } = window.penup.plotting;
      return [...path.subarray(0, count)];
    });
    // From one sample to the next the pen leaves the straight line by two steps at most.
    sameSegments(segmentsOfPath(ink, 80), segmentsOf(expected.svg), { far: 0.05, part: 0.003 });
    assert.deepEqual(problems, []);
  } finally {
    own.end();
  }
});

/** The code with which a WebSocket is closed at which somebody with the token sends `bytes`. */
async function refusedWith(own, path, bytes) {
  for (let tries = 0; tries < 50; tries++) {
    const { socket, head } = await ask(own, path, { ...WEBSOCKET, Origin: own.origin });
    socket.write(bytes);
    const parts = [head];
    for await (const part of socket) {
      parts.push(part);
      const all = Buffer.concat(parts);
      const close = all.indexOf(0x88);
      if (close >= 0 && all.length >= close + 4) {
        socket.destroy();
        break;
      }
    }
    const all = Buffer.concat(parts);
    const code = all.readUInt16BE(all.indexOf(0x88) + 2);
    // The place of the one before is not free yet.
    if (code !== 4000) return code;
    await new Promise((done) => setTimeout(done, 100));
  }
  return 4000;
}

test("SVG and PLY are read when they are opened, and plans are arranged", async () => {
  await fresh("#file=notched.obj");
  const asked = () =>
    page.evaluate(() => performance.getEntriesByType("resource").map((it) => it.name).join());
  assert.doesNotMatch(await asked(), /reader\.js/, "not before it is needed");
  const svg = join(folder, "house.svg");
  await writeFile(
    svg,
    `<svg xmlns="http://www.w3.org/2000/svg" width="80mm" height="60mm" viewBox="0 0 80 60">
    <g id="walls"><path d="M20 50V30L40 15L60 30V50Z" fill="red" stroke="black"/></g>
    <circle cx="40" cy="38" r="6" fill="none" stroke="blue"/></svg>`,
  );
  await page.setInputFiles("#file", svg);
  await opened("house.svg");
  const same = async (file) => {
    const drawn = await computed();
    const expected = await preview(file);
    assert.deepEqual(drawn.strokes, expected.strokes);
    assert.deepEqual(drawn.pens, expected.stroke_pens);
    assert.equal(drawn.svg, expected.svg);
  };
  await same(svg);
  const set = async (name, value) => {
    await page.evaluate(() => (window.penup.drawing.computed = null));
    await page.fill(`#option-${name}`, value);
    await page.press(`#option-${name}`, "Enter");
  };
  await set("hatch", "2,30");
  await same(svg);
  await set("scale", "1.25");
  await page.evaluate(() => (window.penup.drawing.computed = null));
  await page.check("#option-center");
  await same(svg);
  await set("crop", "nowhere");
  await page.waitForSelector("#option-crop-problem:not([hidden])");
  await set("crop", "");
  // A hatch keeps its distance on the paper where the plan is scaled to the page.
  await page.evaluate(() => (window.penup.drawing.computed = null));
  await page.uncheck("#option-center");
  await set("scale", "");
  await page.evaluate(() => (window.penup.drawing.computed = null));
  await page.check("#option-fit");
  await same(svg);
  await page.evaluate(() => (window.penup.drawing.computed = null));
  await page.uncheck("#option-fit");
  await same(svg);
  const ply = join(folder, "square.ply");
  await writeFile(
    ply,
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n" +
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
      "0 0 0\n1 0 0\n1 1 0.2\n0 1 0.2\n4 0 1 2 3\n",
  );
  await page.evaluate(() => (window.penup.drawing.computed = null));
  await page.setInputFiles("#file", ply);
  await opened("square.ply");
  // The hatch is left out, and the user is told why.
  const left = await page.textContent("#notes");
  assert.match(left, /Without options for plans: .*hatch/);
  await same(ply);
  // What cannot be read is an error, and the next file is read all the same.
  const nested = join(folder, "nested.svg");
  const depth = 60_000;
  await writeFile(
    nested,
    '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9">' +
      `${"<g>".repeat(depth)}<path d="M0 0H9"/>${"</g>".repeat(depth)}</svg>`,
  );
  await page.setInputFiles("#file", nested);
  await page.waitForFunction(() => /nested/.test(document.querySelector("#error p").textContent));
  assert.match(await text("#file-name"), /square/);
  await page.setInputFiles("#file", svg);
  await opened("house.svg");
});

test("a model is seen from a side, upright, and a drag turns it from there", async () => {
  await fresh("#file=lblock.obj");
  await page.selectOption("#option-view", "right");
  await page.check("#option-y-up");
  const drawn = await computed();
  assert.deepEqual(drawn.strokes, (await preview(scene("lblock"))).strokes);
  await page.focus("#sheet");
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("ArrowUp");
  assert.match(await page.inputValue("#command"), /--eye/);
  assert.doesNotMatch(await page.inputValue("#command"), /--view/);
  assert.match(await page.inputValue("#command"), /--y-up/);
  await page.waitForFunction(() => window.penup.drawing.computed);
  assert.deepEqual((await computed()).strokes, (await preview(scene("lblock"))).strokes);
  assert.deepEqual(problems, []);
});

test("from above and from below, a drag turns the picture as it stands", async () => {
  for (const [view, key] of [
    ["top", "ArrowDown"],
    ["bottom", "ArrowUp"],
  ]) {
    await fresh(`#file=lblock.obj&view=${view}`);
    await page.focus("#sheet");
    await page.keyboard.press(key);
    const [eye, at] = await Promise.all(
      ["eye", "at"].map(async (name) =>
        (await page.inputValue(`#option-${name}`)).split(",").map(Number),
      ),
    );
    const [x, y] = eye.map((c, axis) => c - at[axis]);
    assert.ok(Math.abs(x) < 1e-3 * Math.abs(y), `${view}: ${eye} at ${at}`);
    assert.ok(y < 0, `${view}: ${eye} at ${at}`);
  }
  assert.deepEqual(problems, []);
});

test("a field that has the focus shows the value in force, or what is being typed", async () => {
  await fresh("#file=lblock.obj");
  await page.fill("#option-azimuth", "30");
  await page.press("#option-azimuth", "Enter");
  await page.waitForFunction(() => document.getElementById("command").value.includes("azimuth"));
  const wheel = () =>
    page.evaluate(() =>
      document
        .getElementById("sheet")
        .dispatchEvent(new WheelEvent("wheel", { deltaY: 40, altKey: true, cancelable: true })),
    );
  // The eye takes the place of the direction.
  await wheel();
  assert.equal(await page.inputValue("#option-azimuth"), "");
  await page.keyboard.type("4");
  await wheel();
  assert.equal(await page.inputValue("#option-azimuth"), "4");
  assert.deepEqual(problems, []);
});

test("touch: one finger turns, two zoom and move", async () => {
  await fresh("#file=notched.obj");
  const box = await page.locator("#sheet").boundingBox();
  const [x, y] = [Math.round(box.x + box.width / 2), Math.round(box.y + box.height / 2)];
  const session = await page.context().newCDPSession(page);
  const touch = (type, ...points) =>
    session.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })),
    });
  await touch("touchStart", [x, y]);
  for (let at = 1; at < 8; at++) await touch("touchMove", [x + 9 * at, y + 3 * at]);
  await touch("touchEnd");
  const eye = await page.inputValue("#option-eye");
  assert.notEqual(eye, "", "one finger turns");
  const sheet = () =>
    page.evaluate(() => ({ zoom: window.penup.view.zoom, offset: window.penup.view.offset }));
  const before = await sheet();
  await touch("touchStart", [x - 40, y], [x + 40, y]);
  for (let at = 1; at < 8; at++)
    await touch("touchMove", [x - 40 - 5 * at, y + 6 * at], [x + 40 + 5 * at, y + 6 * at]);
  await touch("touchEnd");
  const after = await sheet();
  assert.ok(after.zoom > before.zoom * 1.5, `two fingers zoom: ${after.zoom}`);
  assert.ok(after.offset[1] > before.offset[1] + 20, "two fingers move");
  assert.equal(await page.inputValue("#option-eye"), eye, "two fingers do not turn");
  // Neither does the last of two fingers, nor does either of them, or a tap, change what is undone.
  await page.click("#undo");
  assert.equal(await page.inputValue("#option-eye"), "", "the turn is one step");
  await touch("touchStart", [x - 40, y], [x + 40, y]);
  await touch("touchMove", [x - 60, y], [x + 60, y]);
  await touch("touchEnd", [x - 60, y]);
  for (let at = 1; at < 8; at++) await touch("touchMove", [x - 60 - 9 * at, y]);
  await touch("touchEnd");
  await touch("touchStart", [x, y]);
  await touch("touchEnd");
  assert.equal(await page.inputValue("#option-eye"), "", "the last of two fingers does not turn");
  await page.click("#redo");
  assert.equal(await page.inputValue("#option-eye"), eye);
  assert.deepEqual(problems, []);
});

test("pictures are saved, as SVG and as PNG", async () => {
  await fresh("#file=notched.obj&page=80x60");
  const { svg } = await computed();
  await page.click("#tab-check");
  const save = async (button) => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
    return [download.suggestedFilename(), await readFile(await download.path())];
  };
  const [name, bytes] = await save("#export-svg");
  assert.equal(name, "notched.svg");
  assert.equal(bytes.toString(), svg);
  const [picture, dots] = await save("#export-png");
  assert.equal(picture, "notched.png");
  assert.equal(dots.toString("latin1", 1, 4), "PNG");
  const [program, gcode] = await save("#export-gcode");
  assert.equal(program, "notched.gcode");
  const [plot, hpgl] = await save("#export-hpgl");
  assert.equal(plot, "notched.hpgl");
  // What was saved draws the same ink when it is opened again.
  for (const [own, content] of [[program, gcode], [plot, hpgl]]) {
    const path = join(folder, own);
    await writeFile(path, content);
    await run(PENUP, ["preview", path, "--page", "80x60", "--margin", "0", "--svg", `${path}.svg`]);
    sameInk(await readFile(`${path}.svg`, "utf8"), svg);
  }
  assert.deepEqual([dots.readUInt32BE(16), dots.readUInt32BE(20)], [640, 480], "8 dots in a mm");
  assert.deepEqual(problems, []);
});

test("passes are drawn one after the other, and saved as the program saves them", async () => {
  await fresh("#file=notched.obj&page=80x60");
  const once = await computed();
  await page.fill("#option-multipass", "0");
  await page.press("#option-multipass", "Enter");
  await page.waitForSelector("#option-multipass-problem:not([hidden])");
  await page.fill("#option-multipass", "3");
  await page.press("#option-multipass", "Enter");
  await page.check("#option-reloop");
  assert.equal(
    await page.inputValue("#command"),
    "penup preview notched.obj --page 80x60 --multipass 3 --reloop --gcode notched.gcode",
  );
  const drawn = await computed();
  assert.deepEqual(drawn.strokes, once.strokes, "the first pass is shown");
  await page.click("#tab-check");
  assert.match(await text("#check-state"), /for 3 passes/);
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.click("#export-gcode"),
  ]);
  const [own, json] = [join(folder, "passes.gcode"), join(folder, "passes.json")];
  const options = "--page 80x60 --multipass 3 --reloop".split(" ");
  await run(PENUP, ["preview", scene("notched"), ...options, "--gcode", own, "--json", json]);
  const { duration_s } = JSON.parse(await readFile(json, "utf8"));
  assert.equal(await readFile(await download.path(), "utf8"), await readFile(own, "utf8"));
  const seconds = await page.evaluate(() => window.penup.drawing.allSeconds);
  assert.ok(Math.abs(seconds - duration_s) < 0.5, `${seconds} and ${duration_s} s`);
  // The plotter of the page draws all passes, each over the last.
  await page.click("#tab-draw");
  await page.selectOption("#pace", "1000");
  await page.click("#plot");
  await state("Drawn 3 times");
  const ink = await page.evaluate(() => {
    const { path, count } = window.penup.plotting;
    return [...path.subarray(0, count)];
  });
  const length = segmentsOfPath(ink, 60).reduce(
    (sum, [p, q]) => sum + Math.hypot(q[0] - p[0], q[1] - p[1]),
    0,
  );
  const first = segmentsOf(once.svg).reduce(
    (sum, [p, q]) => sum + Math.hypot(q[0] - p[0], q[1] - p[1]),
    0,
  );
  assert.ok(Math.abs(length / first - 3) < 0.01, `${length} mm for ${first} mm thrice`);
  assert.deepEqual(problems, []);
});

test("the drawing is computed with the settings of the machine", async () => {
  await fresh("#file=notched.obj&page=80x60");
  const usual = await computed();
  await page.click("#tab-check");
  const file = (name, content) => ({ name, mimeType: "text/plain", buffer: Buffer.from(content) });
  const said = (want) =>
    page.waitForFunction(
      (text) => new RegExp(text).test(document.querySelector("#error p").textContent),
      want,
    );
  await page.setInputFiles("#machine-file", file("port.toml", "port = 1\n"));
  await said("no table");
  await page.setInputFiles("#machine-file", file("bad.toml", "[settings]\nfast = 1\n"));
  await said("fast = 1");
  // A machine that is too small, and one whose motors move both axes.
  await page.setInputFiles("#machine-file", file("small.toml", "[settings]\n130 = 40 # x\n"));
  await page.waitForFunction(() =>
    /130|travel|machine/i.test(document.getElementById("check-problem").textContent),
  );
  await page.setInputFiles("#machine-file", file("corexy.toml", "[settings]\n230 = 1\n"));
  for (const place of ["notes", "check-problem"]) {
    await page.waitForFunction(
      (id) => /penup preview/.test(document.getElementById(id).textContent),
      place,
    );
  }
  const slow = "[settings]\n204 = 10\n\n100 = 40.0 # steps per mm of x\n101 = 40.0\n";
  await page.setInputFiles("#machine-file", file("slow.toml", slow));
  await page.waitForFunction(
    () => document.getElementById("option-set").value === "204=10,100=40.0,101=40.0",
  );
  const drawn = await computed();
  const expected = await preview(scene("notched"));
  assert.deepEqual(drawn.strokes, expected.strokes);
  assert.equal(drawn.svg, expected.svg);
  assert.ok(Math.abs(drawn.seconds - expected.duration_s) < 0.5);
  assert.ok(drawn.seconds > usual.seconds, "it is slower");
  // So is the emulated plotter.
  await page.click("#tab-draw");
  await page.selectOption("#pace", "1000");
  await page.click("#plot");
  await state("Drawn");
  const picture = await page.evaluate(() =>
    window.penup.plotting.board.ask("picture", { page: [80, 60] }),
  );
  assert.deepEqual(inkOf(picture), inkOf(expected.svg));
  // A Pico whose motors turn round and have backlash, and whose pen needs ink again and again.
  const pico = "[settings]\n3 = 1\n215 = 0.1\n226 = 0\n235 = 0.5\n237 = 0\n";
  await page.setInputFiles("#machine-file", file("pico.toml", pico));
  await page.waitForFunction(() => document.getElementById("option-set").value.startsWith("3=1"));
  assert.equal((await computed()).svg, (await preview(scene("notched"))).svg);
  assert.deepEqual(problems, []);
});

test("speeds, heights and a square by hand, and a job that has stopped", async () => {
  await fresh("#file=lattice3.obj");
  await page.click("#tab-draw");
  await page.selectOption("#pace", "1000");
  await page.click("#by-hand summary");
  await page.selectOption("#jog-mm", "10");
  await page.click("[data-jog='1,0']");
  await page.waitForFunction(() => window.penup.plotting.phase === "ready");
  await page.click("#heights-read");
  await page.waitForFunction(() => document.getElementById("height-down").value === "127");
  await page.fill("#height-down", "90");
  await page.press("#height-down", "Enter");
  await page.waitForTimeout(300);
  await page.fill("#height-up", "5");
  await page.press("#height-up", "Enter");
  await page.waitForTimeout(300);
  await page.fill("#height-up", "");
  await page.click("#heights-read");
  await page.waitForFunction(() => document.getElementById("height-up").value === "5");
  await page.waitForTimeout(300);
  await page.evaluate(() => window.penup.plotting.clear());
  await page.click("#test-square");
  await page.waitForFunction(() => {
    const { path, count } = window.penup.plotting;
    const [xs, ys] = [[], []];
    for (let at = 0; at < count; at += 4) {
      if (path[at + 3]) xs.push(path[at + 1]), ys.push(path[at + 2]);
    }
    const span = (list) => Math.max(...list) - Math.min(...list);
    return xs.length && Math.abs(span(xs) - 20) < 0.02 && Math.abs(span(ys) - 20) < 0.02;
  });
  // What moves by hand is held, and then given up or resumed.
  await page.waitForFunction(() => !window.penup.plotting.moves);
  await page.selectOption("#pace", "1");
  await page.click("#test-square");
  await state("Moving");
  await page.click("#hold");
  await state("Held");
  assert.equal(await page.locator("#plot").isDisabled(), true);
  await page.click("#give-up");
  await state("Given up");
  await page.waitForFunction(() => window.penup.plotting.phase === "ready");
  await page.selectOption("#pace", "5");
  await page.click("#plot");
  await state("Drawing");
  const percent = (want) =>
    page.waitForFunction(
      (shown) => document.getElementById("percent").textContent === shown,
      `${want} %`,
    );
  await page.click("#faster");
  await percent(110);
  await page.click("#slower");
  await percent(100);
  await page.click("#slower");
  await percent(90);
  await page.click("#as-set");
  await percent(100);
  await page.click("#give-up");
  await state("Given up");
  await page.waitForFunction(() => window.penup.plotting.phase === "ready");
  // The emulated plotter of the page keeps no jobs, so the status of one that does is said here.
  // The next status of the emulated one takes its place, so what is shown is read at once.
  const said = await page.evaluate(() => {
    const { plotting } = window.penup;
    const status = { state: "Idle", position: [], percent: 100 };
    return [[4, 9], [119, 0], [1, 0]].map((stopped) => {
      plotting.follow({ ...status, stopped });
      return document.querySelector("#stopped p").textContent;
    });
  });
  await page.waitForSelector("#stopped", { state: "hidden" });
  assert.match(said[0], /after 4 of 9 strokes\./);
  // It is not known how many strokes a drawing has that is computed part by part.
  assert.match(said[1], /after 119 strokes\./);
  assert.match(said[2], /after 1 stroke\./);
  assert.deepEqual(problems, []);
});

test("whoever wants less motion sees none", async () => {
  await fresh("#file=notched.obj");
  const moving = () =>
    page.evaluate(() => {
      const longest = (list) => Math.max(...list.split(",").map(parseFloat));
      return [...document.querySelectorAll("*")].filter((it) => {
        const style = getComputedStyle(it);
        return longest(style.transitionDuration) > 0 || style.animationName !== "none";
      }).length;
    });
  await page.emulateMedia({ reducedMotion: "no-preference" });
  assert.ok((await moving()) > 0, "buttons change softly");
  await page.emulateMedia({ reducedMotion: "reduce" });
  assert.equal(await moving(), 0);
  const scrolls = await page.evaluate(
    () => getComputedStyle(document.documentElement).scrollBehavior,
  );
  assert.equal(scrolls, "auto");
});

test("dark, and on a phone", async () => {
  await fresh("#file=gears.obj&eye=-22.3,-118.7,88.9&at=0,-3,4&crease=40&page=240x158&margin=6");
  await computed();
  await page.emulateMedia({ colorScheme: "dark" });
  await saved("page-dark.png");
  await page.setViewportSize({ width: 390, height: 844 });
  await page.click("#tab-draw");
  await page.waitForTimeout(200);
  await saved("page-phone.png");
  const [width, whole] = await page.evaluate(() => [
    innerWidth,
    document.documentElement.scrollWidth,
  ]);
  assert.ok(whole <= width, `the page is ${whole} wide on a screen of ${width}`);
  // The sheet covers no control that is looked for, on a high screen or on a low one.
  for (const height of [844, 360]) {
    await page.setViewportSize({ width: 640, height });
    const [top, bottom] = await page.evaluate(() => {
      document.documentElement.scrollTop = document.documentElement.scrollHeight;
      document.getElementById("plotter").scrollIntoView();
      const stage = document.querySelector(".stage").getBoundingClientRect();
      return [document.getElementById("plotter").getBoundingClientRect().top, stage.bottom];
    });
    assert.ok(top >= bottom, `a control at ${top}, the sheet down to ${bottom}`);
    assert.ok(top < height - 44, `a control at ${top} on a screen of ${height}`);
  }
});

/** The inked paths of a picture: lists of points. */
function inkOf(svg) {
  const groups = svg.match(/<g id="pen-(down|\d+)"[\s\S]*?<\/g>/g) ?? [];
  return groups
    .flatMap((group) => [...group.matchAll(/d="M([^"]*)"/g)])
    .map(([, path]) => path.split("L").map((point) => point.split(" ").map(Number)));
}

/** The inked segments of a picture. */
const segmentsOf = (svg) =>
  inkOf(svg).flatMap((path) => path.slice(1).map((to, at) => [path[at], to]));

/** The inked segments of samples of a path, as of a picture: with y downwards. */
function segmentsOfPath(path, height) {
  const segments = [];
  for (let at = 4; at < path.length; at += 4) {
    const [x0, y0] = path.slice(at - 3, at - 1);
    const [x1, y1, pen] = path.slice(at + 1, at + 4);
    if (pen) segments.push([[x0, height - y0], [x1, height - y1]]);
  }
  return segments;
}

/** Checks that two pictures have the same ink, however it is cut into strokes. */
const sameInk = (one, other) => sameSegments(segmentsOf(one), segmentsOf(other));

/**
 * Checks that segments have the same ink: no point of either is as `far` as that from the other, in
 * mm, and the lengths differ by 0.2 mm at most, and by this `part` of the whole.
 */
function sameSegments(a, b, { far = 0.03, part = 0 } = {}) {
  const length = (list) =>
    list.reduce((sum, [p, q]) => sum + Math.hypot(q[0] - p[0], q[1] - p[1]), 0);
  const most = 0.2 + part * length(b);
  assert.ok(Math.abs(length(a) - length(b)) < most, `${length(a)} and ${length(b)} mm of ink`);
  const distance = ([x, y], [[px, py], [qx, qy]]) => {
    const [dx, dy] = [qx - px, qy - py];
    const along = Math.max(
      0,
      Math.min(1, ((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy || 1)),
    );
    return Math.hypot(px + along * dx - x, py + along * dy - y);
  };
  for (const [these, those] of [
    [a, b],
    [b, a],
  ]) {
    for (const point of these.flat()) {
      // A step is 0.0125 mm.
      assert.ok(
        those.some((segment) => distance(point, segment) < far),
        `ink at ${point} in one picture alone`,
      );
    }
  }
}
