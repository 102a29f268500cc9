// Contacts that rise slowly: a pull-up of the RP2040 has 50 to 80 kΩ, and with a filter of 100 nF
// at the switch its input reads as high 7.5 ms after the pull-up is enabled, at the latest. Until
// then, from a reset of the chip on, it reads as low. What follows is not slowed: a filter would
// swallow the bouncing that tests want.

const PADS = 0x4001c;
/** Of the pad's register. */
const PULL_UP = 1 << 3;
const RISE_CYCLES = 937_500;

export class SlowContacts {
  /**
   * `numbers` are those of the pins; `now` tells the cycle; `changed` is called when one will rise.
   */
  constructor(chip, numbers, now, changed) {
    /** When each has risen, in cycles. */
    this.risen = new Map(numbers.map((number) => [number, Infinity]));
    const pads = chip.peripherals[PADS];
    const write = pads.writeUint32.bind(pads);
    pads.writeUint32 = (offset, value) => {
      write(offset, value);
      for (const [number, risen] of this.risen) {
        const isPulledUp = (chip.gpio[number].padValue & PULL_UP) !== 0;
        if (isPulledUp && risen === Infinity) {
          this.risen.set(number, now() + RISE_CYCLES);
          changed(number, now() + RISE_CYCLES);
        }
      }
    };
  }

  /** Whether the pin can be high by now. */
  hasRisen(number, cycle) {
    return (this.risen.get(number) ?? 0) <= cycle;
  }
}
