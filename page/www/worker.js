// Runs the plotter's code beside the page, so that the page never waits. A worker has one role:
// to draw what the camera sees, to compute a whole drawing ahead, to be a session with a plotter,
// or to be the emulated plotter itself. Each message is {id, call, args}; each answer is
// {id, value} or {id, error}, and what comes without being asked for is {event, …}.

import { summary } from "./strokes.js";
import init, { Board, Session, Sheet, fault, passes } from "./penup_page.js";

/** The time in ms after which a session gives up a plotter that says nothing. */
const SILENCE = { emulated: 120_000, serial: 5_000, program: 20_000 };
/** How much of the plotter's time passes between two looks at the session, in ms. */
const REPLAY_STEP = 200;
/** Numbers of a sample of a path, of which the first is the time. */
const SAMPLE = 4;

let sheet, board, session;
/** Sends what the session has to send, and tells what has happened to it. */
let flush;

const calls = {
  async start({ module }) {
    await init({ module_or_path: module });
  },

  /** Opens a file and tells what is in it. */
  open({ name, bytes, isRead, options }) {
    sheet ??= new Sheet();
    const scene = JSON.parse(sheet.open(name, bytes, isRead, options));
    return { scene, camera: JSON.parse(sheet.camera()) };
  },

  /** Sets options, and draws. `reads` tells that the lines of the file must be sent again. */
  draw({ options, reads }) {
    const began = performance.now();
    if (reads) sheet.set(options);
    else sheet.turn(options);
    const lines = sheet.draw();
    const ms = performance.now() - began;
    const [camera, notes] = [sheet.camera(), sheet.notes()].map((text) => JSON.parse(text));
    const value = { lines, page: [...sheet.page()], camera, notes, ms };
    return [value, [lines.buffer]];
  },

  /** Computes the whole drawing ahead, by a session with an emulated plotter. */
  async compute({ name, bytes, isRead, options, page, room, memory }) {
    board = new Board(memory, JSON.stringify(room), options);
    session = new Session(1e12);
    const notes = [];
    const clock = { now: 0 };
    session.connect(clock.now);
    const job = [name, bytes, isRead, options];
    const { report, path } = drawn(job, clock, notes);
    const strokes = board.strokes();
    const more = summary(path, strokes);
    const { ends, begins } = more;
    // As a blob it need not be copied.
    const svg = new Blob([board.svg(page[0], page[1])], { type: "image/svg+xml" });
    const gcode = new Blob([board.gcode(options)], { type: "text/plain" });
    const hpgl = new Blob([board.hpgl(options)], { type: "text/plain" });
    // What is shown is the first pass. Each other one begins where one has ended.
    const times = passes(options);
    let seconds = lengthOf(path);
    if (times > 1) {
      board.begin_again();
      seconds += (times - 1) * lengthOf(drawn(job, clock, []).path);
    }
    const figures = { report, notes, times, seconds };
    const value = { path, strokes, svg, gcode, hpgl, ...figures, ...more };
    return [value, [path.buffer, strokes.buffer, ends.buffer, begins.buffer]];
  },

  /** Begins a session at one end of a pipe of bytes, which is a port. */
  session({ pipe, kind }) {
    session = new Session(SILENCE[kind]);
    session.connect(performance.now());
    flush = () => {
      const out = session.take_out();
      if (out.length) pipe.postMessage({ bytes: out }, [out.buffer]);
      const events = JSON.parse(session.take_events());
      if (events.length) postMessage({ event: "session", events });
    };
    pipe.onmessage = ({ data }) =>
      guarded(() => {
        if (data.bytes) session.receive(data.bytes, performance.now());
        if (data.closed) session.close();
        flush();
      });
    setInterval(
      () =>
        guarded(() => {
          session.tick(performance.now());
          flush();
        }),
      20,
    );
  },
  plot({ name, bytes, isRead, options }) {
    session.plot(name, bytes, isRead, options);
    // The page knows that the plotter is busy before it has this answer.
    flush();
  },
  override({ by }) {
    session.override_speed(by);
  },
  goOn({ isAtOrigin }) {
    session.go_on(isAtOrigin);
  },
  testSquare({ mm }) {
    session.test_square(mm);
  },
  movePen({ isDown }) {
    session.move_pen_by_hand(isDown);
  },
  hold() {
    session.hold();
  },
  resume() {
    session.resume();
  },
  give_up() {
    session.give_up();
  },
  command({ text }) {
    session.command(text);
  },

  /** Is the emulated plotter, at the other end of such a pipe. */
  board({ pipe, pace, room, options }) {
    board = new Board("", JSON.stringify(room ?? null), options ?? "[]");
    calls.pace({ pace });
    pipe.onmessage = ({ data }) => guarded(() => board.receive(data.bytes));
    let last = performance.now();
    setInterval(
      () =>
        guarded(() => {
          const now = performance.now();
          // A page that slept does not make up for it.
          const passed = Math.min((now - last) * calls.speed, 400);
          last = now;
          board.advance(Math.max(1, Math.round(passed)));
          const sent = board.take_sent();
          if (sent.length) pipe.postMessage({ bytes: sent }, [sent.buffer]);
          const path = board.take_path();
          if (path.length) postMessage({ event: "path", path }, [path.buffer]);
        }),
      16,
    );
  },
  pace({ pace }) {
    calls.speed = pace;
  },
  pen({ pen }) {
    board.change_pen(pen);
  },
  begin_again() {
    board.begin_again();
  },
  picture({ page }) {
    return board.svg(page[0], page[1]);
  },
};

