// What a reset of the RP2040 leaves as it was, and how its boot ROM begins.
//
// Source: RP2040 data sheet, 2.8.1 and 2.8.2 (boot sequence), 2.12.8 (CHIP_RESET), 4.7 (watchdog),
// and the sources of the boot ROM. RAM outlives every reset but a loss of power. The boot ROM
// itself works in the last bytes of RAM: there lie its copy of the second stage, and its stack
// below it.

/** The kinds of reset. */
export const KIND = { POWER: 0, WATCHDOG: 1, RUN: 2 };

/** The watchdog's reasons. */
export const TIMED_OUT = 1;

const WATCHDOG = 0x40058;
const CHIP_RESET = 0x40064;
const PSM = 0x40010;
/** The core, among what the watchdog is allowed to reset. */
const CORE = 1 << 16;
const STAGE_2_BYTES = 256;
/** At least as much as the boot ROM's own code needs. */
const ROM_STACK_BYTES = 768;
const VECTOR_MAGIC = 0xb007c0d3;

/** Numbers without a pattern, the same in every run. */
function* garbage() {
  for (let state = 2463534242; ; ) {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    yield state & 0xff;
  }
}
const noise = garbage();

function spoil(bytes) {
  for (let at = 0; at < bytes.length; at++) bytes[at] = noise.next().value;
}

/** Whether the watchdog would reset the core: nothing is reset that has not been chosen. */
export function watchdogResets(chip) {
  return (chip.peripherals[PSM].wdsel & CORE) !== 0;
}

/** Makes `chip`, which is new, what such a reset makes of `before`, if there is one. */
export function carryOver(kind, before, chip) {
  const FLAGS = { [KIND.POWER]: 1 << 8, [KIND.RUN]: 1 << 16, [KIND.WATCHDOG]: 0 };
  const flags = FLAGS[kind] || before?.peripherals[CHIP_RESET].flags || 0;
  chip.peripherals[CHIP_RESET] = {
    flags,
    readUint32: (offset) => (offset === 8 ? flags : 0),
    writeUint32Atomic() {},
  };
  if (kind === KIND.POWER || !before) spoil(chip.sram);
  else chip.sram.set(before.sram);
  if (kind === KIND.WATCHDOG) {
    const { reason, scratchData } = before.peripherals[WATCHDOG];
    Object.assign(chip.peripherals[WATCHDOG], { reason, scratchData });
  }
}

/** The boot ROM begins: whether it goes on as the drive for an image, not with what is in flash. */
export function beginBoot(chip) {
  const end = chip.sram.length;
  const scratch = chip.peripherals[WATCHDOG].scratchData;
  const [magic, check, , entry] = scratch.subarray(4);
  const isVector = magic === VECTOR_MAGIC && ((entry ^ check) + VECTOR_MAGIC) >>> 0 === 0;
  if (isVector) {
    scratch[4] = 0;
    return true;
  }
  spoil(chip.sram.subarray(end - STAGE_2_BYTES - ROM_STACK_BYTES, end - STAGE_2_BYTES));
  chip.sram.set(chip.flash.subarray(0, STAGE_2_BYTES), end - STAGE_2_BYTES);
  return false;
}

/** The boot ROM restarts by the watchdog: with the image in flash, or at one of its own entries. */
export function restart(chip, entry, milliseconds) {
  const watchdog = chip.peripherals[WATCHDOG];
  chip.peripherals[PSM].wdsel = 0x1fffc;
  watchdog.writeUint32(0, 0);
  const scratch = watchdog.scratchData;
  if (entry) {
    scratch[4] = VECTOR_MAGIC;
    scratch[5] = entry ^ -VECTOR_MAGIC;
    scratch[6] = 0x20042000;
    scratch[7] = entry;
  } else scratch[4] = 0;
  watchdog.writeUint32(4, milliseconds * 1000);
  watchdog.writeUint32(0, 1 << 30);
}
