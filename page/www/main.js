// The page: joins the file, the controls, the sheet, the computed drawing and the plotter.

import { command, fromLink, toLink, triple, turned } from "./camera.js";
import { Controls } from "./controls.js";
import { Drawing } from "./drawing.js";
import { Plotting } from "./plotting.js";
import { handed } from "./reading.js";
import { SheetView } from "./sheet.js";
import { joined } from "./socket.js";
import { listen } from "./turning.js";
import { Helper, load } from "./workers.js";
import init, * as library from "./penup_page.js";

const $ = (id) => document.getElementById(id);

/** The largest file that is opened, in bytes: far more than any plotter holds. */
const LARGEST_FILE = 64 << 20;
/** How long the camera rests before the whole drawing is computed, in ms. */
const REST = 350;
/** How long a large model rests before it is drawn with all its lines, in ms. */
const SETTLE = 150;
/** With more faces, a model is large: while it turns, only its outlines are drawn. */
const LARGE = 10_000;
/** How long nothing changes before the address is written, in ms. Browsers limit how often. */
const ADDRESS_REST = 300;
/** How many steps back are kept. */
const MOST_UNDOS = 200;
const EXAMPLES = ["notched", "lattice3", "interpen", "lblock", "gears", "isobars"];
/** Options of a camera, which do not fit another model. */
const CAMERA = ["eye", "at", "up", "angles", "view", "azimuth", "elevation", "y-up"];
/** Options that choose the eye by its direction; a turn chooses it by its place. */
const DIRECTIONS = ["view", "azimuth", "elevation"];
/** The heading of the options that arrange plans begins so. */
const PLAN = "Plan";
/** Projections that have a direction of their own; a turn makes them orthographic. */
const FIXED = /^(isometric|dimetric|trimetric|axonometric)/;

/** What is shown: the values that are not the defaults, by their names. */
let values = new Map();
const undos = [],
  redos = [];
/** What stands above the sheet about the file, and what was left out of its options. */
let heading = $("file-name").textContent,
  leftOutNotes = [];
let file = null,
  scene = null,
  camera = null,
  table = [];
let lines = new Float32Array(),
  drawsBusy = false,
  /** What has changed while a picture was computed: the name of an option, or null. */
  drawsAgain = undefined,
  reads = false,
  arranges = false,
  isTurning = false;
/** How many files were opened or refused so far, and whether one is being opened. */
let openings = 0,
  isOpening = false;
/** How many files were chosen so far: the last one is opened, whichever is loaded first. */
let asks = 0;
/** The pairs that stand for the file in a link; none if it is the user's own. */
let origin = [];
/** Why the drawing cannot be shown as the options say; empty if it is. */
let refusal = "";
/** Who waits until the drawing is read and shown with the newest options. */
const waiting = [];
let tab = "see",
  restTimer = 0,
  addressTimer = 0,
  lastBegin = "",
  lastHelp = "";
/**
 * Times of frames, of those with all lines of a large model that has turned, and of the longest
 * task, in ms. Tests read them by `window.penup`.
 */
const frames = { compute: [], from: [], whole: [], longest: 0 };
let view, controls, drawing, plotting, helper;

main().catch((error) =>
  fail(
    `The page cannot start: ${error?.message ?? error}. Reload it, in a browser of 2023 or later.`,
  ),
);

async function main() {
  view = new SheetView($("sheet"));
  view.paint = paint;
  listenToErrors();
  const module = await load();
  await init({ module_or_path: module });
  table = JSON.parse(library.options());
  controls = new Controls($("controls"), table, JSON.parse(library.pages()), change);
  helper = new Helper(({ text }) => fail(text));
  drawing = new Drawing(view, JSON.parse(library.boards()), { job, announce });
  plotting = new Plotting(view, { job, announce, lines: () => lines, program: await joined() });
  for (const name of EXAMPLES) $("example").append(new Option(name, `${name}.obj`));
  window.penup = { frames, drawing, plotting, view, lines: () => lines };
  listenToPage();
  const link = new Map(fromLink(location.hash));
  const given = link.get("given"),
    example = link.get("file");
  const known = new Set(table.map((option) => option.name));
  values = new Map([...link].filter(([name]) => known.has(name)));
  if (given) {
    // If it is refused, it stays in the address: it may be mended when the page is loaded again.
    origin = [["given", given]];
    await openFrom("given", given, origin[0]);
  } else {
    const isExample = EXAMPLES.some((name) => `${name}.obj` === example);
    await openExample(isExample ? example : "lattice3.obj");
  }
  if (link.has("tab")) choose(link.get("tab"));
  keepOffline();
  document.documentElement.dataset.ready = "yes";
}

