// Executes most instructions of a Cortex-M0+ by the package `penup-emulated-core`, which is
// compiled to WebAssembly, and shares the memories of the chip with it.

/** The indices of what is shared, in 32-bit words: the order of `Shared` in that package. */
const REGISTERS = 16;
const FLAGS = 16;
const IS_MASKED = 20;
const STALLED = 21;
const LINE = 22;
const GARBAGE_FROM = 23;
const GARBAGE_AFTER = 24;
const READS = 25;
const HAS_GARBLED = 26;
const CALL_CYCLES = 27;
const WORDS = 28;
/** The value of GARBAGE_AFTER if flash returns no garbage. */
const NEVER = 0xffffffff;

const RAM_BYTES = 264 * 1024;
const FLASH_BYTES = 16 << 20;
/** The upper bits of the addresses from 0x10000000 on: flash, four times. */
const FLASH_WINDOW = 0x10000000 >>> 26;
/** The most cycles that are executed at once. */
const MOST_CYCLES = 1e9;

export class QuickCore {
  /**
   * `wasm` is the compiled package, and `callCycles` what a POP of the program counter takes beyond
   * what rp2040js counts.
   */
  constructor(wasm, callCycles) {
    this.chip = null;
    const divider = {
      read: (offset) => this.chip.sio.readUint32(offset),
      write: (offset, value) => this.chip.sio.writeUint32(offset, value >>> 0),
    };
    this.exports = new WebAssembly.Instance(new WebAssembly.Module(wasm), { divider }).exports;
    this.pointer = this.exports.create();
    if (this.pointer === 0) throw new Error('there is no memory for the emulated core');
    const { buffer } = this.exports.memory;
    this.shared = new Uint32Array(buffer, this.exports.shared(this.pointer), WORDS);
    this.ram = new Uint8Array(buffer, this.exports.ram(this.pointer), RAM_BYTES);
    this.flash = new Uint8Array(buffer, this.exports.flash(this.pointer), FLASH_BYTES);
    this.shared[CALL_CYCLES] = callCycles;
  }

  /**
   * Becomes the core of a new chip, which gets these memories in place of its own; they keep what
   * they hold. Counts what rp2040js reads from flash, too; the core's vectors are read so.
   */
  attach(chip) {
    this.chip = chip;
    const view = (type, bytes, size) =>
      new type(bytes.buffer, bytes.byteOffset, bytes.byteLength / size);
    chip.sram = this.ram;
    chip.sramView = view(DataView, this.ram, 1);
    chip.flash = this.flash;
    chip.flash16 = view(Uint16Array, this.flash, 2);
    chip.flashView = view(DataView, this.flash, 1);
    const { core } = chip;
    core.registers = this.shared.subarray(0, REGISTERS);
    core.registers.fill(0);
    this.stalled = 0;
    this.shared[READS] = 0;
    this.flush();
    /** What garbage makes of what is read. */
    const garbage = (address) =>
      address >>> 26 === FLASH_WINDOW ? this.exports.data(this.pointer, address) : 0;
    core.readUint32 = (address) => (garbage(address) ^ chip.readUint32(address)) >>> 0;
    core.readUint16 = (address) => (garbage(address) & 0xffff) ^ chip.readUint16(address);
    core.readUint8 = (address) => (garbage(address) & 0xff) ^ chip.readUint8(address);
  }

  /**
   * Executes instructions until this many cycles have passed, or until an instruction comes that is
   * left to rp2040js, or that bears a mark. Returns the cycles that have passed.
   */
  run(limit) {
    const { shared, chip } = this;
    const { core } = chip;
    shared[FLAGS] = core.N ? 1 : 0;
    shared[FLAGS + 1] = core.Z ? 1 : 0;
    shared[FLAGS + 2] = core.C ? 1 : 0;
    shared[FLAGS + 3] = core.V ? 1 : 0;
    shared[IS_MASKED] = core.PM ? 1 : 0;
    const most = Math.min(Math.max(Math.ceil(limit), 0), MOST_CYCLES);
    const cycles = this.exports.run(this.pointer, most);
    core.N = shared[FLAGS] !== 0;
    core.Z = shared[FLAGS + 1] !== 0;
    core.C = shared[FLAGS + 2] !== 0;
    core.V = shared[FLAGS + 3] !== 0;
    return cycles;
  }

  /** Waits for the instruction at this address, if it does not lie in the line of the last one. */
  fetch(address) {
    if ((address - this.shared[LINE]) >>> 0 >= 6) this.exports.fetch(this.pointer, address);
  }

  /** Forgets what the cache holds, as `flash_flush_cache` does. */
  flush() {
    this.exports.flush(this.pointer);
  }

  /** Adds a mark to the instruction at this address, or removes one. */
  mark(address, adds) {
    this.exports.mark(this.pointer, address, adds ? 1 : 0);
  }

  /** Cycles for which the core has still to wait. */
  get stalled() {
    return this.shared[STALLED];
  }

  set stalled(cycles) {
    this.shared[STALLED] = cycles;
  }

  /** Lets flash return garbage from this offset on, after so many reads there. */
  garble(from, after) {
    this.shared[GARBAGE_FROM] = from;
    this.shared[GARBAGE_AFTER] = Math.min(after, NEVER);
  }

  /** How many reads there were where garbage may come, since the chip began. */
  get reads() {
    return this.shared[READS];
  }

  /** Whether flash has returned garbage since this was last asked. */
  takeGarbled() {
    const garbled = this.shared[HAS_GARBLED] !== 0;
    this.shared[HAS_GARBLED] = 0;
    return garbled;
  }
}