/** The time in seconds that a path takes. */
const lengthOf = (path) => (path.length ? path[path.length - SAMPLE] : 0);

/**
 * Has the session draw a job by the emulated plotter, which runs ahead of time. Adds what the
 * plotter says to `notes`. Returns its report and the path of the pen.
 */
function drawn([name, bytes, isRead, options], clock, notes) {
  const paths = [];
  let report = null,
    reported = 0,
    begun = false;
  session.plot(name, bytes, isRead, options);
  while (report === null) {
    const out = session.take_out();
    if (out.length) board.receive(out);
    board.advance(begun ? REPLAY_STEP : 1);
    clock.now += begun ? REPLAY_STEP : 1;
    const sent = board.take_sent();
    if (sent.length) session.receive(sent, clock.now);
    session.tick(clock.now);
    for (const event of JSON.parse(session.take_events())) {
      if (event.kind === "failed") throw event.text;
      if (event.kind === "note") notes.push(event.text);
      if (event.kind === "phase" && event.name === "drawing") begun = true;
      if (event.kind === "pen") {
        board.change_pen(event.pen);
        session.resume();
      }
      // Nobody holds it: its pen needs ink, and has it at once.
      if (event.is_held) session.resume();
      if (event.kind === "drawn") report = event.report;
      if (event.kind === "status" && event.strokes && performance.now() - reported > 100) {
        reported = performance.now();
        postMessage({ event: "computing", strokes: event.strokes });
      }
    }
    const path = board.take_path();
    if (path.length) paths.push(path);
  }
  const path = new Float32Array(paths.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of paths) {
    path.set(part, at);
    at += part.length;
  }
  return { report, path };
}

/** Does `work`; what breaks is told to the page. */
function guarded(work) {
  try {
    work();
  } catch (error) {
    postMessage({ event: "broken", text: reason(error) });
  }
}

/** What went wrong, for the user. The plotter's code throws sentences. */
function reason(error) {
  if (typeof error === "string") return error;
  let said = "";
  try {
    said = fault();
  } catch {
    // It is not loaded.
  }
  return `The program of the page broke: ${said || error}. Reload it.`;
}

onmessage = async ({ data: { id, call, args } }) => {
  try {
    const value = await calls[call](args ?? {});
    if (Array.isArray(value)) postMessage({ id, value: value[0] }, value[1]);
    else postMessage({ id, value });
  } catch (error) {
    postMessage({ id, error: reason(error) });
  }
};
