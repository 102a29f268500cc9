// Executes instructions for rp2040js, cycle by cycle as it would, twice as fast: it finds out by some eighty comparisons
// which instruction it meets, here a table tells. The rare ones, and what is neither in RAM nor in flash, are left to it.
//
// One program with pico.mjs, which follows.

const FLASH = 0x10000000;
/** The stack lies at its start. */
const RAM = 0x20000000;

/** What an opcode is: ARMv6-M Architecture Reference Manual, A5.2. */
const KINDS = new Uint8Array(1 << 16);

/** The number of the instruction whose opcodes begin with these bits. */
function kind(bits) {
  const rest = 16 - bits.length;
  const first = parseInt(bits, 2) << rest;
  KINDS.fill(++kind.last, first, first + (1 << rest));
  return kind.last;
}
kind.last = 0;

const LSL_IMMEDIATE = kind('00000');
const LSR_IMMEDIATE = kind('00001');
const ASR_IMMEDIATE = kind('00010');
const ADD_REGISTER = kind('0001100');
const SUB_REGISTER = kind('0001101');
const ADD_3 = kind('0001110');
const SUB_3 = kind('0001111');
const MOV_IMMEDIATE = kind('00100');
const CMP_IMMEDIATE = kind('00101');
const ADD_8 = kind('00110');
const SUB_8 = kind('00111');
const AND = kind('0100000000');
const EOR = kind('0100000001');
const LSL = kind('0100000010');
const LSR = kind('0100000011');
const ADC = kind('0100000101');
const SBC = kind('0100000110');
const TST = kind('0100001000');
const NEG = kind('0100001001');
const CMP = kind('0100001010');
const ORR = kind('0100001100');
const MUL = kind('0100001101');
const BIC = kind('0100001110');
const MVN = kind('0100001111');
const ADD_HIGH = kind('01000100');
const CMP_HIGH = kind('01000101');
const MOV_HIGH = kind('01000110');
const BX = kind('010001110');
const BLX = kind('010001111');
const LDR_LITERAL = kind('01001');
const STR_REGISTER = kind('0101000');
const STRH_REGISTER = kind('0101001');
const STRB_REGISTER = kind('0101010');
const LDRSB = kind('0101011');
const LDR_REGISTER = kind('0101100');
const LDRH_REGISTER = kind('0101101');
const LDRB_REGISTER = kind('0101110');
const LDRSH = kind('0101111');
const STR = kind('01100');
const LDR = kind('01101');
const STRB = kind('01110');
const LDRB = kind('01111');
const STRH = kind('10000');
const LDRH = kind('10001');
const STR_STACK = kind('10010');
const LDR_STACK = kind('10011');
const ADR = kind('10100');
const ADD_TO_STACK = kind('10101');
const ADD_STACK = kind('101100000');
const SUB_STACK = kind('101100001');
const SXTH = kind('1011001000');
const SXTB = kind('1011001001');
const UXTH = kind('1011001010');
const UXTB = kind('1011001011');
const PUSH = kind('1011010');
const POP = kind('1011110');
const STM = kind('11000');
const LDM = kind('11001');
const BEQ = kind('11010000');
const BNE = kind('11010001');
const BCS = kind('11010010');
const BCC = kind('11010011');
const BMI = kind('11010100');
const BPL = kind('11010101');
const BVS = kind('11010110');
const BVC = kind('11010111');
const BHI = kind('11011000');
const BLS = kind('11011001');
const BGE = kind('11011010');
const BLT = kind('11011011');
const BGT = kind('11011100');
const BLE = kind('11011101');
const B = kind('11100');
const BL = kind('11110');

const LINK = 14;
const PC = 15;

// Every chip that is started has these memories and registers, so that what node's compiler has learnt stays true.
const flash = new Uint8Array(16 << 20).fill(0xff);
const flash16 = new Uint16Array(flash.buffer);
const flash32 = new Uint32Array(flash.buffer);
const ram = new Uint8Array(264 << 10);
const ram16 = new Uint16Array(ram.buffer);
const ram32 = new Uint32Array(ram.buffer);
const views = { flashView: new DataView(flash.buffer), sramView: new DataView(ram.buffer) };
const r = new Uint32Array(16);

let chip, core, executeRare;

