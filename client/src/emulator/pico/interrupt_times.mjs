// Measures how long the handlers of a Cortex-M0+ run, and how long interrupts are masked: all of
// them by PRIMASK, and each one by the interrupt controller. The longest time of each kind is kept.

/** The number under which the time with PRIMASK set is told. */
const ALL = 255;
/** The same where the core has waited meanwhile for the flash to be erased or written. */
const ALL_FOR_FLASH = 254;
const INTERRUPTS = 32;

export class InterruptTimes {
  /** `now` returns the cycle, and `flashWaits` how often the core has waited for the flash. */
  constructor(now, flashWaits) {
    this.now = now;
    this.flashWaits = flashWaits;
    /** The longest time of each handler, by the number of its exception. */
    this.handlers = new Map();
    /** The longest time for which each interrupt was masked, by its number. */
    this.masks = new Map();
  }

  forget() {
    this.handlers.clear();
    this.masks.clear();
  }

  /** Measures the core of a chip that begins now. Whatever was not over by then does not count. */
  attach(core) {
    const { now, flashWaits } = this;
    const keepLongest = (times, number, began) =>
      times.set(number, Math.max(times.get(number) ?? 0, now() - began));
    /** The exceptions that are active, the last one on top. */
    const active = [];
    const enter = core.exceptionEntry.bind(core);
    core.exceptionEntry = (number) => {
      active.push({ number, began: now() });
      enter(number);
    };
    const leave = core.exceptionReturn.bind(core);
    core.exceptionReturn = (to) => {
      leave(to);
      const last = active.pop();
      if (last) keepLongest(this.handlers, last.number, last.began);
    };

    let isMasked = core.PM;
    let maskedSince = now();
    let waitsBefore = flashWaits();
    Object.defineProperty(core, 'PM', {
      get: () => isMasked,
      set: (value) => {
        if (value && !isMasked) [maskedSince, waitsBefore] = [now(), flashWaits()];
        else if (!value && isMasked) {
          const number = flashWaits() === waitsBefore ? ALL : ALL_FOR_FLASH;
          keepLongest(this.masks, number, maskedSince);
        }
        isMasked = value;
      },
    });

    let enabled = core.enabledInterrupts;
    /** Since when each interrupt has been masked that was enabled before. */
    const since = new Array(INTERRUPTS).fill(null);
    Object.defineProperty(core, 'enabledInterrupts', {
      get: () => enabled,
      set: (value) => {
        for (let changed = enabled ^ value; changed; changed &= changed - 1) {
          const number = 31 - Math.clz32(changed & -changed);
          if (enabled & (1 << number)) since[number] = now();
          else if (since[number] !== null) keepLongest(this.masks, number, since[number]);
        }
        enabled = value;
      },
    });
  }
}
