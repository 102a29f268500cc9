// Measures frames of the page in Chromium: `cargo xtask page-test --measure`.

import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { ball } from "./ball.mjs";
import { serve, start } from "./browser.mjs";

/** How many frames are measured; of the largest mesh fewer, because each takes long. */
const FRAMES = 60,
  FRAMES_OF_LARGEST = 12;

const server = await serve();
const browser = await start();
const page = await browser.newPage();
const scenes = [
  ["lattice7", await readFile(join(process.env.PENUP_ROOT, "scenes/lattice7.obj"))],
  ["ball of 10 000 faces", ball(100)],
  ["ball of 70 225 faces", ball(265)],
];
console.log(
  "| scene | edges | computing a frame, ms | input to picture, ms | all lines at rest, ms " +
    "| longest task, ms |",
);
console.log("|---|---|---|---|---|---|");
for (const [name, buffer] of scenes) {
  await page.goto(server.address);
  await page.waitForSelector("html[data-ready]");
  await page.setInputFiles("#file", { name: `${name}.obj`, mimeType: "text/plain", buffer });
  await page.waitForFunction(
    (want) => document.getElementById("file-name").textContent.startsWith(want),
    `${name}.obj: `,
    { timeout: 120_000 },
  );
  await page.waitForFunction(() => window.penup.frames.from.length > 0);
  await page.focus("#sheet");
  await page.evaluate(() =>
    Object.assign(window.penup.frames, { compute: [], from: [], whole: [], longest: 0 }),
  );
  const count = name.includes("70") ? FRAMES_OF_LARGEST : FRAMES;
  for (let at = 0; at < count; at++) {
    const before = await page.evaluate(() => window.penup.frames.from.length);
    await page.keyboard.press("ArrowRight");
    await page.waitForFunction((had) => window.penup.frames.from.length > had, before);
  }
  // The whole drawing is shown, too, and replayed.
  await page.waitForFunction(() => window.penup.drawing.computed, undefined, { timeout: 600_000 });
  await page.click("#tab-check");
  await page.selectOption("#speed", "100");
  await page.click("#play");
  await page.waitForTimeout(1500);
  const { compute, from, whole, longest } = await page.evaluate(() => window.penup.frames);
  const median = (list) =>
    list.length ? [...list].sort((a, b) => a - b)[list.length >> 1].toFixed(1) : "";
  const text = buffer.toString();
  const corners = [...text.matchAll(/^f (.*)$/gm)].reduce(
    (sum, [, face]) => sum + face.trim().split(/\s+/).length,
    0,
  );
  console.log(
    ["", name, corners / 2, median(compute), median(from), median(whole), longest || "below 50", ""]
      .join(" | ")
      .trim(),
  );
}
await browser.close();
server.end();
