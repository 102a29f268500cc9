//! Tests the part of the emulated Pico that executes most instructions, beside the interpreter of
//! rp2040js: random ones, with random registers, in RAM and in flash.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::path::Path;
use std::process::Command;

/// The instructions that are compared.
const CASES: u32 = 50_000;
/// The least number of them that are not left to rp2040js: most of what a program consists of.
const LEAST_EXECUTED: u32 = 25_000;

/// Compares the two, and prints how many instructions both have executed.
const COMPARE: &str = "
import { readFileSync } from 'node:fs';
const [directory, models, wasm, cases, seed] = process.argv.slice(-5);
const { RP2040 } = await import(`file://${directory}/dist/esm/index.js`);
const { CALL_CYCLES, countMissingCycles } = await import(`file://${models}/core_cycles.mjs`);
const { mendCore, refuseMisaligned } = await import(`file://${models}/mended_core.mjs`);
const { QuickCore } = await import(`file://${models}/quick_core.mjs`);
const RAM = 0x20000000, FLASH = 0x10000000, CODE = RAM + 0x2000, BLX_LR = 0x47f0;
let state = BigInt(seed);
function random(below) {
  state = (state * 6364136223846793005n + 1442695040888963407n) & 0xffffffffffffffffn;
  return Number((state >> 32n) % BigInt(below));
}
function machine() {
  const chip = new RP2040();
  chip.logger = { debug() {}, info() {}, warn() {}, error() {} };
  const quick = new QuickCore(readFileSync(wasm), CALL_CYCLES);
  quick.attach(chip);
  mendCore(chip);
  countMissingCycles(chip, quick);
  return { chip, core: chip.core, quick };
}
const fast = machine(), slow = machine();
for (let at = 0; at < 1 << 14; at++) {
  const byte = random(256);
  for (const { chip } of [fast, slow]) chip.flash[at] = chip.sram[at] = byte;
}
// Numbers at the ends of their range, small ones, and addresses.
function number() {
  const small = random(40);
  const wide = random(0x100000000);
  return [small, -small >>> 0, 0x80000000, 0x7fffffff, wide, RAM + 0x800 + random(4096),
    RAM + 0x800 + 4 * random(1024), FLASH + 4 * random(1024), 0xd0000000, 0xd0000060,
    0x40054000][random(11)];
}
// The bit that is shifted out last, to the left, to the right, and to the right with the sign.
function shiftedOut(shift, value, by) {
  const wide = shift === 2 ? BigInt(value | 0) : BigInt(value);
  return ((shift === 0 ? (wide << BigInt(by)) >> 32n : wide >> BigInt(by - 1)) & 1n) === 1n;
}
let executed = 0;
for (let count = 0; count < Number(cases); count++) {
  const inFlash = random(2) === 1;
  const pc = inFlash ? FLASH + 0x2000 + 8 * random(64) : CODE + 2 * random(64);
  const isCall = random(8) === 0;
  // Barriers, and what reads the mask of interrupts and other special registers.
  const isSystem = random(32) === 0;
  const op = isSystem
    ? [[0xf3bf, 0x8f00 | random(256)],
      [0xf3ef, 0x8000 | (random(8) << 8) | 16 * random(2)]][random(2)]
    : [isCall ? 0xf000 | random(0x800) : random(0x10000),
      isCall ? 0xd000 | random(0x1000) | (random(2) << 13) : random(0x10000)];
  const isMasked = random(2) === 1;
  const registers = Array.from({ length: 13 }, number);
  const flags = Array.from({ length: 4 }, () => random(2) === 1);
  // No result is negative and zero.
  if (flags[0]) flags[1] = false;
  for (const { chip, core, quick } of [fast, slow]) {
    op.forEach((half, index) => {
      const at = pc - (inFlash ? FLASH : RAM) + 2 * index;
      (inFlash ? chip.flashView : chip.sramView).setUint16(at, half, true);
    });
    core.registers.set([...registers, RAM + 0x1000, 0x10000101, pc]);
    [core.N, core.Z, core.C, core.V, core.PM] = [...flags, isMasked];
    quick.fetch(pc);
    quick.stalled = 0;
  }
  const divider = ({ divDividend, divDivisor, divQuotient, divRemainder, divCSR }) =>
    [divDividend, divDivisor, divQuotient, divRemainder, divCSR];
  const shown = ({ chip, core, quick }, cycles) =>
    [...core.registers, core.N, core.Z, core.C, core.V, core.PM, ...divider(chip.sio),
      cycles + quick.stalled].join(' ');
  const before = shown(fast, 0);
  const cycles = fast.quick.run(1);
  if (cycles === 0) {
    if (shown(fast, 0) !== before) throw new Error(`${op}: something was done`);
    continue;
  }
  executed++;
  // rp2040js overwrites the register before it reads where to go.
  if (op[0] === BLX_LR) {
    if (fast.core.registers[15] !== 0x10000100) throw new Error('BLX LR goes elsewhere');
    continue;
  }
  const [value, by] = [registers[op[0] & 7], registers[(op[0] >> 3) & 7] & 0xff];
  const slowly = slow.core.executeInstruction();
  // rp2040js takes a wrong carry where a register shifts by 0 or by more than 32.
  const shift = [2, 3, 4].indexOf((op[0] >> 6) - 0x100);
  if (shift >= 0) slow.core.C = by === 0 ? flags[2] : shiftedOut(shift, value, by);
  const expected = shown(slow, slowly);
  if (shown(fast, cycles) !== expected) {
    throw new Error(`${op.map((half) => half.toString(16))}\\n${before}\\n` +
      `${shown(fast, cycles)}\\n${expected}`);
  }
  if (Buffer.compare(fast.chip.sram, slow.chip.sram)) throw new Error(`${op}: memory differs`);
}
let faults = 0;
refuseMisaligned(slow.core, () => faults++);
const LDR = 0x6808, LDRH = 0x8808, STR = 0x6008, STRH = 0x8008, LDRB = 0x7808;
for (const [op, by, expected] of [[LDR, 2, 1], [LDR, 4, 0], [STR, 1, 1], [STRH, 1, 1],
  [LDRH, 1, 1], [LDRH, 2, 0], [LDRB, 1, 0]]) {
  faults = 0;
  slow.chip.sramView.setUint16(CODE - RAM, op, true);
  slow.core.registers.set([0, RAM + 0x800 + by]);
  slow.core.registers[15] = CODE;
  slow.core.executeInstruction();
  if (faults !== expected) throw new Error(`${op} at ${by}: ${faults} faults`);
}
console.log(executed);
";

#[test]
fn each_instruction_does_what_it_does_in_rp2040js() -> Result<(), Box<dyn Error>> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    for seed in [1, 2103] {
        let node = Command::new("node")
            .args(["--input-type=module", "--eval", COMPARE, "--"])
            .arg(project.join("target/rp2040js/node_modules/rp2040js"))
            .arg(project.join("client/src/emulator/pico"))
            .arg(project.join("target/wasm32-unknown-unknown/release/penup_emulated_core.wasm"))
            .args([CASES.to_string(), seed.to_string()])
            .output()?;
        assert!(node.status.success(), "{}", String::from_utf8_lossy(&node.stderr));
        let executed: u32 = String::from_utf8(node.stdout)?.trim().parse()?;
        assert!(executed > LEAST_EXECUTED, "{executed}");
    }
    Ok(())
}
