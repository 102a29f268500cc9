// Turns, moves and zooms by mouse, touch and keys.

/** Degrees of a turn for each pixel of a drag, and for a key. */
const DEGREES = 0.4,
  KEY_DEGREES = 5;
/** Pixels of a move for a key, and the factors of a zoom and of a step nearer for a key. */
const KEY_PIXELS = 40,
  KEY_ZOOM = 1.25,
  KEY_NEARER = 0.9;

/**
 * Listens at the canvas of `view`. `actions` has `turn` (what turns, all of whose turns in a row
 * are one step; degrees about z and up; and a factor of the distance), `play`, and `turns`, which
 * tells whether a drag turns; if not, it moves the sheet.
 */
export function listen(view, actions) {
  const { canvas } = view;
  const pointers = new Map();
  const middle = () => {
    const all = [...pointers.values()];
    const sum = all.reduce(([x, y], p) => [x + p[0], y + p[1]], [0, 0]);
    return sum.map((c) => c / all.length);
  };
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  let moves = false,
    drags = 0;

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    // The last finger of two moves the sheet as well.
    moves = pointers.size > 1 || event.shiftKey || event.button !== 0 || !actions.turns();
    drags++;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) return;
    const [before, was] = [middle(), spread()];
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    const [now, is] = [middle(), spread()];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (moves) {
      view.moveBy(dx, dy);
      if (was && is) view.zoomBy(is / was, now[0], now[1]);
    } else if (dx || dy) {
      actions.turn(`drag ${drags}`, -dx * DEGREES, dy * DEGREES);
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const amount = event.deltaY * (event.deltaMode === 1 ? 20 : 1);
      if (event.altKey) {
        actions.turn("wheel", 0, 0, Math.exp(amount * 0.001));
      } else {
        view.zoomBy(Math.exp(-amount * 0.0015), event.offsetX, event.offsetY);
      }
    },
    { passive: false },
  );

  const turn = (about, up, nearer) => actions.turn("keys", about, up, nearer);
  const keys = {
    ArrowLeft: () => turn(-KEY_DEGREES, 0),
    ArrowRight: () => turn(KEY_DEGREES, 0),
    ArrowUp: () => turn(0, KEY_DEGREES),
    ArrowDown: () => turn(0, -KEY_DEGREES),
    PageUp: () => turn(0, 0, KEY_NEARER),
    PageDown: () => turn(0, 0, 1 / KEY_NEARER),
    "+": () => view.zoomBy(KEY_ZOOM),
    "=": () => view.zoomBy(KEY_ZOOM),
    "-": () => view.zoomBy(1 / KEY_ZOOM),
    0: () => view.fit(),
    " ": () => actions.play(),
  };
  const shifted = {
    ArrowLeft: () => view.moveBy(-KEY_PIXELS, 0),
    ArrowRight: () => view.moveBy(KEY_PIXELS, 0),
    ArrowUp: () => view.moveBy(0, -KEY_PIXELS),
    ArrowDown: () => view.moveBy(0, KEY_PIXELS),
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey) return;
    const isArrow = event.key.startsWith("Arrow");
    const plain = isArrow && !actions.turns() ? shifted : keys;
    const act = (event.shiftKey ? shifted[event.key] : undefined) ?? plain[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
