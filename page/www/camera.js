// Turns the camera about the point that it looks at, with z up.

const STEEPEST = 89.9;

/** A number as it is written in an option. */
export const short = (number) => String(Number(number.toPrecision(6)));

/** Three numbers as they are written in an option. */
export const triple = (numbers) => numbers.map(short).join(",");

/**
 * The eye after a turn by these angles in degrees: `about` z, and `up`. Its distance from `at`
 * is multiplied by `nearer`.
 */
export function turned({ eye, at }, about, up, nearer = 1) {
  const [x, y, z] = eye.map((c, i) => c - at[i]);
  const distance = Math.hypot(x, y, z) * nearer;
  const degrees = 180 / Math.PI;
  const azimuth = (Math.atan2(y, x) * degrees + about) / degrees;
  const elevation = Math.asin(z / (Math.hypot(x, y, z) || 1)) * degrees + up;
  const steep = Math.max(-STEEPEST, Math.min(STEEPEST, elevation)) / degrees;
  const flat = Math.cos(steep) * distance;
  return [
    at[0] + flat * Math.cos(azimuth),
    at[1] + flat * Math.sin(azimuth),
    at[2] + Math.sin(steep) * distance,
  ];
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
  const word = (text) => (/^[\w.,/+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
  const flags = pairs.map(([name, value]) => {
    if (isSwitch(name)) return `--${name}`;
    return value.startsWith("-") ? `--${name}=${word(value)}` : `--${name} ${word(value)}`;
  });
  return ["penup preview", word(file), ...flags].join(" ");
}