/** The pairs of name and value that are not the defaults, in the order of the table. */
function pairs() {
  return table
    .map(({ name }) => [name, values.get(name)])
    .filter(([, value]) => value !== undefined);
}

/**
 * The drawing as a job: what a session needs; null if no file is open. Waits until the file is read
 * with the newest options. Fails with a sentence for the user if it cannot be.
 */
async function job() {
  while (drawsBusy || isOpening) await new Promise((done) => waiting.push(done));
  if (file && refusal) throw refusal;
  return (
    file && {
      name: file.name,
      bytes: file.handed.bytes.slice(),
      isRead: file.handed.isRead,
      options: JSON.stringify(pairs()),
      page: view.page,
      room: scene.room,
    }
  );
}

// The file.

/** Opens what the server has at an address. In a link `pair` stands for it. */
async function openFrom(address, name, pair, keeps) {
  const asked = ++asks;
  try {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`the server answers ${answer.status}`);
    const size = Number(answer.headers.get("Content-Length"));
    if (size > LARGEST_FILE) return fail(tooLarge(name, size));
    const bytes = new Uint8Array(await answer.arrayBuffer());
    if (asked === asks) await open(name, bytes, keeps, [pair]);
  } catch (error) {
    if (asked === asks) fail(`${name} cannot be loaded: ${error.message ?? error}.`);
  }
}

const openExample = (name, keeps) => openFrom(`scenes/${name}`, name, ["file", name], keeps);

const tooLarge = (name, size) =>
  `${name} has ${Math.round(size / 1e6)} MB; the page opens files up to ` +
  `${LARGEST_FILE >> 20} MB.`;

async function openFile(chosen) {
  if (chosen.size > LARGEST_FILE) return fail(tooLarge(chosen.name, chosen.size));
  const asked = ++asks;
  try {
    const bytes = new Uint8Array(await chosen.arrayBuffer());
    if (asked === asks) await open(chosen.name, bytes, fitsAnother);
  } catch (error) {
    if (asked === asks) fail(`${chosen.name} cannot be read: ${error.message ?? error}.`);
  }
}

/** Whether an option fits another model: its camera does not. */
const fitsAnother = (name) => !CAMERA.includes(name);

/** What reading a file fails with once another one is being opened. */
const OVERTAKEN = Symbol("overtaken");

/** Reads a file with these options, in this `opening`. Returns it, and what there is to see. */
async function readFile(name, bytes, nextValues, opening) {
  const options = JSON.stringify([...nextValues]);
  try {
    const given = await handed(name, bytes, options);
    if (opening !== openings) throw OVERTAKEN;
    const opened = await helper.ask("open", { name, ...given, options });
    if (opening !== openings) throw OVERTAKEN;
    return { file: { name, bytes, handed: given }, ...opened };
  } catch (error) {
    throw opening === openings ? error : OVERTAKEN;
  }
}

/**
 * Opens a file with those options whose names `keeps` wants. In a link the pairs `from` stand for
 * it. What was open stays if it fails.
 */
async function open(name, bytes, keeps = () => true, from = []) {
  const opening = ++openings;
  isOpening = true;
  $("file-name").textContent = `Reading ${name}…`;
  // An option that arranges plans may not fit another file, and a link may hold a wrong value.
  const attempts = [
    ["", keeps],
    ["Without options for plans: ", (own) => keeps(own) && !isOfPlans(own)],
    ["Without any options: ", () => false],
  ];
  let opened, kept, tried, reason;
  const leftOut = [];
  for (const [what, isKept] of attempts) {
    kept = isKept;
    const next = pairs().filter(([own]) => isKept(own));
    if (tried !== undefined && next.length === tried) continue;
    tried = next.length;
    try {
      opened = await readFile(name, bytes, new Map(next), opening);
      if (what) leftOut.push(what + reason);
      break;
    } catch (text) {
      if (text === OVERTAKEN) return;
      reason ??= text;
    }
  }
  isOpening = false;
  if (!opened) {
    $("file-name").textContent = heading;
    controls.show(values);
    if (file) {
      const before = { name: file.name, ...file.handed, options: JSON.stringify(pairs()) };
      // If an option is refused, too, the next picture sends the lines of the file again.
      await helper.ask("open", before).catch(() => (reads = true));
      // The picture that was begun before was given up. It is drawn before the reason is shown.
      await draw(drawsAgain);
    }
    settle();
    return fail(reason);
  }
  ({ file, scene, camera } = opened);
  origin = from;
  values = new Map(pairs().filter(([own]) => kept(own)));
  undos.length = redos.length = 0;
  const counts = [
    [scene.vertices, "vertices"],
    [scene.faces, "faces"],
    [scene.bars, "bars"],
    [scene.curves, "curves"],
  ];
  const said = counts
    .filter(([count]) => count)
    .map(([count, noun]) => `${count} ${noun}`)
    .join(", ");
  heading = `${name}: ${said}${scene.is_plan ? ", a flat drawing" : ""}`;
  $("file-name").textContent = heading;
  leftOutNotes = leftOut;
  note([...leftOut, ...scene.notes]);
  announce(`${name} is open: ${said}`);
  view.fit();
  changed();
}

