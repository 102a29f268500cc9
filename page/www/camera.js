// Turns the camera about the point that it looks at, with the model upright.

const STEEPEST = 89.9;

/** A number as it is written in an option. */
export const short = (number) => String(Number(number.toPrecision(6)));

/** Three numbers as they are written in an option. */
export const triple = (numbers) => numbers.map(short).join(",");

const sum = (a, b) => a.map((c, i) => c + b[i]);
const times = (a, by) => a.map((c) => c * by);
const dot = (a, b) => a.reduce((all, c, i) => all + c * b[i], 0);
const cross = (a, b) => [0, 1, 2].map((i) => {
  const [j, k] = [(i + 1) % 3, (i + 2) % 3];
  return a[j] * b[k] - a[k] * b[j];
});
const unit = (a) => times(a, 1 / (Math.hypot(...a) || 1));

/** Two directions at right angles to `up` and to each other; x and y if that is z. */
function level(up) {
  const x = Math.abs(up[0]) > 0.9 ? [0, 1, 0] : [1, 0, 0];
  const first = unit(sum(x, times(up, -dot(x, up))));
  return [first, cross(up, first)];
}

/**
 * The eye after a turn by these angles in degrees: `about` what is up, and `by` upwards. Its
 * distance from `at` is multiplied by `nearer`. An eye straight above or below turns as the picture
 * stands, which `pictured` says: what is up in it, or null if that is chosen by itself.
 */
export function turned({ eye, at, up: pictured }, upwards, about, by, nearer = 1) {
  const up = unit(upwards);
  const axes = [...level(up), up];
  const way = eye.map((c, i) => c - at[i]);
  const along = (vector) => axes.map((axis) => dot(vector, axis));
  const [x, y, z] = along(way);
  const isSteep = Math.hypot(x, y) < 1e-6 * Math.abs(z);
  const [east, north] = isSteep ? along(times(pictured ?? axes[1], -z)) : [x, y];
  const distance = Math.hypot(x, y, z) * nearer;
  const degrees = 180 / Math.PI;
  const azimuth = (Math.atan2(north, east) * degrees + about) / degrees;
  const elevation = Math.asin(z / (Math.hypot(x, y, z) || 1)) * degrees + by;
  const steep = Math.max(-STEEPEST, Math.min(STEEPEST, elevation)) / degrees;
  const flat = Math.cos(steep) * distance;
  const parts = [flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.sin(steep) * distance];
  return parts.reduce((to, part, i) => sum(to, times(axes[i], part)), at);
}

/** The options that a link has: those after its `#`. */
export function fromLink(hash) {
  return [...new URLSearchParams(hash.replace(/^#/, ""))];
}

/** The part of a link behind its `#`, with these pairs. */
export function toLink(pairs) {
  return "#" + new URLSearchParams(pairs).toString().replaceAll("%2C", ",");
}

/** The command that draws the same. */
export function command(file, pairs, isSwitch) {
  const word = (text) => (/^[\w.,/+=-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
  const flags = pairs.flatMap(([name, value]) => {
    if (isSwitch(name)) return `--${name}`;
    // The program takes one setting at a time.
    if (name === "set") {
      const settings = value.split(/[\s,;]+/).filter(Boolean);
      return settings.map((own) => `--set ${word(own)}`);
    }
    // A value of this one stands behind an equals sign alone.
    if (name === "landscape") return `--${name}=${word(value)}`;
    return value.startsWith("-") ? `--${name}=${word(value)}` : `--${name} ${word(value)}`;
  });
  // The program refuses this option if it writes no file that it concerns.
  if (pairs.some(([name]) => name === "reloop"))
    flags.push(`--gcode ${word(file.replace(/\.\w+$/, "") + ".gcode")}`);
  return ["penup preview", word(file), ...flags].join(" ");
}
