// Cycles of a Cortex-M0+ that rp2040js does not count.
//
// An exception takes 15 cycles from its request to the first instruction of its handler (Cortex-M0+
// Technical Reference Manual, 3.6.1). The manual does not say how long the return takes; here it
// takes as long as it must at least: 8 registers are read, and the fetch begins anew. Both are what
// memory without waiting costs. Of the registers that PUSH and POP move, the manual counts LR and
// PC, too, and rp2040js does not.

const ENTRY_CYCLES = 15;
/** Beside the two of BX, or those of POP. */
const RETURN_CYCLES = 10;
/** LR on the way in and PC on the way out. */
export const CALL_CYCLES = 2;
const POP = 0b1011110;

/** Adds them to the cycles for which the core of the chip waits: the field `stalled` of `waits`. */
export function countMissingCycles(chip, waits) {
  const { core } = chip;
  const enter = core.exceptionEntry.bind(core);
  core.exceptionEntry = (number) => {
    waits.stalled += ENTRY_CYCLES;
    enter(number);
  };
  const leave = core.exceptionReturn.bind(core);
  core.exceptionReturn = (to) => {
    waits.stalled += RETURN_CYCLES;
    leave(to);
  };
  const branch = core.BXWritePC.bind(core);
  core.BXWritePC = (address) => {
    if (chip.readUint16(core.PC - 2) >>> 9 === POP) waits.stalled += CALL_CYCLES;
    branch(address);
  };
}

