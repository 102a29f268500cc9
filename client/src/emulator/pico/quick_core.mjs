// Executes most instructions of a Cortex-M0+ many times as fast as rp2040js does.
//
// rp2040js compares each instruction with one pattern after the other, and asks for each address
// what lies there. Here one switch decides, and only RAM and flash are reached. Everything else, as
// the registers of the chip, exceptions, special registers and sleep, is left to rp2040js: its
// interpreter then executes the instruction, before anything of it has been done here.
//
// The cycles are those that rp2040js and `core_cycles.mjs` count. The test `pico_core` compares
// both after each instruction, with random ones.

const RAM = 0x20000000;
/** The upper bits of the addresses of flash. */
const FLASH_WINDOW = 0x10000000 >>> 26;
/** The addresses at which the core executes flash. */
const FLASH_CODE = 0x10;

/** Marks of instructions: one of each address, and of those that differ in the upper bits. */
export class Marks {
  constructor() {
    this.counts = new Uint8Array(1 << 23);
  }

  /** Adds so many marks to an address. */
  add(address, count) {
    this.counts[(address >>> 1) & 0x7fffff] += count;
  }
}

/**
 * Returns a function that executes instructions until this many cycles have passed, or until an
 * instruction comes that is left to rp2040js, or that bears one of the marks. It returns the cycles
 * that have passed.
 * `xip` is the cache, and `callCycles` what a POP of the program counter takes beyond what rp2040js
 * counts.
 */
