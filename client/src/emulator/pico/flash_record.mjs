// Records what a program does to the flash, and what is in the flash if the power goes in between:
// before any byte, within a byte, or while any of the bits of a page or a sector have changed.
//
// A chip writes a page and erases a sector as a whole, in parallel; which of the bits have changed
// when the power goes is not said. So both are tried: byte by byte, and bits at random.

const PAGE = 256;
const SECTOR = 4096;
/** The chip of a Pico; the emulator has room for a larger one. */
const CHIP = 2 << 20;

/** Numbers below 256 without a pattern, the same for the same seed. */
function* numbers(seed) {
  for (let state = (seed ^ 0x9e3779b9) | 1; ; ) {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    yield (state >>> 8) & 0xff;
  }
}

export class FlashRecord {
  /** What was in the flash before, or null. */
  before = null;
  isRecording = false;
  /** Each: the cycle at which it begins, whether it erases, and the bytes that it changes. */
  operations = [];

  begin(flash) {
    this.before = flash.slice(0, CHIP);
    this.operations = [];
    this.isRecording = true;
  }

  end() {
    this.isRecording = false;
  }

  /**
   * Whole pages or sectors from `from` on are about to become what `change` says. Each begins
   * `duration` cycles after the one before.
   */
  note(isErasure, from, count, cycle, duration, flash, change) {
    const unit = isErasure ? SECTOR : PAGE;
    if (!this.isRecording) return;
    for (let start = from; start < from + count; start += unit, cycle += duration) {
      const changes = [];
      for (let at = start; at < start + unit; at++) {
        const [old, next] = [flash[at], change(at, flash[at])];
        if (old !== next) changes.push({ at, old, next });
      }
      this.operations.push({ isErasure, start, cycle, changes });
    }
  }

  /** What was in the flash before operation `number`. */
  flashBefore(number) {
    const flash = this.before.slice();
    for (const { changes } of this.operations.slice(0, number)) {
      for (const { at, next } of changes) flash[at] = next;
    }
    return flash;
  }

  /**
   * The same when that operation has changed `done` bytes, and those bits of the next one that are
   * in `mask`.
   */
  flashWithin(number, done, mask) {
    const flash = this.flashBefore(number);
    const changes = this.operations[number]?.changes ?? [];
    for (const { at, next } of changes.slice(0, done)) flash[at] = next;
    const partly = changes[done];
    if (partly) flash[partly.at] = partly.old ^ ((partly.old ^ partly.next) & mask);
    return flash;
  }

  /** The same when that operation has changed each bit with a probability of `share` in 256. */
  flashScattered(number, share, seed) {
    const flash = this.flashBefore(number);
    const random = numbers(seed);
    for (const { at, old, next } of this.operations[number]?.changes ?? []) {
      let mask = 0;
      for (let bit = 1; bit < 256; bit *= 2) if (random.next().value < share) mask |= bit;
      flash[at] = old ^ ((old ^ next) & mask);
    }
    return flash;
  }
}