// Options.

/** A control has a new value; `null` is the default. */
function change(name, value) {
  remember(name);
  isTurning = false;
  if (value === null) values.delete(name);
  else values.set(name, value);
  // A direction takes the place of the eye that a turn has chosen.
  if (value !== null && DIRECTIONS.includes(name)) values.delete("eye");
  reads ||= name === "pens";
  // The options of the page decide where a plan is laid that is arranged, and how large it is.
  const lays = file?.handed.isRead && isUnder("Page", name);
  arranges ||= isOfPlans(name) || lays;
  changed(name);
}

const isUnder = (heading, name) =>
  table.some((option) => option.name === name && option.heading.startsWith(heading));

const isOfPlans = (name) => isUnder(PLAN, name) || name === "landscape";

/** Notes the values before a change. Changes of one kind in a row, such as keys, are one step. */
function remember(kind = "") {
  if (kind === "" || kind !== lastBegin) {
    undos.push(new Map(values));
    if (undos.length > MOST_UNDOS) undos.shift();
    redos.length = 0;
  }
  lastBegin = kind;
}

function step(from, to) {
  if (!from.length) return;
  to.push(new Map(values));
  values = from.pop();
  lastBegin = "";
  reads = arranges = true;
  changed();
}

function changed(name = null) {
  controls.show(values);
  $("undo").disabled = !undos.length;
  $("redo").disabled = !redos.length;
  $("command").value = file
    ? command(file.name, pairs(), (own) => table.find((it) => it.name === own).is_switch)
    : "";
  plotting.outdated();
  draw(name);
}

/** Writes what is shown into the address, once it has not changed for a moment. */
function writeAddress() {
  clearTimeout(addressTimer);
  addressTimer = setTimeout(() => {
    try {
      history.replaceState(null, "", link());
    } catch {
      // The browser wants more time between two changes.
      addressTimer = setTimeout(writeAddress, 10 * ADDRESS_REST);
    }
  }, ADDRESS_REST);
}

function link() {
  return toLink([...origin, ...pairs()]);
}

// The picture of the camera.

/** Whether the model has so many faces that it turns as outlines. */
function isLarge() {
  return scene?.faces > LARGE;
}

/** The options of a quick picture: only silhouettes and open edges, with hidden lines removed. */
function outlines() {
  return [...pairs().filter(([name]) => name !== "crease"), ["crease", "180"]];
}

/**
 * Draws what the camera sees. One frame is computed at a time, with the newest values. A large
 * model that turns is drawn as outlines until it rests, unless it `isWhole`.
 */