/** From now on this chip runs, its RAM empty, its flash as it was left. */
function replaceChip(next) {
  chip = next;
  core = chip.core;
  Object.assign(chip, { flash, flash16, sram: ram, ...views });
  ram.fill(0);
  r.set(core.registers);
  core.registers = r;
  executeRare = core.executeInstruction;
  core.executeInstruction = executeInstruction;
}

// Each gives its cycles. An address below where a memory begins counts as far behind its end.
function load(register, sum) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  const inFlash = (address - FLASH) >>> 0;
  if (address & 3) r[register] = chip.readUint32(address);
  else if (inRam < ram.length) r[register] = ram32[inRam >> 2];
  else if (inFlash < flash.length) r[register] = flash32[inFlash >> 2];
  else {
    r[register] = chip.readUint32(address);
    return 1 + core.cyclesIO(address);
  }
  return 2;
}

function load16(register, sum) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  const inFlash = (address - FLASH) >>> 0;
  if (address & 1) r[register] = chip.readUint16(address);
  else if (inRam < ram.length) r[register] = ram16[inRam >> 1];
  else if (inFlash < flash.length) r[register] = flash16[inFlash >> 1];
  else {
    r[register] = chip.readUint16(address);
    return 1 + core.cyclesIO(address);
  }
  return 2;
}

function load8(register, sum) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  const inFlash = (address - FLASH) >>> 0;
  if (inRam < ram.length) r[register] = ram[inRam];
  else if (inFlash < flash.length) r[register] = flash[inFlash];
  else {
    r[register] = chip.readUint8(address);
    return 1 + core.cyclesIO(address);
  }
  return 2;
}

function store(sum, value) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  if (inRam < ram.length && !(address & 3)) {
    ram32[inRam >> 2] = value;
    return 2;
  }
  chip.writeUint32(address, value);
  return 1 + core.cyclesIO(address, true);
}

function store16(sum, value) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  if (inRam < ram.length && !(address & 1)) {
    ram16[inRam >> 1] = value;
    return 2;
  }
  chip.writeUint16(address, value);
  return 1 + core.cyclesIO(address, true);
}

function store8(sum, value) {
  const address = sum >>> 0;
  const inRam = (address - RAM) >>> 0;
  if (inRam < ram.length) {
    ram[inRam] = value;
    return 2;
  }
  chip.writeUint8(address, value);
  return 1 + core.cyclesIO(address, true);
}

function test(result) {
  core.N = result < 0;
  core.Z = result === 0;
  return result;
}

// Unlike rp2040js, which folds the carry into the second operand: where that makes 0x80000000 of 0x7fffffff,
// its overflow flag is wrong.
function add(first, second, carry) {
  const sum = first + second + carry;
  core.C = sum > 0xffffffff;
  core.V = (~(first ^ second) & (first ^ sum)) < 0;
  return test(sum | 0);
}

function subtract(first, second) {
  return add(first, ~second >>> 0, 1);
}

function branch(target) {
  r[PC] = target;
  return 2;
}

function branchIf(condition, pc, opcode) {
  return condition ? branch(pc + 4 + ((opcode << 24) >> 23)) : 1;
}

function leave(pc) {
  r[PC] = pc;
  return executeRare.call(core);
}

