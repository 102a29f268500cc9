// A Raspberry Pi Pico in rp2040js: its serial line, its pins, and the core cycle of each change.
//
// It is longer than 500 lines, because what it adds to rp2040js shares one list of events in order
// of time; what stands alone is in the folder pico.
//
// Usage: node pico.mjs RP2040JS-DIRECTORY CORE.wasm IMAGE.uf2 LOG-ADDRESS BOARD, where CORE.wasm is
// the compiled package `penup-emulated-core` and BOARD is the JSON that process.rs makes of the
// board's row in the table.
//
// Standard input and output carry records of 8 bytes: what, a value, and the core cycle (48 bits,
// little-endian). In: 0 a byte for the serial line (its error bits in the cycle's place), 1 a level
// for a pin (its number, + 128 if high), not before that cycle; 2 the power goes at that cycle, 3
// it goes when so many more bytes of flash have been erased or written (the number in the cycle's
// place), and comes back at once; 4 the main loop hangs from that cycle on, 5 a byte for USB, 6 the
// USB host is plugged in (1), takes nothing more (2), takes again (3), suspends the bus (4),
// resumes it (5), is unplugged (6), is plugged in on a busy bus (7), has no power (8); 7 a switch
// is fitted to a pin, which closes where its axis has gone to so many steps (+ 2^40) or below, and
// bounces; 8 a function (its number, its address in the cycle's place) is timed; 9 how much of the
// stack is unused is asked; 10 where x has gone to so many steps, the main loop stands still for so
// many hundredths of a second, 11 and 12 how long a page of flash takes to be written and a sector
// to be erased, in microseconds (in the cycle's place), 13 a read of what is kept in flash returns
// garbage, after so many (in the cycle's place) from now on (0) or from the next reset on (1), 14
// how often that was read since the chip began is asked, 18 from now on the status is asked
// for at the serial line whenever a change of flash begins and no answer is awaited (1), or no
// longer (0). 32 the pin RUN is pulled low for a moment, 33 the image is copied onto the drive that
// the board shows with BOOTSEL held, 34 and 35 bits (the value) of a byte of flash (the cycle) stay
// low or high from now on, 36 the main loop goes on at an address, with the stack used up (1) or as
// it is (0), 37 the host opens the USB port (1) or closes it (0) at a rate (the cycle), 38 the host
// resets the bus so many times (the value) at random (a seed in the cycle's place), 48 the next
// setting of the clock's alarm is late by so many milliseconds, 49 from now on the longest handlers
// and masks of interrupts are measured (1), or told (0), 50 the times from each call of a function
// (its address in the cycle's place) to the next one are measured from now on, and told if they
// are at least so many hundredths of a millisecond. Out: 0 a byte of the serial line, 1 a
// pin's new level, 2 the time, 3 a byte of the log, 4 the chip was reset (0 by the loss of power, 1
// by the watchdog, 2 by the pin RUN), 5 a byte of USB, 6 a timed function has returned (its number,
// the cycles in the cycle's place), 7 so many bytes of the stack have not been used since the chip
// began (in the cycle's place), 32 the boot ROM shows its drive, 33 a character of the serial
// number that the USB host reads, after a 0, 34 flash has returned garbage, 35 the status was asked
// for at the serial line, and so many cycles later (in the cycle's place) the first byte of the
// answer (0) or all of it (1) had left, 36 so often what is kept in flash was read, 37 a recorded
// operation of the flash, an erasure (1) or a page (0), began at that cycle, 38 from which place it
// goes on (the upper 32 bits) and how many bytes it changes (the lower 16), 39 so many operations
// were recorded, 40 the longest cycles of an exception's handler (its number), 41 and for which an
// interrupt was masked (its number, 255 for all by PRIMASK, or 254 for all while the flash was
// changed), 42 all of these have been told, 43 for so many cycles in which the core was awake the
// function was not called, while the flash was changed (1) or not (0).
//
// rp2040js has no boot ROM: here is one, of the functions that the image asks for. Each is a
// breakpoint that this program serves. Flash takes as long as a Pico's.
//
// rp2040js lets its PIO run free; here it keeps time: each enabled state machine executes when it
// is due, delays and clock divider counted. A counting loop is leapt over, and so is all time in
// which the core sleeps. While nothing is to be done at all, time runs no faster than on the wall.