async function draw(name = null, isWhole = false) {
  drawing.outdated();
  clearTimeout(restTimer);
  if (drawsBusy || isOpening) {
    drawsAgain = name;
    return;
  }
  drawsBusy = true;
  drawsAgain = undefined;
  const began = performance.now();
  // What is asked for from now on is for the next picture.
  const [opening, readsNow, arrangesNow] = [openings, reads, arranges];
  reads = arranges = false;
  const isQuick = isTurning && !isWhole && isLarge() && !readsNow && !arrangesNow;
  let problem = null;
  try {
    if (arrangesNow && file) {
      const read = await readFile(file.name, file.bytes, new Map(pairs()), opening);
      ({ file, scene } = read);
    }
    const options = JSON.stringify(isQuick ? outlines() : pairs());
    const answer = await helper.ask("draw", { options, reads: readsNow });
    lines = answer.lines;
    // A camera that was turned meanwhile is newer.
    if (drawsAgain === undefined) camera = answer.camera;
    view.page = answer.page;
    if (opening === openings && scene) note([...leftOutNotes, ...answer.notes]);
    view.draw();
    if (isTurning && !isQuick && isLarge()) frames.whole.push(performance.now() - began);
    else {
      frames.compute.push(answer.ms);
      frames.from.push(performance.now() - began);
    }
  } catch (text) {
    reads ||= readsNow;
    arranges ||= arrangesNow;
    problem = text;
    if (problem === OVERTAKEN) drawsAgain ??= name;
  }
  drawsBusy = false;
  if (isOpening) return;
  if (drawsAgain !== undefined) return draw(drawsAgain);
  refusal = problem ?? "";
  controls.problem(problem ? name : null, problem);
  if (problem) fail(problem);
  else {
    hush();
    writeAddress();
    restTimer = isQuick
      ? setTimeout(() => draw(null, true), SETTLE)
      : setTimeout(() => drawing.compute(), REST);
  }
  settle();
}

/** Tells those who wait that the drawing is shown, or why it cannot be. */
function settle() {
  for (const done of waiting.splice(0)) done();
}

/** Whether a drag turns the camera. A flat drawing and what the plotter draws are moved instead. */
function turns() {
  if (tab === "draw" && plotting.isShown) return false;
  return Boolean(scene) && !(scene.is_plan && !values.has("eye") && !values.has("angles"));
}

function turn(kind, about, up, nearer) {
  if (!turns()) return;
  if (!camera) return fail("The camera stands by “angles”: clear that option to turn it.");
  remember(kind);
  if (FIXED.test(values.get("projection") ?? "")) values.set("projection", "orthographic");
  for (const name of DIRECTIONS) values.delete(name);
  const eye = turned(camera, upwards(), about, up, nearer);
  camera = { ...camera, eye };
  values.set("eye", triple(eye));
  isTurning = true;
  if (!values.has("at")) values.set("at", triple(camera.at));
  changed();
}

/** What is up in the model: the camera turns about it. */
function upwards() {
  if (values.has("y-up")) return [0, 1, 0];
  const up = (values.get("up") ?? "").split(",").map(Number);
  return up.length === 3 && up.every(Number.isFinite) && up.some(Boolean) ? up : [0, 0, 1];
}

/** Says at the sheet what a drag does, if that is something else than before. */
function help() {
  const said = turns()
    ? "Drag to turn. Shift and drag, or two fingers, to move. " +
      "Wheel to zoom, with Alt to step nearer."
    : `${scene?.is_plan ? "A flat drawing: drag" : "Drag"} to move, wheel to zoom.`;
  if (said === lastHelp) return;
  lastHelp = said;
  $("sheet-help").textContent = said;
}

function paint(brush) {
  if (scene) help();
  const picture =
    (tab === "draw" && plotting.paint(brush)) || (tab === "check" && drawing.paint(brush));
  return picture || view.lines(brush, lines);
}

// The page itself.

function choose(name) {
  const names = ["see", "check", "draw"];
  if (!names.includes(name)) return;
  tab = name;
  for (const own of names) {
    $(`tab-${own}`).setAttribute("aria-selected", String(own === name));
    $(`tab-${own}`).tabIndex = own === name ? 0 : -1;
    $(`panel-${own}`).hidden = own !== name;
  }
  view.draw();
}