/** In place of the core's own. */
function executeInstruction() {
  if (core.interruptsUpdated && core.checkForInterrupts()) core.waiting = false;
  // A vector bears the mark of Thumb code, bit 0, which rp2040js leaves there.
  const pc = r[PC] & ~1;
  const inFlash = (pc - FLASH) >>> 0;
  const inRam = (pc - RAM) >>> 0;
  let opcode;
  if (inFlash < flash.length) opcode = flash16[inFlash >> 1];
  else if (inRam < ram.length) opcode = ram16[inRam >> 1];
  else return executeRare.call(core);
  r[PC] = pc + 2;
  const low = opcode & 7;
  const mid = (opcode >> 3) & 7;
  const high = (opcode >> 6) & 7;
  const top = (opcode >> 8) & 7;
  const byte = opcode & 0xff;
  const five = (opcode >> 6) & 0x1f;
  switch (KINDS[opcode]) {
    case LSL_IMMEDIATE: {
      const value = r[mid];
      if (five) core.C = !!(value & (1 << (32 - five)));
      r[low] = test(value << five);
      return 1;
    }
    case LSR_IMMEDIATE: {
      const value = r[mid];
      core.C = !!((value >>> (five ? five - 1 : 31)) & 1);
      r[low] = test(five ? (value >>> five) | 0 : 0);
      return 1;
    }
    case ASR_IMMEDIATE: {
      const value = r[mid];
      core.C = !!(value & (1 << (five ? five - 1 : 31)));
      r[low] = test(value >> (five || 31));
      return 1;
    }
    case ADD_REGISTER:
      r[low] = add(r[mid], r[high], 0);
      return 1;
    case SUB_REGISTER:
      r[low] = subtract(r[mid], r[high]);
      return 1;
    case ADD_3:
      r[low] = add(r[mid], high, 0);
      return 1;
    case SUB_3:
      r[low] = subtract(r[mid], high);
      return 1;
    case MOV_IMMEDIATE:
      r[top] = test(byte);
      return 1;
    case CMP_IMMEDIATE:
      subtract(r[top], byte);
      return 1;
    case ADD_8:
      r[top] = add(r[top], byte, 0);
      return 1;
    case SUB_8:
      r[top] = subtract(r[top], byte);
      return 1;
    case AND:
      r[low] = test(r[low] & r[mid]);
      return 1;
    case EOR:
      r[low] = test(r[low] ^ r[mid]);
      return 1;
    case LSL: {
      const [value, count] = [r[low], r[mid] & 0xff];
      if (count) core.C = !!(value & (1 << (32 - count)));
      r[low] = test(count < 32 ? value << count : 0);
      return 1;
    }
    case LSR: {
      const [value, count] = [r[low], r[mid] & 0xff];
      core.C = count <= 32 && !!((value >>> (count - 1)) & 1);
      r[low] = test(count < 32 ? (value >>> count) | 0 : 0);
      return 1;
    }
    case ADC:
      r[low] = add(r[low], r[mid], core.C ? 1 : 0);
      return 1;
    case SBC:
      r[low] = add(r[low], ~r[mid] >>> 0, core.C ? 1 : 0);
      return 1;
    case TST:
      test(r[low] & r[mid]);
      return 1;
    case NEG:
      r[low] = subtract(0, r[mid]);
      return 1;
    case CMP:
      subtract(r[low], r[mid]);
      return 1;
    case ORR:
      r[low] = test(r[low] | r[mid]);
      return 1;
    case MUL:
      r[low] = test(Math.imul(r[low], r[mid]));
      return 1;
    case BIC:
      r[low] = test(r[low] & ~r[mid]);
      return 1;
    case MVN:
      r[low] = test(~r[mid]);
      return 1;
    case ADD_HIGH:
    case MOV_HIGH: {
      const to = ((opcode >> 4) & 8) | low;
      const from = (opcode >> 3) & 15;
      // The stack's pointer and the program counter have rules of their own.
      if (to === 13 || to === PC || from === PC) return leave(pc);
      r[to] = KINDS[opcode] === MOV_HIGH ? r[from] : r[to] + r[from];
      return 1;
    }
    case CMP_HIGH:
      subtract(r[((opcode >> 4) & 8) | low], r[(opcode >> 3) & 15]);
      return 1;
    case BX:
      core.BXWritePC(r[(opcode >> 3) & 15]);
      return 2;
    case BLX: {
      const target = r[(opcode >> 3) & 15];
      r[LINK] = (pc + 2) | 1;
      return branch(target & ~1);
    }
    case LDR_LITERAL:
      return load(top, ((pc + 4) & ~3) + 4 * byte);
    case STR_REGISTER:
      return store(r[mid] + r[high], r[low]);
    case STRH_REGISTER:
      return store16(r[mid] + r[high], r[low]);
    case STRB_REGISTER:
      return store8(r[mid] + r[high], r[low]);
    case LDRSB: {
      const cycles = load8(low, r[mid] + r[high]);
      r[low] = (r[low] << 24) >> 24;
      return cycles;
    }
    case LDR_REGISTER:
      return load(low, r[mid] + r[high]);
    case LDRH_REGISTER:
      return load16(low, r[mid] + r[high]);
    case LDRB_REGISTER:
      return load8(low, r[mid] + r[high]);
    case LDRSH: {
      const cycles = load16(low, r[mid] + r[high]);
      r[low] = (r[low] << 16) >> 16;
      return cycles;
    }
    case STR:
      return store(r[mid] + 4 * five, r[low]);
    case LDR:
      return load(low, r[mid] + 4 * five);
    case STRB:
      return store8(r[mid] + five, r[low]);
    case LDRB:
      return load8(low, r[mid] + five);
    case STRH:
      return store16(r[mid] + 2 * five, r[low]);
    case LDRH:
      return load16(low, r[mid] + 2 * five);
    case STR_STACK:
      return store(r[13] + 4 * byte, r[top]);
    case LDR_STACK:
      return load(top, r[13] + 4 * byte);
    case ADR:
      r[top] = (pc & ~3) + 4 + 4 * byte;
      return 1;
    case ADD_TO_STACK:
      r[top] = r[13] + 4 * byte;
      return 1;
    case ADD_STACK:
      r[13] += 4 * (opcode & 0x7f);
      return 1;
    case SUB_STACK:
      r[13] -= 4 * (opcode & 0x7f);
      return 1;
    case SXTH:
      r[low] = (r[mid] << 16) >> 16;
      return 1;
    case SXTB:
      r[low] = (r[mid] << 24) >> 24;
      return 1;
    case UXTH:
      r[low] = r[mid] & 0xffff;
      return 1;
    case UXTB:
      r[low] = r[mid] & 0xff;
      return 1;
    case PUSH: {
      let [cycles, address] = [1, r[13]];
      if (opcode & 0x100) store((address -= 4), r[LINK]);
      for (let number = 7; number >= 0; number--) {
        if (!(opcode & (1 << number))) continue;
        store((address -= 4), r[number]);
        cycles++;
      }
      r[13] = address;
      return cycles;
    }
    case POP: {
      let [cycles, address] = [1, r[13]];
      for (let number = 0; number < 8; number++) {
        if (!(opcode & (1 << number))) continue;
        load(number, address);
        address += 4;
        cycles++;
      }
      if (!(opcode & 0x100)) {
        r[13] = address;
        return cycles;
      }
      load(PC, address);
      r[13] = address + 4;
      core.BXWritePC(r[PC]);
      return cycles + 2;
    }
    case STM: {
      let [cycles, address] = [1, r[top]];
      for (let number = 0; number < 8; number++) {
        if (!(opcode & (1 << number))) continue;
        store(address, r[number]);
        address += 4;
        cycles++;
      }
      if (!(opcode & (1 << top))) r[top] = address;
      return cycles;
    }
    case LDM: {
      let [cycles, address] = [1, r[top]];
      for (let number = 0; number < 8; number++) {
        if (!(opcode & (1 << number))) continue;
        load(number, address);
        address += 4;
        cycles++;
      }
      if (!(opcode & (1 << top))) r[top] = address;
      return cycles;
    }
    case BEQ:
      return branchIf(core.Z, pc, opcode);
    case BNE:
      return branchIf(!core.Z, pc, opcode);
    case BCS:
      return branchIf(core.C, pc, opcode);
    case BCC:
      return branchIf(!core.C, pc, opcode);
    case BMI:
      return branchIf(core.N, pc, opcode);
    case BPL:
      return branchIf(!core.N, pc, opcode);
    case BVS:
      return branchIf(core.V, pc, opcode);
    case BVC:
      return branchIf(!core.V, pc, opcode);
    case BHI:
      return branchIf(core.C && !core.Z, pc, opcode);
    case BLS:
      return branchIf(!core.C || core.Z, pc, opcode);
    case BGE:
      return branchIf(core.N === core.V, pc, opcode);
    case BLT:
      return branchIf(core.N !== core.V, pc, opcode);
    case BGT:
      return branchIf(core.N === core.V && !core.Z, pc, opcode);
    case BLE:
      return branchIf(core.N !== core.V || core.Z, pc, opcode);
    case B:
      return branch(pc + 4 + ((opcode << 21) >> 20));
    case BL: {
      const second = inFlash < flash.length ? flash16[(inFlash + 2) >> 1] : ram16[(inRam + 2) >> 1];
      // Others begin alike: those for special registers, barriers.
      if (second >> 14 !== 3 || !(second & 0x1000)) return leave(pc);
      const sign = (opcode << 21) >> 31;
      const third = ~((second >> 13) ^ sign) & 1;
      const fourth = ~((second >> 11) ^ sign) & 1;
      const offset = (sign << 24) | (third << 23) | (fourth << 22) | ((opcode & 0x3ff) << 12) | ((second & 0x7ff) << 1);
      r[LINK] = (pc + 4) | 1;
      r[PC] = pc + 4 + offset;
      return 3;
    }
    default:
      return leave(pc);
  }
}
