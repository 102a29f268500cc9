// Measures the time from each call of a function to the next one, such as of the function by which
// the main loop takes what was asked in real time. While the core sleeps, no time counts.

export class CallGaps {
  /**
   * `awake` returns for how many cycles the core has been awake, and `flashWaits` how often it has
   * waited for the flash. Shorter times than `least` are not told.
   */
  constructor(address, least, awake, flashWaits) {
    this.address = address;
    this.least = least;
    this.awake = awake;
    this.flashWaits = flashWaits;
    this.begin();
  }

  /** What was before does not count, because the chip begins now. */
  begin() {
    this.last = null;
  }

  /** The function is called. Returns the time since the last call, if it is to be told. */
  call() {
    const { last } = this;
    this.last = { at: this.awake(), waits: this.flashWaits() };
    if (last === null || this.last.at - last.at < this.least) return null;
    return { cycles: this.last.at - last.at, changesFlash: this.last.waits !== last.waits };
  }
}
