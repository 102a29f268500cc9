// The cache between the RP2040's core and its flash, as a count of the cycles for which the core
// waits.
//
// The data sheet (2.6.3) gives 16 KiB in two ways of lines of 8 bytes, and one cycle for a hit. It
// does not say which way is replaced; here it is the one that was used longest ago.
//
// A miss is a transfer by the SSI as the second boot stage sets it up (`boot2_w25q080.S`): quad, in
// continuous read mode, at half of the core's clock (the crate `rp2040-boot2` is assembled with
// PICO_FLASH_SPI_CLKDIV=2). It sends no command, 8 clocks of address and mode bits and 4 of
// waiting, and reads a 32-bit word in 8 clocks: 20 clocks, which are 40 cycles. With the way
// through the bus, the SSI's FIFOs and the chip select some 50 are waited; users have measured 400
// ns, which is as much. The rest of the line comes with it here.
//
// The core fetches one word ahead of what it executes. A line that is fetched ahead of a branch and
// then not needed is not counted.
//
// While the voltage falls or rises, flash may return garbage. A line that was fetched then stays
// garbage in the cache: reading it again does not ask the flash again.

/** Cycles that the core waits on a miss. */
export const MISS_CYCLES = 50;
const SETS = 1024;
/** Lines of the 24-bit address space. */
const LINES = 0x1fffff;
/** The upper bits of the addresses from 0x10000000 on: flash, four times. */
const FLASH_WINDOW = 0x10000000 >>> 26;
const NONE = -1;
/** Further from every address in flash than a line is long. */
const NOWHERE = 0;

/**
 * Where reads that return garbage begin, how many there are before one does, who hears of it, and
 * how many reads there were at all.
 */
export const brownOut = { from: 0, after: Infinity, happened() {}, reads: 0 };
/** What garbage differs in from what the flash holds. */
const GARBAGE = 0xa5c396f0;

export class XipCache {
  constructor(chip) {
    this.chip = chip;
    /** The line that was fetched as garbage, as long as it is held. */
    this.garbled = NONE;
    /** Whether what is read now is garbage. */
    this.isGarbage = false;
    /** The lines that are held: two ways of each set. */
    this.held = new Int32Array(2 * SETS);
    /** Of each set, the way that was used longest ago. */
    this.oldest = new Uint8Array(SETS);
    /** Where the line begins from which the last instruction came. It is held. */
    this.from = NOWHERE;
    /** Cycles for which the core has still to wait. */
    this.stalled = 0;
    this.flush();
    this.watchReads();
  }

  /** Forgets everything, as `flash_flush_cache` does. */
  flush() {
    this.held.fill(NONE);
    this.garbled = NONE;
    this.from = NOWHERE;
  }

  /** The core reads flash at this address. */
  read(address) {
    const alias = (address >>> 24) & 3;
    const line = (address >>> 3) & LINES;
    const set = line & (SETS - 1);
    const first = 2 * set;
    // 0x12 and 0x13 do not look into the cache; 0x11 and 0x13 leave it as it is.
    const looks = alias < 2;
    this.isGarbage = looks && this.garbled === line;
    if (looks && this.held[first] === line) {
      this.oldest[set] = 1;
      return;
    }
    if (looks && this.held[first + 1] === line) {
      this.oldest[set] = 0;
      return;
    }
    this.stalled += MISS_CYCLES;
    this.isGarbage = this.comesAsGarbage(address);
    if (alias & 1) return;
    const way = this.oldest[set];
    if (this.held[first + way] === this.garbled) this.garbled = NONE;
    if (this.isGarbage) this.garbled = line;
    if (this.held[first + way] === ((this.from >>> 3) & LINES)) this.from = NOWHERE;
    this.held[first + way] = line;
    this.oldest[set] = way ^ 1;
  }

  /** Whether the flash, which is asked now, returns garbage. */
  comesAsGarbage(address) {
    if ((address & 0xffffff) < brownOut.from) return false;
    brownOut.reads++;
    if (brownOut.after-- > 0) return false;
    brownOut.after = Infinity;
    brownOut.happened();
    return true;
  }

  /**
   * The core is about to execute the instruction at this address. Need not be called for the first
   * three half words behind `from`: they are held, and are too far from its end for an instruction
   * of two half words to cross it.
   */
  fetch(address) {
    if (address >>> 26 !== FLASH_WINDOW) return;
    this.read(address);
    const isLast = (address & 6) === 6;
    const first = this.chip.flash16[(address & 0xffffff) >>> 1];
    if (isLast && first >>> 11 >= 0b11101) this.read(address + 2);
    if (address >>> 24 === 0x10) this.from = (address & ~7) >>> 0;
  }

  /** Counts what instructions read. The core's vectors are read so, too. */
  watchReads() {
    const { chip } = this;
    const { core } = chip;
    /** What garbage makes of what is read. */
    const note = (address) => {
      // Instructions come this way, too, and have been counted.
      if ((address - this.from) >>> 0 < 8 || address >>> 26 !== FLASH_WINDOW) return 0;
      this.read(address);
      return this.isGarbage ? GARBAGE >>> (8 * (address & 3)) : 0;
    };
    core.readUint32 = (address) => (note(address) ^ chip.readUint32(address)) >>> 0;
    core.readUint16 = (address) => (note(address) & 0xffff) ^ chip.readUint16(address);
    core.readUint8 = (address) => (note(address) & 0xff) ^ chip.readUint8(address);
  }
}

