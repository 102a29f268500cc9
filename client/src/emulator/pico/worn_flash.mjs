// A worn flash: cells that no longer change. A bit that stays low is not erased; one that stays
// high is not written.

/** Masks of such bits, by the byte's place in flash. */
const low = new Map();
const high = new Map();

/** From now on these bits of a byte stay as they are. */
export function wear(place, mask, isHigh) {
  (isHigh ? high : low).set(place, mask);
}

/** What a byte becomes of which `value` was to come. */
export function settled(place, value) {
  return (value | (high.get(place) ?? 0)) & ~(low.get(place) ?? 0);
}
