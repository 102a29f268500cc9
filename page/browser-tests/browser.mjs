// Starts Chromium and a server of the built page, for the tests.

import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { mkdtemp } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, extname, join, normalize } from "node:path";

/** Where `cargo xtask page-test` has installed playwright-core, and has built the page. */
const INSTALLED = process.env.PENUP_PAGE_TESTS;
export const PAGE = process.env.PENUP_PAGE;

const { chromium } = createRequire(join(INSTALLED, "package.json"))("playwright-core");

const KINDS = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
  ".wasm": "application/wasm",
};

/**
 * Serves the built page as any web server would. Returns its address and how to end it. `headers`
 * are sent with each file, and `edited` gets its name and content, and returns what is sent.
 */
export async function serve({ headers: more = {}, edited = (_, content) => content } = {}) {
  const asked = [];
  const server = createServer(async ({ url, headers }, answer) => {
    const path = decodeURIComponent(url.split("?")[0]);
    asked.push({ path, headers });
    try {
      const file = join(PAGE, normalize(path === "/" ? "/index.html" : path));
      const content = edited(basename(file), await readFile(file));
      const kind = KINDS[extname(file)] ?? "application/octet-stream";
      answer.writeHead(200, { "Content-Type": kind, ...more });
      answer.end(content);
    } catch {
      answer.writeHead(404);
      answer.end("no such file");
    }
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  return {
    address: `http://127.0.0.1:${server.address().port}/`,
    asked,
    end: () => server.close(),
  };
}

/** Starts the browser, which asks nothing of the network by itself. */
export async function start() {
  const context = await chromium.launchPersistentContext(await mkdtemp(join(tmpdir(), "penup-")), {
    executablePath: process.env.PENUP_CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    args: [
      "--no-sandbox",
      "--disable-gpu",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
    ],
    viewport: { width: 1280, height: 800 },
    permissions: ["clipboard-read", "clipboard-write"],
  });
  context.setDefaultTimeout(20_000);
  return context;
}