export function quickCore(chip, xip, callCycles) {
  const { core } = chip;
  const r = core.registers;
  const flash16 = chip.flash16;
  const ram8 = chip.sram;
  const ram16 = new Uint16Array(ram8.buffer);
  const ram32 = new Uint32Array(ram8.buffer);
  const ramBytes = ram8.length;
  const flashMask = chip.flash.length - 1;

  /** Whether a load of so many bytes is carried out here: aligned, from RAM or flash. */
  const canLoad = (address, bytes) =>
    (address & (bytes - 1)) === 0 &&
    (address >>> 26 === FLASH_WINDOW || (address - RAM) >>> 0 <= ramBytes - bytes);
  const canStore = (address, bytes) =>
    (address & (bytes - 1)) === 0 && (address - RAM) >>> 0 <= ramBytes - bytes;
  const load32 = (address) => {
    const at = (address - RAM) >>> 0;
    return at < ramBytes ? ram32[at >>> 2] : core.readUint32(address);
  };
  const load16 = (address) => {
    const at = (address - RAM) >>> 0;
    return at < ramBytes ? ram16[at >>> 1] : core.readUint16(address);
  };
  const load8 = (address) => {
    const at = (address - RAM) >>> 0;
    return at < ramBytes ? ram8[at] : core.readUint8(address);
  };
  const flags = (result) => {
    core.N = result < 0;
    core.Z = result === 0;
    return result;
  };
  /** The sum of two numbers of 32 bits without signs, and a carry of 0 or 1. */
  const add = (one, other, carry) => {
    const sum = one + other + carry;
    const result = sum | 0;
    core.N = result < 0;
    core.Z = result === 0;
    core.C = sum > 0xffffffff;
    core.V = ((one ^ result) & (other ^ result)) < 0;
    return result;
  };
  const subtract = (one, other) => add(one, ~other >>> 0, 1);
  const fetch16 = (address) =>
    address >>> 24 === FLASH_CODE
      ? flash16[(address & flashMask) >>> 1]
      : ram16[(address - RAM) >>> 1];
  const countBits = (mask) => {
    let count = 0;
    for (let bits = mask; bits; bits &= bits - 1) count++;
    return count;
  };

  /** Shifts by a register. */
  const shift = (kind, value, by) => {
    if (by === 0) return flags(value | 0);
    let result = 0;
    if (kind === 2) {
      core.C = by <= 32 && ((by < 32 ? value >>> (32 - by) : value) & 1) !== 0;
      result = by < 32 ? value << by : 0;
    } else if (kind === 3) {
      core.C = by <= 32 && ((value >>> (by - 1)) & 1) !== 0;
      result = by < 32 ? value >>> by : 0;
    } else {
      const most = Math.min(by, 32);
      core.C = ((value >> (most - 1 > 31 ? 31 : most - 1)) & 1) !== 0;
      result = value >> Math.min(most, 31);
    }
    return flags(result | 0);
  };

  /** Those on two low registers. Returns false for what is left to rp2040js. */
  const compute = (op) => {
    const d = op & 7;
    const m = r[(op >>> 3) & 7];
    switch ((op >>> 6) & 15) {
      case 0: r[d] = flags(r[d] & m); break;
      case 1: r[d] = flags(r[d] ^ m); break;
      case 2: r[d] = shift(2, r[d], m & 0xff); break;
      case 3: r[d] = shift(3, r[d], m & 0xff); break;
      case 4: r[d] = shift(4, r[d], m & 0xff); break;
      case 5: r[d] = add(r[d], m, core.C ? 1 : 0); break;
      case 6: r[d] = add(r[d], ~m >>> 0, core.C ? 1 : 0); break;
      case 8: flags(r[d] & m); break;
      case 9: r[d] = subtract(0, m); break;
      case 10: subtract(r[d], m); break;
      case 11: add(r[d], m, 0); break;
      case 12: r[d] = flags(r[d] | m); break;
      case 13: r[d] = flags(Math.imul(r[d], m)); break;
      case 14: r[d] = flags(r[d] & ~m); break;
      case 15: r[d] = flags(~m); break;
      default: return false;
    }
    return true;
  };

  /** Whether a conditional branch is taken. */
  const holds = (condition) => {
    switch (condition) {
      case 0: return core.Z;
      case 1: return !core.Z;
      case 2: return core.C;
      case 3: return !core.C;
      case 4: return core.N;
      case 5: return !core.N;
      case 6: return core.V;
      case 7: return !core.V;
      case 8: return core.C && !core.Z;
      case 9: return !core.C || core.Z;
      case 10: return core.N === core.V;
      case 11: return core.N !== core.V;
      case 12: return core.N === core.V && !core.Z;
      default: return core.N !== core.V || core.Z;
    }
  };

  /** Executes the instruction at `pc`. Returns its cycles; 0 if it is left to rp2040js. */
  const execute = (pc, op) => {
    let cycles = 1;
    let next = pc + 2;
    switch (op >>> 11) {
      case 0: {
        const by = (op >>> 6) & 31;
        const value = r[(op >>> 3) & 7];
        if (by) core.C = ((value >>> (32 - by)) & 1) !== 0;
        r[op & 7] = flags(value << by);
        break;
      }
      case 1: {
        const by = (op >>> 6) & 31;
        const value = r[(op >>> 3) & 7];
        core.C = ((value >>> (by ? by - 1 : 31)) & 1) !== 0;
        r[op & 7] = flags((by ? value >>> by : 0) | 0);
        break;
      }
      case 2: {
        const by = (op >>> 6) & 31;
        const value = r[(op >>> 3) & 7];
        core.C = ((value >>> (by ? by - 1 : 31)) & 1) !== 0;
        r[op & 7] = flags(value >> (by || 31));
        break;
      }
      case 3: {
        const one = r[(op >>> 3) & 7];
        const number = (op >>> 6) & 7;
        const other = op & 0x400 ? number : r[number];
        r[op & 7] = op & 0x200 ? subtract(one, other) : add(one, other, 0);
        break;
      }
      case 4:
        r[(op >>> 8) & 7] = flags(op & 0xff);
        break;
      case 5:
        subtract(r[(op >>> 8) & 7], op & 0xff);
        break;
      case 6: {
        const d = (op >>> 8) & 7;
        r[d] = add(r[d], op & 0xff, 0);
        break;
      }
      case 7: {
        const d = (op >>> 8) & 7;
        r[d] = subtract(r[d], op & 0xff);
        break;
      }
      case 8: {
        if (op < 0x4400) {
          if (!compute(op)) return 0;
          break;
        }
        const m = (op >>> 3) & 15;
        const d = ((op >>> 4) & 8) | (op & 7);
        const kind = (op >>> 8) & 3;
        if (kind === 3) {
          const to = r[m];
          // The return from an exception, and what is no address of an instruction.
          if (m === 15 || (op & 7) !== 0 || to >>> 28 === 15) return 0;
          if (op & 0x80) r[14] = (pc + 2) | 1;
          next = to & ~1;
          cycles = 2;
          break;
        }
        if (d === 13 || d === 15 || m === 15) return 0;
        if (kind === 0) r[d] += r[m];
        else if (kind === 1) subtract(r[d], r[m]);
        else r[d] = r[m];
        break;
      }
      case 9:
        r[(op >>> 8) & 7] = load32(((pc + 4) & ~3) + ((op & 0xff) << 2));
        cycles = 2;
        break;
      case 10: {
        const address = (r[(op >>> 6) & 7] + r[(op >>> 3) & 7]) >>> 0;
        const value = op & 7;
        const kind = (op >>> 9) & 3;
        if (kind === 0) {
          if (!canStore(address, 4)) return 0;
          ram32[(address - RAM) >>> 2] = r[value];
        } else if (kind === 1) {
          if (!canStore(address, 2)) return 0;
          ram16[(address - RAM) >>> 1] = r[value];
        } else if (kind === 2) {
          if (!canStore(address, 1)) return 0;
          ram8[address - RAM] = r[value];
        } else {
          if (!canLoad(address, 1)) return 0;
          r[value] = (load8(address) << 24) >> 24;
        }
        cycles = 2;
        break;
      }
      case 11: {
        const address = (r[(op >>> 6) & 7] + r[(op >>> 3) & 7]) >>> 0;
        const value = op & 7;
        const kind = (op >>> 9) & 3;
        if (!canLoad(address, kind === 0 ? 4 : kind === 2 ? 1 : 2)) return 0;
        if (kind === 0) r[value] = load32(address);
        else if (kind === 1) r[value] = load16(address);
        else if (kind === 2) r[value] = load8(address);
        else r[value] = (load16(address) << 16) >> 16;
        cycles = 2;
        break;
      }
      case 12: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 4) & 0x7c)) >>> 0;
        if (!canStore(address, 4)) return 0;
        ram32[(address - RAM) >>> 2] = r[op & 7];
        cycles = 2;
        break;
      }
      case 13: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 4) & 0x7c)) >>> 0;
        if (!canLoad(address, 4)) return 0;
        r[op & 7] = load32(address);
        cycles = 2;
        break;
      }
      case 14: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 6) & 31)) >>> 0;
        if (!canStore(address, 1)) return 0;
        ram8[address - RAM] = r[op & 7];
        cycles = 2;
        break;
      }
      case 15: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 6) & 31)) >>> 0;
        if (!canLoad(address, 1)) return 0;
        r[op & 7] = load8(address);
        cycles = 2;
        break;
      }
      case 16: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 5) & 0x3e)) >>> 0;
        if (!canStore(address, 2)) return 0;
        ram16[(address - RAM) >>> 1] = r[op & 7];
        cycles = 2;
        break;
      }
      case 17: {
        const address = (r[(op >>> 3) & 7] + ((op >>> 5) & 0x3e)) >>> 0;
        if (!canLoad(address, 2)) return 0;
        r[op & 7] = load16(address);
        cycles = 2;
        break;
      }
      case 18: {
        const address = (r[13] + ((op & 0xff) << 2)) >>> 0;
        if (!canStore(address, 4)) return 0;
        ram32[(address - RAM) >>> 2] = r[(op >>> 8) & 7];
        cycles = 2;
        break;
      }
      case 19: {
        const address = (r[13] + ((op & 0xff) << 2)) >>> 0;
        if (!canLoad(address, 4)) return 0;
        r[(op >>> 8) & 7] = load32(address);
        cycles = 2;
        break;
      }
      case 20:
        r[(op >>> 8) & 7] = ((pc + 4) & ~3) + ((op & 0xff) << 2);
        break;
      case 21:
        r[(op >>> 8) & 7] = r[13] + ((op & 0xff) << 2);
        break;
      case 22: {
        const kind = op >>> 8;
        if (kind === 0xb0) {
          const by = (op & 0x7f) << 2;
          r[13] += op & 0x80 ? -by : by;
        } else if (kind === 0xb2) {
          const value = r[(op >>> 3) & 7];
          const how = (op >>> 6) & 3;
          if (how === 0) r[op & 7] = (value << 16) >> 16;
          else if (how === 1) r[op & 7] = (value << 24) >> 24;
          else r[op & 7] = value & (how === 2 ? 0xffff : 0xff);
        } else if (op >>> 9 === 0b1011010) {
          const low = countBits(op & 0xff);
          const bytes = 4 * (low + ((op >>> 8) & 1));
          let address = (r[13] - bytes) >>> 0;
          if (bytes === 0 || !canStore(address, 4) || !canStore(address + bytes - 4, 4)) return 0;
          r[13] = address;
          let at = (address - RAM) >>> 2;
          for (let i = 0; i < 8; i++) if (op & (1 << i)) ram32[at++] = r[i];
          if (op & 0x100) ram32[at] = r[14];
          cycles = 1 + low;
        } else return 0;
        break;
      }
      case 23: {
        if (op >>> 9 !== 0b1011110) return 0;
        const low = countBits(op & 0xff);
        const bytes = 4 * (low + ((op >>> 8) & 1));
        const address = r[13];
        if (bytes === 0 || !canStore(address, 4) || !canStore(address + bytes - 4, 4)) return 0;
        let at = (address - RAM) >>> 2;
        if (op & 0x100) {
          const to = ram32[at + low];
          if (to >>> 28 === 15) return 0;
          next = to & ~1;
          xip.stalled += callCycles;
          cycles = 3 + low;
        } else cycles = 1 + low;
        for (let i = 0; i < 8; i++) if (op & (1 << i)) r[i] = ram32[at++];
        r[13] = address + bytes;
        break;
      }
      case 24: {
        const n = (op >>> 8) & 7;
        const count = countBits(op & 0xff);
        const address = r[n];
        // With the base among them the order matters.
        if (op & (1 << n) || !count) return 0;
        if (!canStore(address, 4) || !canStore(address + 4 * count - 4, 4)) return 0;
        let at = (address - RAM) >>> 2;
        for (let i = 0; i < 8; i++) if (op & (1 << i)) ram32[at++] = r[i];
        r[n] = address + 4 * count;
        cycles = 1 + count;
        break;
      }
      case 25: {
        const n = (op >>> 8) & 7;
        const count = countBits(op & 0xff);
        let address = r[n];
        if (!count || !canLoad(address, 4) || !canLoad(address + 4 * count - 4, 4)) return 0;
        for (let i = 0; i < 8; i++) {
          if (op & (1 << i)) {
            r[i] = load32(address);
            address += 4;
          }
        }
        if (!(op & (1 << n))) r[n] = address;
        cycles = 1 + count;
        break;
      }
      case 26:
      case 27: {
        const condition = (op >>> 8) & 15;
        if (condition >= 14) return 0;
        if (holds(condition)) {
          next = pc + 4 + ((op << 24) >> 23);
          cycles = 2;
        }
        break;
      }
      case 28:
        next = pc + 4 + ((op << 21) >> 20);
        cycles = 2;
        break;
      case 30: {
        const second = fetch16(pc + 2);
        if ((second & 0xd000) !== 0xd000) return 0;
        const sign = (op >>> 10) & 1;
        const i1 = ~((second >>> 13) ^ sign) & 1;
        const i2 = ~((second >>> 11) ^ sign) & 1;
        const top = sign ? 0xff000000 : 0;
        const by = top | (i1 << 23) | (i2 << 22) | ((op & 0x3ff) << 12) | ((second & 0x7ff) << 1);
        r[14] = (pc + 4) | 1;
        next = pc + 4 + by;
        cycles = 3;
        break;
      }
      default:
        return 0;
    }
    r[15] = next;
    return cycles;
  };

  return (limit, marks) => {
    const counts = marks?.counts;
    let cycles = 0;
    while (cycles < limit) {
      const pc = r[15];
      if ((pc - xip.from) >>> 0 >= 6) xip.fetch(pc);
      if (xip.stalled !== 0) {
        // Time may bring something before the core goes on.
        cycles += xip.stalled;
        xip.stalled = 0;
        continue;
      }
      if (counts !== undefined && counts[(pc >>> 1) & 0x7fffff] !== 0) break;
      const isFlash = pc >>> 24 === FLASH_CODE;
      if (!isFlash && (pc - RAM) >>> 0 >= ramBytes - 2) break;
      const op = isFlash ? flash16[(pc & flashMask) >>> 1] : ram16[(pc - RAM) >>> 1];
      const taken = execute(pc, op);
      if (taken === 0) break;
      cycles += taken;
    }
    return cycles;
  };
}
