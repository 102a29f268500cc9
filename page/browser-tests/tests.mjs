// Tests of the page in Chromium. `cargo xtask page-test` builds the page and runs them.

import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { mkdtemp, readFile, truncate, writeFile } from "node:fs/promises";
import { request } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
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

/** Waits until the whole drawing is computed, and returns its figures. */
async function computed() {
  await page.waitForFunction(() => window.penup.drawing.computed);
  return page.evaluate(() => {
    const { strokes, pens, svg, seconds } = window.penup.drawing.computed;
    return { strokes, pens, svg, seconds };
  });
}

/** What `penup preview` makes of the command that the page shows. */
async function preview(file) {
  const words = (await page.inputValue("#command")).split(" ").slice(3);
  const [svg, json] = [join(folder, "plot.svg"), join(folder, "plot.json")];
  await run(PENUP, ["preview", file, ...words, "--svg", svg, "--json", json]);
  return { svg: await readFile(svg, "utf8"), ...JSON.parse(await readFile(json, "utf8")) };
}

const state = (expected) =>
  page.waitForFunction(
    (want) => document.getElementById("plot-state").textContent.startsWith(want),
    expected,
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
  await page.click("#plot");
  await state("Sending");
  await state("Drawn");
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
    (
      "landscape svg png json motion set repeat board machine quiet " +
      "view azimuth elevation y-up layer scale rotate hatch center crop linemerge simplify " +
      "layer-order"
    ).split(" "),
  );
  for (const name of flags.filter((flag) => !own.has(flag))) {
    assert.equal(await page.locator(`#option-${name}`).count(), 1, name);
  }
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
    [unknown, /penup reads/],
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
  await page.waitForFunction(() =>
    /lattice6/.test(document.getElementById("file-name").textContent),
  );
  await page.click("#tab-check");
  await page.selectOption("#board", "lm3s6965");
  await page.waitForFunction(() =>
    /lm3s6965 would refuse.*1000/.test(document.getElementById("check-problem").textContent),
  );
  assert.deepEqual(problems, []);
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

test("penup page serves the file to its owner alone", async () => {
  const program = spawn(PENUP, [
    "page",
    scene("notched"),
    "--no-browser",
    "--folder",
    process.env.PENUP_PAGE,
  ]);
  try {
    const address = await new Promise((done) =>
      program.stdout.once("data", (line) => done(String(line).trim())),
    );
    assert.match(address, /^http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\/#given=notched\.obj$/);
    const { origin, pathname, port } = new URL(address);
    await fresh(new URL(address).hash, { address: origin + pathname });
    assert.match(await text("#file-name"), /^notched\.obj/);
    await computed();
    assert.deepEqual(problems, []);
    const ask = (path, headers) =>
      new Promise((done, fail) => {
        request({ host: "127.0.0.1", port, path, headers }, (answer) => {
          answer.resume();
          done(answer.statusCode);
        })
          .on("error", fail)
          .end();
      });
    assert.equal(await ask(pathname, {}), 200);
    assert.equal(await ask("/", {}), 403, "no token");
    assert.equal(await ask(pathname.replace(/[0-9a-f]/, "x"), {}), 403, "a wrong token");
    assert.equal(
      await ask(pathname, { Host: "evil.example" }),
      403,
      "another name of this computer",
    );
    assert.equal(
      await ask(pathname, { Origin: "http://evil.example" }),
      403,
      "a page from elsewhere",
    );
    assert.equal(await ask(`${pathname}../../../etc/passwd`, {}), 404);
  } finally {
    program.kill();
  }
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
});

/** The inked paths of a picture: lists of points. */
function inkOf(svg) {
  const groups = svg.match(/<g id="pen-(down|\d+)"[\s\S]*?<\/g>/g) ?? [];
  return groups
    .flatMap((group) => [...group.matchAll(/d="M([^"]*)"/g)])
    .map(([, path]) => path.split("L").map((point) => point.split(" ").map(Number)));
}

/** Checks that two pictures have the same ink, however it is cut into strokes. */
function sameInk(one, other) {
  const segments = (svg) =>
    inkOf(svg).flatMap((path) => path.slice(1).map((to, at) => [path[at], to]));
  const [a, b] = [segments(one), segments(other)];
  const length = (list) =>
    list.reduce((sum, [p, q]) => sum + Math.hypot(q[0] - p[0], q[1] - p[1]), 0);
  assert.ok(Math.abs(length(a) - length(b)) < 0.2, `${length(a)} and ${length(b)} mm of ink`);
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
        those.some((segment) => distance(point, segment) < 0.03),
        `ink at ${point} in one picture alone`,
      );
    }
  }
}