import { readFileSync, writeSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import { CallGaps } from './pico/call_gaps.mjs';
import { CALL_CYCLES, countMissingCycles } from './pico/core_cycles.mjs';
import { FlashPort } from './pico/flash_chip.mjs';
import { FlashRecord } from './pico/flash_record.mjs';
import { holdInReset } from './pico/held_in_reset.mjs';
import { InterruptTimes } from './pico/interrupt_times.mjs';
import { clearCountAtAbort } from './pico/aborted_dma.mjs';
import { joinQueues } from './pico/joined_queue.mjs';
import { delayAlarm } from './pico/late_alarm.mjs';
import { mendCore, refuseMisaligned } from './pico/mended_core.mjs';
import { QuickCore } from './pico/quick_core.mjs';
import * as resets from './pico/resets.mjs';
import { SlowContacts } from './pico/slow_contacts.mjs';
import { Uart } from './pico/uart.mjs';
import { Usb } from './pico/usb_host.mjs';
import { settled, wear } from './pico/worn_flash.mjs';

const [directory, corePath, imagePath, logAddress, boardText] = process.argv.slice(-5);
const board = JSON.parse(boardText);
const { RP2040 } = await import(pathToFileURL(`${directory}/dist/esm/index.js`));

const NANOS = 1e9 / board.clockHertz;
const SLICE = 400_000;
const MILLISECOND = board.clockHertz / 1000;
const HUNDREDTH = 10 * MILLISECOND;
const FLASH = board.flash;
const VECTORS = board.vectors;
/** The stack lies at its start. */
const RAM = board.ram;
/** What an unused byte of the stack holds. */
const PAINT = 0xa5;

// --- Records out ---------------------------------------------------------------------------------

const SERIAL = 0;
const PIN = 1;
const TIME = 2;
const LOG = 3;
const RESET = 4;
const CUT_POWER = 2;
const CUT_FLASH = 3;
const HANG = 4;
const USB = 5;
const USB_HOST = 6;
const SWITCH = 7;
const SWITCH_ZERO = 2 ** 40;
const TIMED = 8;
const RETURNED = 6;
const STACK = 9;
const STALL = 10;
const PAGE_TIME = 11;
const ERASE_TIME = 12;
const GARBLE = 13;
const GARBLED = 34;
const ANSWERED = 35;
const READS = 14;
const WERE_READ = 36;
const RECORD_FLASH = 15;
const BOOT_WITHIN = 16;
const BOOT_SCATTERED = 17;
const OPERATION_BEGAN = 37;
const OPERATION_CHANGES = 38;
const OPERATIONS = 39;
const ASK_IN_CHANGES = 18;
const GO_ON = -1;
const TIME_INTERRUPTS = 49;
const TIME_GAPS = 50;
const HANDLER_TOOK = 40;
const MASK_TOOK = 41;
const INTERRUPTS_END = 42;
const GAP = 43;
const DELAY_ALARM = 48;
/** Nanoseconds by which the next settings of the clock's alarm are late. */
const alarmDelays = [];
const UNUSED_STACK = 7;
const RUN_PIN = 32;
const UF2 = 33;
const STAYS_LOW = 34;
const STAYS_HIGH = 35;
const JUMP = 36;
const USB_LINE = 37;
const USB_RESETS = 38;
const BOOTSEL = 32;
const USB_SERIAL = 33;
const output = Buffer.alloc(1 << 16);
let filled = 0;

function flush() {
  let done = 0;
  while (done < filled) done += writeSync(1, output, done, filled - done);
  filled = 0;
}

function report(what, value, cycle) {
  if (filled === output.length) flush();
  output[filled] = what;
  output[filled + 1] = value;
  output.writeUIntLE(cycle, filled + 2, 6);
  filled += 8;
}

// --- The boot ROM --------------------------------------------------------------------------------

const CONNECT = 1;
const EXIT_MAPPING = 2;
const ERASE = 3;
const PROGRAM = 4;
const FLUSH_CACHE = 5;
const ENTER_MAPPING = 6;
const USB_BOOT = 7;
/** The breakpoints' numbers by the functions' codes. */
const FUNCTIONS = {
  IF: CONNECT, EX: EXIT_MAPPING, RE: ERASE, RP: PROGRAM, FC: FLUSH_CACHE, CX: ENTER_MAPPING,
  UB: USB_BOOT,
};
const LOOK_UP = 0x20;
const TABLE = 0x40;
const CODE = 0x80;
const FOR_EVER = 0x100;
const RETURN = 0x4770;
/** Where the boot ROM begins as a drive. */
const USB_BOOT_ENTRY = 0x2581;

/**
 * Laid out as the RP2040's: 16-bit pointers to a table of codes and functions, and to its search.
 */
function bootRom() {
  const rom = new Uint16Array(0x2000);
  rom[0x10 / 2] = 0x754d; // its mark
  rom[0x12 / 2] = 0x0201;
  rom[0x14 / 2] = TABLE;
  rom[0x18 / 2] = LOOK_UP | 1;
  // r2 = code of the entry; none left: 0; found: its function; else the next entry
  const search = [
    0x8802, 0x2a00, 0xd003, 0x428a, 0xd003, 0x3004, 0xe7f8, 0x2000, RETURN, 0x8840, RETURN,
  ];
  rom.set(search, LOOK_UP / 2);
  rom.set([0xbf30, 0xe7fd], FOR_EVER / 2); // sleep, and again
  Object.entries(FUNCTIONS).forEach(([name, number], index) => {
    const at = CODE + 4 * index;
    rom[at / 2] = 0xbe00 | number;
    // Who asks for the drive waits for the restart, with whatever interrupts are on.
    rom[at / 2 + 1] = number === USB_BOOT ? 0xe000 | (((FOR_EVER - at - 6) >> 1) & 0x7ff) : RETURN;
    rom[TABLE / 2 + 2 * index] = name.charCodeAt(0) | (name.charCodeAt(1) << 8);
    rom[TABLE / 2 + 2 * index + 1] = at | 1;
  });
  return new Uint32Array(rom.buffer);
}

/** Flash takes 45 ms to erase a sector typically, and 400 ms at most. */
let sectorMicroseconds = 45_000;
/** To write a page it takes 0.4 ms typically, and 3 ms at most. */
let pageMicroseconds = 400;
/** Whether the status is asked for at the serial line whenever a change of flash begins. */
let asksInChanges = false;
/** Bytes of flash until the power goes. */
let flashBudget = Infinity;
/** The core waits for the flash for so many nanoseconds. */
let flashNanos = 0;

class PowerCut extends Error {}

/** Changes bytes of flash, one by one. */
function changeFlash(from, count, change) {
  for (let at = from; at < from + count; at++) {
    if (flashBudget-- <= 0) throw new PowerCut();
    chip.flash[at] = settled(at, change(at, chip.flash[at]));
  }
}

/** What is done to the flash. */
const flashRecord = new FlashRecord();

/** A change of flash begins: it is recorded, and the status may be asked for. */
function noteFlash(isErasure, from, count, microseconds, change) {
  if (asksInChanges && asked === null && answeredFor === null) {
    cable.bytes.push({ value: QUESTION, errors: 0 });
    uart.listen();
  }
  const [begins, lasts] = [now() + flashNanos / NANOS, (microseconds * 1000) / NANOS];
  flashRecord.note(isErasure, from, count, Math.round(begins), lasts, chip.flash, change);
}

/** Ends the record, and tells what was done. */
function tellFlashRecord() {
  flashRecord.end();
  for (const { isErasure, start, cycle, changes } of flashRecord.operations) {
    report(OPERATION_BEGAN, isErasure ? 1 : 0, Math.round(cycle));
    report(OPERATION_CHANGES, 0, start * 2 ** 16 + changes.length);
  }
  report(OPERATIONS, 0, flashRecord.operations.length);
}

/** The power comes back, and finds the flash as it was within a recorded operation. */
function bootWithin({ what, value, number, low }) {
  const flash =
    what === BOOT_WITHIN
      ? flashRecord.flashWithin(number, low, value)
      : flashRecord.flashScattered(number, value, low);
  chip.flash.set(flash);
  cutPower();
}

function serveRom(number) {
  const [first, second, third] = core.registers;
  if (number === ERASE) {
    const erase = () => 0xff;
    flashPort.beginErasure(first, second);
    noteFlash(true, first, second, sectorMicroseconds, erase);
    changeFlash(first, second, erase);
    flashNanos += (second / 4096) * sectorMicroseconds * 1000;
  } else if (number === CONNECT) {
    flashPort.connect();
  } else if (number === EXIT_MAPPING) {
    flashPort.exitMapping();
  } else if (number === ENTER_MAPPING) {
    flashPort.enterMapping();
  } else if (number === FLUSH_CACHE) {
    quick.flush();
    flashPort.releaseSelect();
  } else if (number === PROGRAM) {
    flashPort.beginPages(first, third);
    const write = (at, before) => before & chip.readUint8(second + at - first);
    noteFlash(false, first, third, pageMicroseconds, write);
    changeFlash(first, third, write);
    flashNanos += (third / 256) * pageMicroseconds * 1000;
  } else if (number === USB_BOOT) {
    const { scratchData } = chip.peripherals[WATCHDOG];
    scratchData.set([first, second]);
    resets.restart(chip, USB_BOOT_ENTRY, 10);
  }
}

// --- The chip ------------------------------------------------------------------------------------

const quick = new QuickCore(readFileSync(corePath), CALL_CYCLES);
let chip, clock, core, uart, machines, contacts, flashPort;
/** The cycle at which what happens now happens, while a state machine executes. */
let stamp = -1;
/** Cycles before the chip was last reset. */
let cyclesBefore = 0;
const now = () => (stamp >= 0 ? stamp : cyclesBefore + Math.round(clock.nanosCounter / NANOS));

/** Puts an image into flash: blocks of 512 bytes that say where they go, and how long they are. */
function flashImage(image, flash) {
  for (let block = 0; block < image.length; block += 512) {
    const target = image.readUInt32LE(block + 12) - FLASH;
    const size = image.readUInt32LE(block + 16);
    flash.set(image.subarray(block + 32, block + 32 + size), target);
  }
}

const QUESTION = '?'.charCodeAt(0);
const ANSWER = '<'.charCodeAt(0);
const NEWLINE = '\n'.charCodeAt(0);
/** When the status was asked for that has not been answered, or null. */
let asked = null;
/** The same while the answer leaves. */
let answeredFor = null;

/** A byte has left at the serial line. */
function tell(byte) {
  report(SERIAL, byte, now());
  if (byte === NEWLINE && answeredFor !== null) {
    report(ANSWERED, 1, now() - answeredFor);
    answeredFor = null;
  }
  if (byte !== ANSWER || asked === null) return;
  report(ANSWERED, 0, now() - asked);
  answeredFor = asked;
  asked = null;
}

/** After how many reads flash returns garbage from the next reset on. */
let garbleNext = Infinity;

/** A chip that begins with this flash, after such a reset. */
function start(flash, kind) {
  quick.garble(board.kept, garbleNext);
  garbleNext = Infinity;
  stamp = -1;
  cyclesBefore = clock ? now() : 0;
  const before = chip;
  chip = new RP2040();
  ({ clock, core } = chip);
  chip.logger = { debug() {}, info() {}, warn, error: (from, what) => console.error(from, what) };
  // This erases the flash that the chip then has.
  chip.loadBootrom(bootRom());
  quick.attach(chip);
  resets.carryOver(kind, before, chip);
  chip.flash.set(flash);
  chip.onBreak = serveRom;
  core.VTOR = VECTORS;
  core.SP = chip.readUint32(VECTORS);
  core.PC = chip.readUint32(VECTORS + 4) & ~1;
  if (resets.beginBoot(chip)) {
    core.PC = FOR_EVER;
    core.PM = true;
    report(BOOTSEL, 0, now());
  } else for (let at = RAM; at < core.SP; at++) chip.writeUint8(at, PAINT);
  mendCore(chip);
  faultDue = isLockedUp = false;
  countMissingCycles(chip, quick);
  refuseMisaligned(core, () => {
    faultDue = true;
  });
  contacts = new SlowContacts(chip, CONTACTS, now, (pin, cycle) => {
    bounces.push({ pin, cycle });
    bounces.sort((one, other) => one.cycle - other.cycle);
    disturbed = true;
  });
  delayAlarm(chip, () => alarmDelays.shift() ?? 0, pass);
  watchPins();
  asked = answeredFor = null;
  uart = new Uart(chip, cable, tell, (byte) => {
    if (byte === QUESTION) asked ??= now();
  });
  machines = chip.pio.flatMap((pio) => pio.machines);
  clearCountAtAbort(chip.dma.channels);
  chip.pio.forEach(joinQueues);
  machines.forEach(followQueue);
  chip.pio.forEach(followPio);
  schedule();
  usb.attach(chip);
  flashPort = new FlashPort(chip);
  holdInReset(chip);
  interruptTimes?.attach(core);
  callGaps?.begin();
  const watchdog = chip.peripherals[WATCHDOG];
  watchdog.onWatchdogTrigger = () => {
    // Or its alarm would come again at once, for ever.
    watchdog.alarm.enable = false;
    watchdogDue = true;
    disturbed = true;
  };
}

function unusedStack() {
  const end = chip.flashView.getUint32(VECTORS - FLASH, true);
  let at = RAM;
  while (at < end && chip.readUint8(at) === PAINT) at++;
  return at - RAM;
}

// --- The USB host --------------------------------------------------------------------------------

const usb = new Usb({
  byte: (byte) => report(USB, byte, now()),
  serialNumber(text) {
    for (const byte of [0, ...Buffer.from(text)]) report(USB_SERIAL, byte, now());
  },
});

// --- Resets --------------------------------------------------------------------------------------

const WATCHDOG = 0x40058;
let watchdogDue = false;

/** The watchdog resets what it was allowed to. */
function resetByWatchdog() {
  watchdogDue = false;
  if (!resets.watchdogResets(chip)) return;
  report(RESET, resets.KIND.WATCHDOG, now());
  start(chip.flash, resets.KIND.WATCHDOG);
}

/** All that was on its way is gone. */
function resetByHand(kind) {
  flashBudget = Infinity;
  flashNanos = 0;
  cable.bytes.length = 0;
  usb.bytes.length = 0;
  report(RESET, kind, now());
  start(chip.flash, kind);
}

function cutPower() {
  resetByHand(resets.KIND.POWER);
}

/**
 * With BOOTSEL held the boot ROM shows a drive; it restarts by the watchdog once an image is there.
 */
function copyImage() {
  cutPower();
  core.PC = FOR_EVER;
  core.PM = true;
  core.waiting = false;
  report(BOOTSEL, 0, now());
  flashImage(readFileSync(imagePath), chip.flash);
  resets.restart(chip, 0, 1000);
}

/** What the core has just done is a fault. */
let faultDue = false;
/** A fault in the handler of faults: only a reset helps. */
let isLockedUp = false;

/** rp2040js only warns of what is a fault on the chip: no such address, no such instruction. */
function warn(_, what) {
  if (/invalid memory address|undefined address|is not implemented yet/.test(what)) faultDue = true;
}

function takeFault() {
  const HARD_FAULT = 3;
  if (core.IPSR === HARD_FAULT) isLockedUp = true;
  else core.exceptionEntry(HARD_FAULT);
  // What finds no place on the stack is lost.
  faultDue = false;
}

const INPUT = 2;
/** What the inputs are driven to; open ones are pulled up. */
const inputs = new Map();

/** The pins of the limit switches and of the emergency stop. */
const CONTACTS = board.contacts;
const BOUNCE = 5 * MILLISECOND;
const TURNS = 16;
/** Where the axes have gone to, in steps. */
const places = [0, 0];
/** Of each axis: its pin, where it closes, whether it is closed. */
const switches = [null, null];
/** Levels of switches that bounce, the next one first. */
const bounces = [];

function moveAxis(axis, level) {
  if (!level) return;
  places[axis] += chip.gpio[board.directions[axis]].value === 1 ? 1 : -1;
  lookAtSwitch(axis);
  if (stalls.length && axis === 0 && places[0] === stalls[0].place) {
      stall(stalls.shift().hundredths);
    }
}

/** Where along x the main loop is to stand still, the next place first. */
const stalls = [];
/** Where the main loop was when it was made to hang. */
let hungAt = 0;
/** Where it is made to go on. */
let jumpTo = 0;
/** What decides when the USB host resets the bus. */
const resetSeeds = [];

function stall(hundredths) {
  const cycle = now();
  events.push(
    { what: HANG, value: 0, cycle },
    { what: GO_ON, value: 0, cycle: cycle + hundredths * HUNDREDTH },
  );
  disturbed = true;
}

function lookAtSwitch(axis) {
  const fitted = switches[axis];
  if (!fitted || places[axis] <= fitted.at === fitted.closed) return;
  fitted.closed = !fitted.closed;
  disturbed = true;
  const { pin, closed } = fitted;
  for (let turn = 0; turn <= TURNS; turn++) {
    const cycle = now() + Math.round((turn * BOUNCE) / TURNS);
      bounces.push({ pin, high: !closed !== (turn % 2 === 1), cycle });
  }
  bounces.sort((one, other) => one.cycle - other.cycle);
}

function watchPins() {
  chip.gpio.forEach((pin, number) => {
    let last = 0;
    pin.addListener((level) => {
      if (level >= INPUT || level === last) return;
      last = level;
      const axis = board.steps.indexOf(number);
      if (axis >= 0) moveAxis(axis, level);
      report(PIN, number | (level << 7), now());
    });
    setLevel(number);
  });
}

// --- Programmable input and output ---------------------------------------------------------------

const JUMP_WHILE_X = 0b000_00000_010_00000;
const JUMP_MASK = 0b111_00000_111_00000;
/** The earliest cycle at which a machine executes. */
let pioDue = Infinity;

function cyclesPerTick(machine) {
  return (machine.clockDivInt || 65536) + machine.clockDivFrac / 256;
}

function schedule() {
  disturbed = true;
  pioDue = Infinity;
  for (const machine of machines) {
    if (machine.enabled && !machine.waiting && machine.due < pioDue) pioDue = machine.due;
  }
}

function followQueue(machine) {
  machine.due = 0;
  const writeFifo = machine.writeFIFO.bind(machine);
  machine.writeFIFO = (value) => {
    const slept = machine.enabled && machine.waiting;
    writeFifo(value);
    if (slept && !machine.waiting) {
      // What it waited in is done in the next cycle.
      machine.due = now() + (1 + Math.max(machine.waitDelay, 0)) * cyclesPerTick(machine);
      schedule();
    }
  };
}

function followPio(pio) {
  pio.run = () => {};
  const write = pio.writeUint32.bind(pio);
  pio.writeUint32 = (offset, value) => {
    catchUp(now());
    const enabled = pio.machines.map((machine) => machine.enabled);
    write(offset, value);
    pio.machines.forEach((machine, index) => {
      if (machine.enabled && !enabled[index]) machine.due = now() + 1;
    });
    pio.checkChangedPins();
    schedule();
  };
}

function execute(machine) {
  const opcode = machine.pio.instructions[machine.pc];
  const tick = cyclesPerTick(machine);
  if ((opcode & JUMP_MASK) === JUMP_WHILE_X && (opcode & 0x1f) === machine.pc && machine.x > 0) {
    machine.due += machine.x * (1 + ((opcode >> 8) & 0x1f)) * tick;
    machine.x = 0;
    return;
  }
  const before = machine.cycles;
  machine.step();
  machine.due += (machine.cycles - before) * tick;
}

/** Lets the state machines do what is due up to `cycle`. */
function catchUp(cycle) {
  while (pioDue <= cycle) {
    stamp = Math.floor(pioDue);
    for (const machine of machines) {
      if (machine.enabled && !machine.waiting && machine.due <= pioDue) {
        execute(machine);
        machine.pio.checkChangedPins();
      }
    }
    stamp = -1;
    schedule();
  }
}

// --- Records in ----------------------------------------------------------------------------------

/** The serial line: whether something is connected, and the bytes that come. */
const cable = { connected: false, bytes: [] };
/** Levels of pins and losses of power, in their order. */
const events = [];
let rest = Buffer.alloc(0);

process.stdin.on('data', (data) => {
  rest = rest.length ? Buffer.concat([rest, data]) : data;
  let at = 0;
  for (; at + 8 <= rest.length; at += 8) {
    const entry = { value: rest[at + 1], cycle: rest.readUIntLE(at + 2, 6) };
    if (rest[at] === SERIAL) cable.bytes.push({ value: entry.value, errors: entry.cycle });
    else if (rest[at] === PAGE_TIME) pageMicroseconds = entry.cycle;
    else if (rest[at] === ERASE_TIME) sectorMicroseconds = entry.cycle;
    else if (rest[at] === ASK_IN_CHANGES) asksInChanges = entry.value !== 0;
    else if (rest[at] === GARBLE) {
      if (entry.value) garbleNext = entry.cycle;
      else quick.garble(board.kept, entry.cycle);
    } else if (rest[at] === READS) report(WERE_READ, 0, quick.reads);
    else if (rest[at] === TIMED) timeFunction(entry.cycle, entry.value);
    else if (rest[at] === SWITCH) {
      const axis = CONTACTS.indexOf(entry.value);
      switches[axis] = { pin: entry.value, at: entry.cycle - SWITCH_ZERO, closed: false };
      lookAtSwitch(axis);
    } else if (rest[at] === USB) usb.send(entry.value);
    else if (rest[at] === USB_LINE) usb.setLine(entry.cycle, entry.value !== 0);
    else if (rest[at] === STACK) report(UNUSED_STACK, 0, unusedStack());
    else if (rest[at] === DELAY_ALARM) alarmDelays.push(entry.value * 1e6);
    else if (rest[at] === STALL) stalls.push({ place: entry.cycle, hundredths: entry.value });
    else if (rest[at] === CUT_FLASH) flashBudget = entry.cycle;
    else if (rest[at] === RECORD_FLASH) {
      if (entry.value) flashRecord.begin(chip.flash);
      else tellFlashRecord();
    } else if (rest[at] === BOOT_WITHIN || rest[at] === BOOT_SCATTERED) {
      const [number, low] = [Math.floor(entry.cycle / 2 ** 24), entry.cycle % 2 ** 24];
      bootWithin({ what: rest[at], value: entry.value, number, low });
    }
    else if (rest[at] === STAYS_LOW) wear(entry.cycle, entry.value, false);
    else if (rest[at] === STAYS_HIGH) wear(entry.cycle, entry.value, true);
    else if (rest[at] === TIME_INTERRUPTS) {
      if (entry.value) timeInterrupts();
      else tellInterruptTimes();
    } else if (rest[at] === TIME_GAPS) timeGaps(entry.cycle, entry.value);
    else if (rest[at] === USB_RESETS) {
      resetSeeds.push(entry.cycle);
      events.push({ what: USB_RESETS, value: entry.value, cycle: 0 });
    } else if (rest[at] === JUMP) {
      jumpTo = entry.cycle & ~1;
      events.push({ what: JUMP, value: entry.value, cycle: 0 });
    }
    else events.push({ what: rest[at], ...entry });
  }
  rest = rest.subarray(at);
  uart.listen();
  usb.offer();
});
process.stdin.on('end', () => process.exit(0));

function inputDue() {
  const bounce = bounces.length ? bounces[0].cycle : Infinity;
  return Math.min(bounce, events.length ? events[0].cycle : Infinity);
}

function setInput(number, high) {
  inputs.set(number, high);
  setLevel(number);
}

/** A pin takes the level to which it is driven, once it can. */
function setLevel(number) {
  chip.gpio[number].setInputValue((inputs.get(number) ?? true) && contacts.hasRisen(number, now()));
}

/** How often the core has waited for the flash. */
let flashWaits = 0;
/** The longest handlers and masks of interrupts, once they are measured. */
let interruptTimes = null;

function timeInterrupts() {
  if (interruptTimes) {
    interruptTimes.forget();
    return;
  }
  interruptTimes = new InterruptTimes(now, () => flashWaits);
  interruptTimes.attach(core);
}

function tellInterruptTimes() {
  for (const [number, cycles] of interruptTimes.handlers) report(HANDLER_TOOK, number, cycles);
  for (const [number, cycles] of interruptTimes.masks) report(MASK_TOOK, number, cycles);
  report(INTERRUPTS_END, 0, 0);
}

/** The times between the calls of a function, once they are measured. */
let callGaps = null;
/** The cycles for which the core has slept. */
let slept = 0;

function timeGaps(address, hundredths) {
  if (callGaps) quick.mark(callGaps.address, false);
  quick.mark(address, true);
  const least = (hundredths * MILLISECOND) / 100;
  callGaps = new CallGaps(address, least, () => now() - slept, () => flashWaits);
}

function tellGap() {
  const gap = callGaps.call();
  if (gap) report(GAP, gap.changesFlash ? 1 : 0, gap.cycles);
}

/** In a handler, or where it has masked them all, nothing is done to the main loop. */
function waitsForMainLoop(what) {
  return (what === HANG || what === GO_ON || what === JUMP) && (core.IPSR !== 0 || core.PM);
}

function takeInput(cycle) {
  while (bounces.length && bounces[0].cycle <= cycle) {
    const { pin, high } = bounces.shift();
    // One without a level has risen.
    setInput(pin, high ?? inputs.get(pin) ?? true);
  }
  while (events.length && events[0].cycle <= cycle && !waitsForMainLoop(events[0].what)) {
    const { what, value } = events.shift();
    if (what === CUT_POWER) return cutPower();
    if (what === RUN_PIN) return resetByHand(resets.KIND.RUN);
    if (what === UF2) return copyImage();
    if (what === JUMP) {
      core.PC = jumpTo;
      if (value) core.SP = RAM + 8;
      core.waiting = false;
      continue;
    }
    if (what === HANG || what === GO_ON) {
      if (what === HANG) hungAt = core.PC;
      core.PC = what === HANG ? FOR_EVER : hungAt;
      core.waiting = false;
      continue;
    }
    if (what === USB_HOST) {
      usb.act(value);
      continue;
    }
    if (what === USB_RESETS) {
      usb.storm(value, resetSeeds.shift() ?? 0);
      continue;
    }
    setInput(value & 0x7f, value >= 0x80);
  }
}

// --- The log: SEGGER's real-time transfer, read where the image keeps it -------------------------

const transfer = Number(logAddress);

function takeLog() {
  if (!transfer) return;
  const field = (offset) => chip.readUint32(transfer + offset);
  const [buffer, size, written] = [field(28), field(32), field(36)];
  let read = field(40);
  // Until the program has begun, anything lies there.
  const SEGG = 0x47474553;
  if (field(0) !== SEGG || size > 1 << 16 || written >= size || read >= size) return;
  for (; size && read !== written; read = (read + 1) % size) {
    report(LOG, chip.readUint8(buffer + read), now());
  }
  chip.writeUint32(transfer + 40, read);
}

// --- Functions that are timed --------------------------------------------------------------------

/** Their numbers, by address. */
const timed = new Map();
/** Those that have been called, and where each returns to. */
const calls = [];

function timeFunction(address, number) {
  quick.mark(address, true);
  timed.set(address, number);
}

/** Before each instruction that has a mark. */
function timeFunctions() {
  const last = calls.at(-1);
  if (last && core.PC === last.returnsTo && core.SP === last.stack) {
    calls.pop();
    quick.mark(last.returnsTo, false);
    report(RETURNED, last.number, now() - last.began);
  }
  const number = timed.get(core.PC);
  if (number === undefined) return;
  const returnsTo = core.LR & ~1;
  quick.mark(returnsTo, true);
  calls.push({ number, returnsTo, stack: core.SP, began: now() });
}

// --- Time ----------------------------------------------------------------------------------------

function pass(nanos) {
  const then = clock.nanosCounter + nanos;
  const alarm = clock.nextAlarm;
  if (alarm && alarm.nanos <= then) clock.tick(nanos);
  else clock.nanosCounter = then;
}

/** The core stands, all else goes on. */
function waitForFlash() {
  const end = now() + flashNanos / NANOS;
  flashNanos = 0;
  flashWaits++;
  for (let cycle = now(); cycle < end; cycle = now()) {
    const alarm = clock.nextAlarm ? cyclesBefore + clock.nextAlarm.nanos / NANOS : Infinity;
    pass(Math.max(Math.min(alarm, Math.ceil(pioDue), end) - cycle, 0) * NANOS);
    if (pioDue <= now()) catchUp(now());
  }
}

/** Something may be due earlier than it was. */
let disturbed = false;

/**
 * The core executes, an instruction at least, until it sleeps, something is due or it has
 * disturbed what is.
 */
function executeUntil(due) {
  // From when on `now` is so much.
  const nanos = (due - 0.5 - cyclesBefore) * NANOS;
  disturbed = false;
  do {
    if (core.interruptsUpdated && core.checkForInterrupts()) core.waiting = false;
    const alarm = clock.nextAlarm ? clock.nextAlarm.nanos : Infinity;
    // While flash is not mapped, rp2040js executes all: each of its reads is watched.
    const most = flashPort.isMapped ? (Math.min(alarm, nanos) - clock.nanosCounter) / NANOS : 0;
    const cycles = quick.run(most);
    if (quick.takeGarbled()) report(GARBLED, 0, now());
    if (cycles !== 0) {
      pass(cycles * NANOS);
      continue;
    }
    // The core is at an instruction for which quick execution is not meant.
    quick.fetch(core.registers[15]);
    if (quick.stalled !== 0) {
      // Time may bring something before the core goes on.
      const { stalled } = quick;
      quick.stalled = 0;
      pass(stalled * NANOS);
      continue;
    }
    if (timed.size) timeFunctions();
    if (callGaps?.address === core.PC) tellGap();
    pass(core.executeInstruction() * NANOS);
    if (faultDue) takeFault();
    if (flashNanos) waitForFlash();
  } while (clock.nanosCounter < nanos && !core.waiting && !disturbed && !isLockedUp);
}

/** Runs for so many cycles. */
function run(cycles) {
  let cycle = now();
  const end = cycle + cycles;
  while (cycle < end) {
    const due = Math.min(Math.ceil(pioDue), inputDue(), end);
    if (core.waiting || isLockedUp) {
      const alarm = clock.nextAlarm ? cyclesBefore + clock.nextAlarm.nanos / NANOS : Infinity;
      pass(Math.max(Math.min(alarm, due) - cycle, 0) * NANOS);
      slept += now() - cycle;
    } else executeUntil(due);
    cycle = now();
    if (pioDue <= cycle) catchUp(cycle);
    if (events.length || bounces.length) takeInput(cycle);
    if (watchdogDue) resetByWatchdog();
  }
}

function idle() {
  return core.waiting && pioDue === Infinity && !uart.busy && !events.length && !bounces.length;
}

/** Ends the emulation. A model says all in its message; any other error is a mistake in here. */
function end(error) {
  takeLog();
  flush();
  console.error(error.constructor === Error ? `the emulation ends: ${error.message}` : error);
  process.exit(1);
}

function turn() {
  const sleeps = idle();
  try {
    run(sleeps ? MILLISECOND : SLICE);
  } catch (error) {
    if (!(error instanceof PowerCut)) end(error);
    cutPower();
  }
  takeLog();
  report(TIME, 0, now());
  flush();
  if (sleeps && idle()) setTimeout(turn, 1);
  else setImmediate(turn);
}

const blank = new Uint8Array(16 << 20).fill(0xff);
flashImage(readFileSync(imagePath), blank);
start(blank, resets.KIND.POWER);
turn();
