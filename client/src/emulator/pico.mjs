// A Raspberry Pi Pico in rp2040js: its serial line, its pins, and the core cycle of each change.
//
// Usage: node pico.mjs RP2040JS-DIRECTORY IMAGE.uf2
//
// Standard input and output carry records of 8 bytes: what, a value, and the core cycle (48 bits,
// little-endian). In: 0 a byte for the serial line, 1 a level for a pin (its number, + 128 if high),
// not before that cycle. Out: 0 a byte of the serial line, 1 a pin's new level, 2 the time, 3 a byte
// of the log.
//
// rp2040js lets its PIO run free; here it keeps time: each enabled state machine executes when it is
// due, delays and clock divider counted. A counting loop is leapt over, and so is all time in which
// the core sleeps. While nothing is to be done at all, time runs no faster than on the wall.

import { readFileSync, writeSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [directory, imagePath, logAddress] = process.argv.slice(-3);
const { RP2040, LogLevel } = await import(pathToFileURL(`${directory}/dist/esm/index.js`));

const NANOS = 8;
const CYCLES_PER_BYTE = Math.round((125e6 * 10) / 115200);
const SLICE = 400_000;
const MILLISECOND = 125_000;
const FLASH = 0x10000000;
const VECTORS = 0x10000100;

// --- Records out ---------------------------------------------------------------------------------

const SERIAL = 0;
const PIN = 1;
const TIME = 2;
const LOG = 3;
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

// --- The chip ------------------------------------------------------------------------------------

const chip = new RP2040();
const { clock, core } = chip;
chip.logger = { debug() {}, info() {}, warn() {}, error: (from, what) => console.error(from, what) };

// rp2040js folds the carry into the second operand. Where that makes 0x80000000 of 0x7fffffff, its
// overflow flag is wrong.
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

/** Blocks of 512 bytes: three magic numbers, where the payload goes, how long it is. */
function load(image) {
  for (let block = 0; block < image.length; block += 512) {
    const target = image.readUInt32LE(block + 12) - FLASH;
    const size = image.readUInt32LE(block + 16);
    chip.flash.set(image.subarray(block + 32, block + 32 + size), target);
  }
}

load(readFileSync(imagePath));
core.VTOR = VECTORS;
core.SP = chip.readUint32(VECTORS);
core.PC = chip.readUint32(VECTORS + 4) & ~1;

/** The cycle at which what happens now happens, while a state machine executes. */
let stamp = -1;
const now = () => (stamp >= 0 ? stamp : Math.round(clock.nanosCounter / NANOS));

const INPUT = 2;
chip.gpio.forEach((pin, number) => {
  let last = 0;
  pin.addListener((level) => {
    if (level >= INPUT || level === last) return;
    last = level;
    report(PIN, number | (level << 7), now());
  });
});

const uart = chip.uart[0];
uart.onByte = (byte) => report(SERIAL, byte, now());

// --- Programmable input and output ---------------------------------------------------------------

const JUMP_WHILE_X = 0b000_00000_010_00000;
const JUMP_MASK = 0b111_00000_111_00000;
const machines = chip.pio.flatMap((pio) => pio.machines);
/** The earliest cycle at which a machine executes. */
let pioDue = Infinity;

function cyclesPerTick(machine) {
  return (machine.clockDivInt || 65536) + machine.clockDivFrac / 256;
}

function schedule() {
  pioDue = Infinity;
  for (const machine of machines) {
    if (machine.enabled && !machine.waiting && machine.due < pioDue) pioDue = machine.due;
  }
}

for (const machine of machines) {
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

for (const pio of chip.pio) {
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

const bytes = [];
const levels = [];
let byteDue = 0;
let rest = Buffer.alloc(0);

process.stdin.on('data', (data) => {
  rest = rest.length ? Buffer.concat([rest, data]) : data;
  let at = 0;
  for (; at + 8 <= rest.length; at += 8) {
    const entry = { value: rest[at + 1], cycle: rest.readUIntLE(at + 2, 6) };
    (rest[at] === SERIAL ? bytes : levels).push(entry);
  }
  rest = rest.subarray(at);
});
process.stdin.on('end', () => process.exit(0));

function inputDue() {
  const byte = bytes.length ? Math.max(byteDue, bytes[0].cycle) : Infinity;
  const level = levels.length ? levels[0].cycle : Infinity;
  return Math.min(byte, level);
}

function takeInput(cycle) {
  while (levels.length && levels[0].cycle <= cycle) {
    const { value } = levels.shift();
    chip.gpio[value & 0x7f].setInputValue(value >= 0x80);
  }
  if (bytes.length && uart.enabled && Math.max(byteDue, bytes[0].cycle) <= cycle) {
    uart.feedByte(bytes.shift().value);
    byteDue = cycle + CYCLES_PER_BYTE;
  }
}

// --- The log: SEGGER's real-time transfer, read where the image keeps it ---------------------------

const transfer = Number(logAddress);

function takeLog() {
  if (!transfer) return;
  const field = (offset) => chip.readUint32(transfer + offset);
  const [buffer, size, written] = [field(28), field(32), field(36)];
  let read = field(40);
  for (; size && read !== written; read = (read + 1) % size) {
    report(LOG, chip.readUint8(buffer + read), now());
  }
  chip.writeUint32(transfer + 40, read);
}

// --- Time ----------------------------------------------------------------------------------------

function pass(nanos) {
  const then = clock.nanosCounter + nanos;
  const alarm = clock.nextAlarm;
  if (alarm && alarm.nanos <= then) clock.tick(nanos);
  else clock.nanosCounter = then;
}

/** Runs for so many cycles. */
function run(cycles) {
  let cycle = now();
  const end = cycle + cycles;
  while (cycle < end) {
    if (core.waiting) {
      const alarm = clock.nextAlarm ? clock.nextAlarm.nanos / NANOS : Infinity;
      const due = Math.min(alarm, Math.ceil(pioDue), inputDue(), end);
      pass(Math.max(due - cycle, 0) * NANOS);
    } else {
      pass(core.executeInstruction() * NANOS);
    }
    cycle = now();
    if (pioDue <= cycle) catchUp(cycle);
    if (bytes.length || levels.length) takeInput(cycle);
  }
}

function idle() {
  return core.waiting && pioDue === Infinity && !bytes.length && !levels.length;
}

function turn() {
  const sleeps = idle();
  run(sleeps ? MILLISECOND : SLICE);
  takeLog();
  report(TIME, 0, now());
  flush();
  if (sleeps && idle()) setTimeout(turn, 1);
  else setImmediate(turn);
}

turn();
