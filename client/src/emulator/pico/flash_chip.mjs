// The flash chip at its own serial line (W25Q16JV data sheet), and the controller in between
// (RP2040 data sheet, 4.10): what is sent byte by byte, not what is read by way of the memory map.
//
// Each byte that is sent brings one back. A command begins when the chip is selected, and ends when
// it is not. The selection is by the pad's override (IO_QSPI); while that is normal, the controller
// selects as it sends.

/** The number that no other chip has. */
export const UNIQUE_NUMBER = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x5a, 0x2b, 0x2f];

const READ_STATUS_1 = 0x05;
const READ_STATUS_2 = 0x35;
const READ_NUMBER = 0x4b;
/** The chip sends on all four wires: the quad enable bit. */
const QUAD = 0x02;
const FIFO_BYTES = 16;

const SSI = { ENABLED: 0x08, TX_LEVEL: 0x20, RX_LEVEL: 0x24, STATUS: 0x28, DATA: 0x60 };
const EMPTY_TX = 1 << 2;
const PLACE_TX = 1 << 1;
const BYTES_RX = 1 << 3;
const SELECT = 0x0c;

class FlashChip {
  sent = [];

  /** What comes back with a byte. */
  exchange(byte) {
    this.sent.push(byte);
    const at = this.sent.length - 1;
    switch (this.sent[0]) {
      case READ_STATUS_2: return at > 0 ? QUAD : 0xff;
      case READ_STATUS_1: return at > 0 ? 0 : 0xff;
      case READ_NUMBER: return UNIQUE_NUMBER[at - 5] ?? 0xff;
      default: return 0xff;
    }
  }

  deselect() {
    this.sent = [];
  }
}

/** A peripheral of plain registers, as rp2040js calls it; `changed` hears of each write. */
class Registers {
  words = new Map();

  readUint32(offset) {
    return this.words.get(offset) ?? 0;
  }

  writeUint32Atomic(offset, value, type) {
    const before = this.readUint32(offset);
    this.write(offset, [value, before ^ value, before | value, before & ~value][type] >>> 0);
  }

  write(offset, value) {
    this.words.set(offset, value);
  }
}

class Pads extends Registers {
  constructor(flash) {
    super();
    this.flash = flash;
  }

  write(offset, value) {
    super.write(offset, value);
    if (offset === SELECT && !this.selects()) this.flash.deselect();
  }

  override() {
    return (this.readUint32(SELECT) >> 8) & 3;
  }

  selects() {
    return this.override() === 2;
  }
}

class Controller extends Registers {
  received = [];

  constructor(flash, pads) {
    super();
    Object.assign(this, { flash, pads });
  }

  readUint32(offset) {
    switch (offset) {
      case SSI.STATUS: return EMPTY_TX | PLACE_TX | (this.received.length ? BYTES_RX : 0);
      case SSI.RX_LEVEL: return this.received.length;
      case SSI.TX_LEVEL: return 0;
      case SSI.DATA: return this.received.shift() ?? 0;
      default: return super.readUint32(offset);
    }
  }

  write(offset, value) {
    super.write(offset, value);
    if (offset === SSI.ENABLED) this.received = [];
    if (offset !== SSI.DATA) return;
    // With the pad high by hand the chip hears nothing.
    // By itself the controller selects the chip anew for each row of bytes: it waits until all have
    // come back.
    if (!this.received.length && this.pads.override() === 0) this.flash.deselect();
    const isHeard = this.pads.override() !== 3;
    const answer = isHeard ? this.flash.exchange(value & 0xff) : 0xff;
    if (this.received.length < FIFO_BYTES) this.received.push(answer);
    else console.error('the flash controller has no place for what the chip sends');
  }
}

/** Puts both into a new chip. */
export function attachFlashChip(chip) {
  const flash = new FlashChip();
  const pads = new Pads(flash);
  const controller = new Controller(flash, pads);
  chip.peripherals[0x18000] = controller;
  chip.peripherals[0x40018] = pads;
}
