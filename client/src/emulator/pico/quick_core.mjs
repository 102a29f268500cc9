// Executes most instructions of a Cortex-M0+ many times as fast as rp2040js does.
//
// rp2040js compares each instruction with one pattern after the other, and asks for each address
// what lies there. Here one switch decides, and only RAM, flash and the divider are reached, which
// do not depend on the time. Everything else, such as the other registers of the chip, exceptions,
// most special registers and sleep, is left to rp2040js: its interpreter then executes the
// instruction, before anything of it has been done here.
//
// The loop below calls few functions, and writes sums and differences out where they are needed:
// JavaScript engines no longer inline calls in a function of this size, and a call takes longer
// than most instructions.
//
// The cycles are those that rp2040js and `core_cycles.mjs` count. The test `pico_core` compares
// both after each instruction, with random ones.

const RAM = 0x20000000;
/** The upper bits of the addresses of flash. */
const FLASH_WINDOW = 0x10000000 >>> 26;
/** The addresses at which the core executes flash. */
const FLASH_CODE = 0x10;
/** The registers of the divider, relative to those of the block that it belongs to. */
const SIO = 0xd0000000;
const DIVIDER = 0x60;
const DIVIDER_BYTES = 0x1c;

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
  const { core, sio } = chip;
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
  const isDivider = (address) =>
    (address & 3) === 0 && (address - SIO - DIVIDER) >>> 0 < DIVIDER_BYTES;
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
  const fetch16 = (address) =>
    address >>> 24 === FLASH_CODE
      ? flash16[(address & flashMask) >>> 1]
      : ram16[(address - RAM) >>> 1];
  const countBits = (mask) => {
    let count = 0;
    for (let bits = mask; bits; bits &= bits - 1) count++;
    return count;
  };

  return (limit, marks) => {
    // No result is negative and zero, which would need more to remember than one number.
    if (core.N && core.Z) return 0;
    const counts = marks?.counts;
    let cycles = 0;
    let pc = r[15];
    // The flags are kept as numbers: N and Z as those of a result, C as 0 or 1, and V as the sign.
    let nz = core.Z ? 0 : core.N ? -1 : 1;
    let c = core.C ? 1 : 0;
    let v = core.V ? -1 : 0;
    run: while (cycles < limit) {
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
      let taken = 1;
      let next = pc + 2;
      switch (op >>> 11) {
        case 0: {
          const by = (op >>> 6) & 31;
          const value = r[(op >>> 3) & 7];
          if (by) c = (value >>> (32 - by)) & 1;
          r[op & 7] = nz = value << by;
          break;
        }
        case 1: {
          const by = (op >>> 6) & 31;
          const value = r[(op >>> 3) & 7];
          c = (value >>> (by ? by - 1 : 31)) & 1;
          r[op & 7] = nz = (by ? value >>> by : 0) | 0;
          break;
        }
        case 2: {
          const by = (op >>> 6) & 31;
          const value = r[(op >>> 3) & 7];
          c = (value >>> (by ? by - 1 : 31)) & 1;
          r[op & 7] = nz = value >> (by || 31);
          break;
        }
        case 3: {
          const one = r[(op >>> 3) & 7];
          const number = (op >>> 6) & 7;
          const other = op & 0x400 ? number : r[number];
          if (op & 0x200) {
            nz = (one - other) | 0;
            c = one >= other ? 1 : 0;
            v = (one ^ other) & (one ^ nz);
          } else {
            nz = (one + other) | 0;
            c = nz >>> 0 < one ? 1 : 0;
            v = (one ^ nz) & (other ^ nz);
          }
          r[op & 7] = nz;
          break;
        }
        case 4:
          r[(op >>> 8) & 7] = nz = op & 0xff;
          break;
        case 5: {
          const one = r[(op >>> 8) & 7];
          const other = op & 0xff;
          nz = (one - other) | 0;
          c = one >= other ? 1 : 0;
          v = (one ^ other) & (one ^ nz);
          break;
        }
        case 6: {
          const d = (op >>> 8) & 7;
          const one = r[d];
          const other = op & 0xff;
          r[d] = nz = (one + other) | 0;
          c = nz >>> 0 < one ? 1 : 0;
          v = (one ^ nz) & (other ^ nz);
          break;
        }
        case 7: {
          const d = (op >>> 8) & 7;
          const one = r[d];
          const other = op & 0xff;
          r[d] = nz = (one - other) | 0;
          c = one >= other ? 1 : 0;
          v = (one ^ other) & (one ^ nz);
          break;
        }
        case 8: {
          if (op < 0x4400) {
            const d = op & 7;
            const one = r[d];
            const m = r[(op >>> 3) & 7];
            const by = m & 0xff;
            switch ((op >>> 6) & 15) {
              case 0: r[d] = nz = one & m; break;
              case 1: r[d] = nz = one ^ m; break;
              case 2:
                if (by !== 0) c = by <= 32 ? (by < 32 ? one >>> (32 - by) : one) & 1 : 0;
                r[d] = nz = by < 32 ? one << by : 0;
                break;
              case 3:
                if (by !== 0) c = by <= 32 ? (one >>> (by - 1)) & 1 : 0;
                r[d] = nz = by < 32 ? (one >>> by) | 0 : 0;
                break;
              case 4:
                if (by !== 0) c = (one >> (by > 32 ? 31 : by - 1)) & 1;
                r[d] = nz = one >> (by < 32 ? by : 31);
                break;
              case 5:
              case 6: {
                const other = op & 0x40 ? m : ~m >>> 0;
                const sum = one + other + c;
                r[d] = nz = sum | 0;
                c = sum > 0xffffffff ? 1 : 0;
                v = (one ^ nz) & (other ^ nz);
                break;
              }
              case 8: nz = one & m; break;
              case 9:
                r[d] = nz = -m | 0;
                c = m === 0 ? 1 : 0;
                v = m & nz;
                break;
              case 10:
                nz = (one - m) | 0;
                c = one >= m ? 1 : 0;
                v = (one ^ m) & (one ^ nz);
                break;
              case 11:
                nz = (one + m) | 0;
                c = nz >>> 0 < one ? 1 : 0;
                v = (one ^ nz) & (m ^ nz);
                break;
              case 12: r[d] = nz = one | m; break;
              case 13: r[d] = nz = Math.imul(one, m); break;
              case 14: r[d] = nz = one & ~m; break;
              case 15: r[d] = nz = ~m; break;
              default: break run;
            }
            break;
          }
          const m = (op >>> 3) & 15;
          const d = ((op >>> 4) & 8) | (op & 7);
          const kind = (op >>> 8) & 3;
          if (kind === 3) {
            const to = r[m];
            // The return from an exception, and what is no address of an instruction.
            if (m === 15 || (op & 7) !== 0 || to >>> 28 === 15) break run;
            if (op & 0x80) r[14] = (pc + 2) | 1;
            next = to & ~1;
            taken = 2;
            break;
          }
          if (d === 15 || m === 15 || (d === 13 && kind !== 0)) break run;
          if (kind === 0) r[d] = d === 13 ? (r[13] + r[m]) & ~3 : r[d] + r[m];
          else if (kind === 1) {
            const one = r[d];
            const other = r[m];
            nz = (one - other) | 0;
            c = one >= other ? 1 : 0;
            v = (one ^ other) & (one ^ nz);
          } else r[d] = r[m];
          break;
        }
        case 9:
          r[(op >>> 8) & 7] = load32(((pc + 4) & ~3) + ((op & 0xff) << 2));
          taken = 2;
          break;
        case 10: {
          const address = (r[(op >>> 6) & 7] + r[(op >>> 3) & 7]) >>> 0;
          const value = op & 7;
          const kind = (op >>> 9) & 3;
          if (kind === 0) {
            if (!canStore(address, 4)) break run;
            ram32[(address - RAM) >>> 2] = r[value];
          } else if (kind === 1) {
            if (!canStore(address, 2)) break run;
            ram16[(address - RAM) >>> 1] = r[value];
          } else if (kind === 2) {
            if (!canStore(address, 1)) break run;
            ram8[address - RAM] = r[value];
          } else {
            if (!canLoad(address, 1)) break run;
            r[value] = (load8(address) << 24) >> 24;
          }
          taken = 2;
          break;
        }
        case 11: {
          const address = (r[(op >>> 6) & 7] + r[(op >>> 3) & 7]) >>> 0;
          const value = op & 7;
          const kind = (op >>> 9) & 3;
          if (!canLoad(address, kind === 0 ? 4 : kind === 2 ? 1 : 2)) break run;
          if (kind === 0) r[value] = load32(address);
          else if (kind === 1) r[value] = load16(address);
          else if (kind === 2) r[value] = load8(address);
          else r[value] = (load16(address) << 16) >> 16;
          taken = 2;
          break;
        }
        case 12: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 4) & 0x7c)) >>> 0;
          if (!canStore(address, 4)) {
            if (!isDivider(address)) break run;
            sio.writeUint32(address - SIO, r[op & 7]);
            break;
          }
          ram32[(address - RAM) >>> 2] = r[op & 7];
          taken = 2;
          break;
        }
        case 13: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 4) & 0x7c)) >>> 0;
          if (!canLoad(address, 4)) {
            if (!isDivider(address)) break run;
            r[op & 7] = sio.readUint32(address - SIO);
            break;
          }
          r[op & 7] = load32(address);
          taken = 2;
          break;
        }
        case 14: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 6) & 31)) >>> 0;
          if (!canStore(address, 1)) break run;
          ram8[address - RAM] = r[op & 7];
          taken = 2;
          break;
        }
        case 15: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 6) & 31)) >>> 0;
          if (!canLoad(address, 1)) break run;
          r[op & 7] = load8(address);
          taken = 2;
          break;
        }
        case 16: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 5) & 0x3e)) >>> 0;
          if (!canStore(address, 2)) break run;
          ram16[(address - RAM) >>> 1] = r[op & 7];
          taken = 2;
          break;
        }
        case 17: {
          const address = (r[(op >>> 3) & 7] + ((op >>> 5) & 0x3e)) >>> 0;
          if (!canLoad(address, 2)) break run;
          r[op & 7] = load16(address);
          taken = 2;
          break;
        }
        case 18: {
          const address = (r[13] + ((op & 0xff) << 2)) >>> 0;
          if (!canStore(address, 4)) break run;
          ram32[(address - RAM) >>> 2] = r[(op >>> 8) & 7];
          taken = 2;
          break;
        }
        case 19: {
          const address = (r[13] + ((op & 0xff) << 2)) >>> 0;
          if (!canLoad(address, 4)) break run;
          r[(op >>> 8) & 7] = load32(address);
          taken = 2;
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
            if (bytes === 0 || !canStore(address, 4)) break run;
            if (!canStore(address + bytes - 4, 4)) break run;
            r[13] = address;
            let at = (address - RAM) >>> 2;
            for (let i = 0; i < 8; i++) if (op & (1 << i)) ram32[at++] = r[i];
            if (op & 0x100) ram32[at] = r[14];
            taken = 1 + low;
          } else break run;
          break;
        }
        case 23: {
          if (op >>> 9 !== 0b1011110) break run;
          const low = countBits(op & 0xff);
          const bytes = 4 * (low + ((op >>> 8) & 1));
          const address = r[13];
          if (bytes === 0 || !canStore(address, 4) || !canStore(address + bytes - 4, 4)) break run;
          let at = (address - RAM) >>> 2;
          if (op & 0x100) {
            const to = ram32[at + low];
            if (to >>> 28 === 15) break run;
            next = to & ~1;
            xip.stalled += callCycles;
            taken = 3 + low;
          } else taken = 1 + low;
          for (let i = 0; i < 8; i++) if (op & (1 << i)) r[i] = ram32[at++];
          r[13] = address + bytes;
          break;
        }
        case 24: {
          const n = (op >>> 8) & 7;
          const count = countBits(op & 0xff);
          const address = r[n];
          // With the base among them the order matters.
          if (op & (1 << n) || !count) break run;
          if (!canStore(address, 4) || !canStore(address + 4 * count - 4, 4)) break run;
          let at = (address - RAM) >>> 2;
          for (let i = 0; i < 8; i++) if (op & (1 << i)) ram32[at++] = r[i];
          r[n] = address + 4 * count;
          taken = 1 + count;
          break;
        }
        case 25: {
          const n = (op >>> 8) & 7;
          const count = countBits(op & 0xff);
          let address = r[n];
          if (!count || !canLoad(address, 4) || !canLoad(address + 4 * count - 4, 4)) break run;
          for (let i = 0; i < 8; i++) {
            if (op & (1 << i)) {
              r[i] = load32(address);
              address += 4;
            }
          }
          if (!(op & (1 << n))) r[n] = address;
          taken = 1 + count;
          break;
        }
        case 26:
        case 27: {
          const condition = (op >>> 8) & 15;
          if (condition >= 14) break run;
          let holds;
          switch (condition >>> 1) {
            case 0: holds = nz === 0; break;
            case 1: holds = c !== 0; break;
            case 2: holds = nz < 0; break;
            case 3: holds = v < 0; break;
            case 4: holds = c !== 0 && nz !== 0; break;
            case 5: holds = nz < 0 === v < 0; break;
            default: holds = nz !== 0 && nz < 0 === v < 0; break;
          }
          if (holds !== ((condition & 1) !== 0)) {
            next = pc + 4 + ((op << 24) >> 23);
            taken = 2;
          }
          break;
        }
        case 28:
          next = pc + 4 + ((op << 21) >> 20);
          taken = 2;
          break;
        case 30: {
          const second = fetch16(pc + 2);
          if ((second & 0xd000) !== 0xd000) {
            if (op === 0xf3ef && (second & 0xf8ff) === 0x8010) {
              r[(second >>> 8) & 7] = core.PM ? 1 : 0; // MRS of PRIMASK
            } else {
              // The barriers DSB, DMB and ISB: nothing is done out of order here.
              if (op !== 0xf3bf || second < 0x8f40 || second > 0x8f6f) break run;
            }
            next = pc + 4;
            taken = 3;
            break;
          }
          const sign = (op >>> 10) & 1;
          const i1 = ~((second >>> 13) ^ sign) & 1;
          const i2 = ~((second >>> 11) ^ sign) & 1;
          const top = sign ? 0xff000000 : 0;
          const by = top | (i1 << 23) | (i2 << 22) | ((op & 0x3ff) << 12) | ((second & 0x7ff) << 1);
          r[14] = (pc + 4) | 1;
          next = pc + 4 + by;
          taken = 3;
          break;
        }
        default:
          break run;
      }
      pc = next >>> 0;
      cycles += taken;
    }
    r[15] = pc;
    core.N = nz < 0;
    core.Z = nz === 0;
    core.C = c !== 0;
    core.V = v < 0;
    return cycles;
  };
}