function listenToPage() {
  listen(view, { turn, turns, play: () => tab === "check" && drawing.play() });
  $("file").addEventListener("change", (event) => {
    const [chosen] = event.target.files;
    if (chosen) openFile(chosen);
    event.target.value = "";
  });
  $("machine-file").addEventListener("change", async (event) => {
    const [chosen] = event.target.files;
    event.target.value = "";
    if (!chosen) return;
    try {
      change("set", settingsOf(chosen.name, await chosen.text()));
      announce(`The machine has the settings of ${chosen.name}`);
    } catch (error) {
      fail(error.message ?? error);
    }
  });
  $("example").addEventListener("change", (event) => {
    const name = event.target.value;
    event.target.value = "";
    if (!name) return;
    openExample(name, fitsAnother);
  });
  $("undo").addEventListener("click", () => step(undos, redos));
  $("redo").addEventListener("click", () => step(redos, undos));
  $("reset").addEventListener("click", () => {
    remember();
    values = new Map();
    reads = arranges = true;
    changed();
  });
  $("copy-link").addEventListener("click", () =>
    copy(new URL(link(), location.href).href, "The link is copied."),
  );
  $("copy-command").addEventListener("click", () =>
    copy($("command").value, "The command is copied."),
  );
  $("zoom-in").addEventListener("click", () => view.zoomBy(1.3));
  $("zoom-out").addEventListener("click", () => view.zoomBy(1 / 1.3));
  $("zoom-fit").addEventListener("click", () => view.fit());
  $("error").querySelector("button").addEventListener("click", hush);
  const tabs = [...document.querySelectorAll("[role=tab]")];
  for (const [at, own] of tabs.entries()) {
    own.addEventListener("click", () => choose(own.id.replace("tab-", "")));
    own.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      const next = tabs[(at + by + tabs.length) % tabs.length];
      next.focus();
      next.click();
    });
  }
  addEventListener("keydown", (event) => {
    const writes = event.target.matches("input:not([type=range]), textarea");
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || writes) return;
    event.preventDefault();
    if (event.shiftKey) step(redos, undos);
    else step(undos, redos);
  });
  // A link was pasted. What is shown is written into the address without this event.
  addEventListener("hashchange", () => {
    clearTimeout(addressTimer);
    location.reload();
  });
  const drop = $("drop");
  addEventListener("dragover", (event) => {
    event.preventDefault();
    drop.hidden = false;
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) drop.hidden = true;
  });
  addEventListener("drop", (event) => {
    event.preventDefault();
    drop.hidden = true;
    const [chosen] = event.dataTransfer.files;
    if (chosen) openFile(chosen);
  });
}

/**
 * The settings in a file of `penup settings save`, as the value of the option “set”. Fails with a
 * sentence for the user.
 */
function settingsOf(name, text) {
  const [, table] = text.split(/^\s*\[settings\]\s*$/m);
  if (table === undefined)
    throw `${name} has no table [settings]: is it a file of penup settings save?`;
  const rows = table.split(/^\s*\[/m)[0].split(/\r?\n/);
  return rows
    .map((row) => row.replace(/#.*/, "").trim())
    .filter(Boolean)
    .map((row) => {
      const [, number, value] = /^"?(\d+)"?\s*=\s*(-?\d+(?:\.\d+)?)$/.exec(row) ?? [];
      if (!number) throw `${name} holds “${row}”, and settings have numbers, as in 100 = 80.`;
      return `${number}=${value}`;
    })
    .join(",");
}

async function copy(text, done) {
  try {
    await navigator.clipboard.writeText(text);
    announce(done);
    flash(done);
  } catch {
    fail(`The browser does not let the page copy. Copy this by hand: ${text}`);
  }
}

/** Says something in the place of the help for a moment. */
function flash(text) {
  const help = $("sheet-help"),
    before = help.textContent;
  help.textContent = text;
  setTimeout(() => {
    if (help.textContent === text) help.textContent = before;
  }, 2500);
}

function fail(text) {
  $("error").querySelector("p").textContent = text;
  $("error").hidden = false;
}

function hush() {
  $("error").hidden = true;
}

/** Says what the user should know about the file. */
function note(notes) {
  $("notes").textContent = notes.join(" ");
  $("notes").hidden = !notes.length;
}

function announce(text) {
  $("announce").textContent = text;
}

function listenToErrors() {
  addEventListener("error", (event) =>
    fail(`The page broke: ${event.message}. Reload it.`),
  );
  addEventListener("unhandledrejection", (event) =>
    fail(
      "The page broke: " +
        `${event.reason?.message ?? event.reason}. Reload it.`,
    ),
  );
  if (PerformanceObserver.supportedEntryTypes?.includes("longtask")) {
    new PerformanceObserver((list) => {
      for (const entry of list.getEntries())
        frames.longest = Math.max(frames.longest, entry.duration);
    }).observe({ type: "longtask", buffered: true });
  }
}

/** Keeps the files in the browser, unless the program penup serves them, whose address changes. */
function keepOffline() {
  const isServed = /^\/[0-9a-f]{32}\//.test(location.pathname);
  if (isServed || !("serviceWorker" in navigator)) return;
  navigator.serviceWorker.register("offline.js").catch((error) => {
    flash(`The page is not kept for use without a network: ${error.message}`);
  });
}
