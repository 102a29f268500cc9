// What is known of the strokes of a drawing, for the page to show.

const SAMPLE = 4;

/**
 * From the samples of a `path` and the strokes in one list (for each the pen, the number of points,
 * and x and y of each): where each stroke begins and ends, and at what time; the pens; and the
 * lengths of the ink and of the moves with the pen up, in mm.
 */
export function summary(path, flat) {
  const ends = [],
    pens = new Set();
  let ink = 0,
    up = 0;
  for (let at = 0; at < flat.length; at += 2 + 2 * flat[at + 1]) {
    const [first, last] = [at + 2, at + 2 * flat[at + 1]];
    pens.add(flat[at]);
    for (let point = first; point < last; point += 2)
      ink += Math.hypot(flat[point + 2] - flat[point], flat[point + 3] - flat[point + 1]);
    const count = ends.length;
    if (count) up += Math.hypot(flat[first] - ends[count - 2], flat[first + 1] - ends[count - 1]);
    ends.push(flat[first], flat[first + 1], flat[last], flat[last + 1]);
  }
  return {
    ends: Float64Array.from(ends),
    begins: starts(path, ends),
    pens: [...pens].sort((a, b) => a - b),
    ink,
    up,
  };
}

/**
 * The times at which the strokes begin: the pen is at their first points, in this order, and comes
 * down there. Dashes are not counted.
 */
function starts(path, ends) {
  const begins = new Float64Array(ends.length / 4);
  const count = path.length / SAMPLE;
  let at = 0;
  for (const stroke of begins.keys()) {
    const [x, y] = [ends[4 * stroke], ends[4 * stroke + 1]];
    let found = at;
    // The sample before the first with the pen down.
    while (
      found + 1 < count &&
      !(
        path[(found + 1) * SAMPLE + 3] > 0 &&
        path[found * SAMPLE + 3] === 0 &&
        Math.abs(path[found * SAMPLE + 1] - x) < 0.05 &&
        Math.abs(path[found * SAMPLE + 2] - y) < 0.05
      )
    )
      found++;
    if (found + 1 >= count) found = at;
    begins[stroke] = path[found * SAMPLE];
    at = found + 1;
  }
  return begins;
}
