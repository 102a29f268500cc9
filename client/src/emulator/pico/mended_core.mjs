// Mends what rp2040js 1.4.1 does otherwise than a Cortex-M0+.

/** Mends the core of the chip. */
export function mendCore(chip) {
  mendFlags(chip);
  mendVectors(chip);
}

/**
 * Calls `fault` where a word or half a word is read or written at an address that is not a multiple
 * of its size: rp2040js carries that out. Call it when the other models have taken their places.
 */
export function refuseMisaligned(core, fault) {
  const sizes = { readUint32: 4, writeUint32: 4, readUint16: 2, writeUint16: 2 };
  for (const [name, size] of Object.entries(sizes)) {
    const access = core[name].bind(core);
    core[name] = (address, value) => {
      if (address & (size - 1)) fault();
      return access(address, value);
    };
  }
}

// rp2040js folds the carry into the second operand. Where that makes 0x80000000 of 0x7fffffff, its
// overflow flag is wrong.
function mendFlags(chip) {
  const { core } = chip;
  const ADCS = 0b0100000101;
  const SBCS = 0b0100000110;
  const add = core.addUpdateFlags.bind(core);
  core.addUpdateFlags = (first, second) => {
    const result = add(first, second);
    if (second === 0x80000000 && chip.readUint16(core.PC - 2) >> 6 === ADCS) {
      const folded = core.registers[chip.readUint16(core.PC - 2) & 7] === 0x7fffffff;
      if (folded) core.V = !(first & 0x80000000);
    }
    return result;
  };
  const subtract = core.substractUpdateFlags.bind(core);
  core.substractUpdateFlags = (first, second) => {
    const result = subtract(first, second);
    if (second === 0x80000000 && chip.readUint16(core.PC - 2) >> 6 === SBCS) {
      const folded = core.registers[(chip.readUint16(core.PC - 2) >> 3) & 7] === 0x7fffffff;
      if (folded) core.V = !!(first & 0x80000000);
    }
    return result;
  };
}

// rp2040js leaves the mark of Thumb code, bit 0 of a vector, in the program counter: a jump table
// in a handler is then read a byte off.
function mendVectors({ core }) {
  const enter = core.exceptionEntry.bind(core);
  core.exceptionEntry = (number) => {
    enter(number);
    core.PC &= ~1;
  };
}
