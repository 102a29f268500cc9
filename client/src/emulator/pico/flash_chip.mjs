// The flash chip at its own serial line (W25Q16JV data sheet), the controller in between (RP2040
// data sheet, 4.10), and the functions of the boot ROM that use both (2.8.3.1.3, and the sources of
// the boot ROM).
//
// Each byte that is sent brings one back. A command begins when the chip is selected, and ends when
// it is not. The selection is by the pad's override (IO_QSPI); while that is normal, the controller
// selects as it sends.
//
// Flash is mapped to memory while the controller makes reads of the accesses to its addresses, in a
// mode that the chip is in as well. Otherwise such an access returns anything or hangs the bus, so
// it ends the emulation; it does so even where the cache holds what is read. It also ends where the
// boot ROM is given what the chip would round, or wrap around within a page, and where the program
// writes to the addresses of flash.

/** The number that no other chip has. */
export const UNIQUE_NUMBER = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x5a, 0x2b, 0x2f];

const READ_STATUS_1 = 0x05;
const READ_STATUS_2 = 0x35;
const READ_NUMBER = 0x4b;
const READ = 0x03;
const READ_QUAD = 0xeb;
/** The upper half of the byte behind the address that makes the next read need no command. */
const CONTINUOUS = 0xa;
/** The chip sends on all four wires: the quad enable bit. */
const QUAD = 0x02;
const FIFO_BYTES = 16;
const PAGE = 256;
const SECTOR = 4096;
/** What the boot ROM erases by a single command, where it can. */
const BLOCK = 1 << 16;
/** The bytes of the chip of a Pico; the emulator has room for a larger one. */
const CHIP = 2 << 20;

const SSI = {
  FORMAT: 0x00, ENABLED: 0x08, TX_LEVEL: 0x20, RX_LEVEL: 0x24, STATUS: 0x28, DATA: 0x60,
  READS: 0xf4,
};
/** The formats of the controller: bytes each way, and reads of words on one wire or on four. */
const FORMAT_BYTES = 7 << 16;
const FORMAT_WORDS = (31 << 16) | (3 << 8);
const FORMAT_QUAD_WORDS = FORMAT_WORDS | (2 << 21);
/** How it makes a read of an address: a command and the address; the address alone, on four wires,
 * with the byte that keeps the chip in its continuous mode. */
const READS_BY_COMMAND = ((READ << 24) | (2 << 8) | (6 << 2)) >>> 0;
const READS_CONTINUOUSLY = (((CONTINUOUS << 4) << 24) | (4 << 11) | (8 << 2) | 2) >>> 0;
const EMPTY_TX = 1 << 2;
const PLACE_TX = 1 << 1;
const BYTES_RX = 1 << 3;
const SELECT = 0x0c;

/** The overrides of the pad that selects the chip. */
const NORMAL = 0;
const LOW = 2;
const HIGH = 3;

class FlashChip {
  sent = [];
  /** Whether an address is expected in place of a command. */
  isContinuous = true;

  /** What comes back with a byte. */
  exchange(byte) {
    if (this.isContinuous) {
      throw new Error('the flash chip is sent a command while it expects an address: ' +
        'flash_exit_xip was not called');
    }
    this.sent.push(byte);
    const at = this.sent.length - 1;
    switch (this.sent[0]) {
      case READ_STATUS_2: return at > 0 ? QUAD : 0xff;
      case READ_STATUS_1: return at > 0 ? 0 : 0xff;
      case READ_NUMBER: return UNIQUE_NUMBER[at - 5] ?? 0xff;
      case READ_QUAD:
        // The controller sends the address and this byte as one word.
        if (at === 1) this.isContinuous = byte >> 4 === CONTINUOUS;
        return 0xff;
      default: return 0xff;
    }
  }

  deselect() {
    this.sent = [];
  }
}

/** A peripheral of plain registers, as rp2040js calls it. */
class Registers {
  words = new Map();

  readUint32(offset) {
    return this.words.get(offset) ?? 0;
  }

  writeUint32Atomic(offset, value, type) {
    // A read of the data takes a byte.
    const before = type === 0 ? 0 : this.readUint32(offset);
    this.write(offset, [value, before ^ value, before | value, before & ~value][type] >>> 0);
  }

  write(offset, value) {
    this.words.set(offset, value);
  }
}

class Pads extends Registers {
  constructor(flash, changed) {
    super();
    Object.assign(this, { flash, changed });
  }

  write(offset, value) {
    super.write(offset, value);
    if (offset === SELECT && this.override !== LOW) this.flash.deselect();
    this.changed();
  }

  get override() {
    return (this.readUint32(SELECT) >> 8) & 3;
  }

  set override(override) {
    this.write(SELECT, (this.readUint32(SELECT) & ~(3 << 8)) | (override << 8));
  }
}

class Controller extends Registers {
  received = [];

  constructor(flash, pads, changed) {
    super();
    Object.assign(this, { flash, pads, changed });
    this.setUp(FORMAT_QUAD_WORDS, READS_CONTINUOUSLY);
  }

  /** What the boot loader and the boot ROM write. */
  setUp(format, reads) {
    this.words.set(SSI.FORMAT, format).set(SSI.READS, reads).set(SSI.ENABLED, 1);
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
    if (offset === SSI.DATA) this.send(value & 0xff);
    this.changed();
  }

  send(byte) {
    // With the pad high by hand the chip hears nothing.
    // By itself the controller selects the chip anew for each row of bytes: it waits until all have
    // come back.
    if (!this.received.length && this.pads.override === NORMAL) this.flash.deselect();
    const isHeard = this.pads.override !== HIGH;
    const answer = isHeard ? this.flash.exchange(byte) : 0xff;
    if (this.received.length < FIFO_BYTES) this.received.push(answer);
    else console.error('the flash controller has no place for what the chip sends');
  }

  /** Whether it sends single bytes. */
  get sendsBytes() {
    return this.readUint32(SSI.ENABLED) === 1 && this.readUint32(SSI.FORMAT) === FORMAT_BYTES;
  }

  /** Whether it makes reads that the chip understands of the accesses to its addresses. */
  get maps() {
    const [format, reads] = [this.readUint32(SSI.FORMAT), this.readUint32(SSI.READS)];
    const understood = this.flash.isContinuous
      ? format === FORMAT_QUAD_WORDS && reads === READS_CONTINUOUSLY
      : format === FORMAT_WORDS && reads === READS_BY_COMMAND;
    return this.readUint32(SSI.ENABLED) === 1 && understood;
  }
}

/** A number as an address. */
const hex = (number) => `0x${(number >>> 0).toString(16)}`;

/** The chip, the controller and the pads, in a chip that is new. */
export class FlashPort {
  /** Whether flash is mapped to memory. */
  isMapped = true;

  constructor(chip) {
    const changed = () => this.look();
    this.flash = new FlashChip();
    this.pads = new Pads(this.flash, changed);
    this.controller = new Controller(this.flash, this.pads, changed);
    chip.peripherals[0x18000] = this.controller;
    chip.peripherals[0x40018] = this.pads;
    this.watch(chip);
  }

  /** Sees whether flash is mapped now. */
  look() {
    this.isMapped = this.controller.maps && this.pads.override === NORMAL;
  }

  /** Watches all accesses to flash by rp2040js: those of DMA, and of the core while flash is not
   * mapped. */
  watch(chip) {
    // From 0x10000000 on it lies there four times.
    const isFlash = (address) => address >>> 26 === 0x10000000 >>> 26;
    for (const name of ['readUint32', 'readUint16', 'readUint8']) {
      const read = chip[name].bind(chip);
      chip[name] = (address) => {
        if (!this.isMapped && isFlash(address)) {
          throw new Error(`flash is read at ${hex(address)} while it is not mapped to memory`);
        }
        return read(address);
      };
    }
    for (const name of ['writeUint32', 'writeUint16', 'writeUint8']) {
      const write = chip[name].bind(chip);
      chip[name] = (address, value) => {
        if (isFlash(address)) throw new Error(`flash is written at ${hex(address)} as memory`);
        write(address, value);
      };
    }
  }

  // --- The functions of the boot ROM ---

  /** `connect_internal_flash`: the pads are as after a reset. */
  connect() {
    this.pads.words.clear();
    this.pads.override = NORMAL;
  }

  /** `flash_exit_xip`: the pad that selects the chip stays overridden. */
  exitMapping() {
    this.flash.isContinuous = false;
    this.controller.setUp(FORMAT_BYTES, 0);
    this.pads.override = HIGH;
  }

  /** What `flash_flush_cache` does beside emptying the cache. */
  releaseSelect() {
    this.pads.override = NORMAL;
  }

  /** `flash_enter_cmd_xip`. Its reads take longer, which is not modelled. */
  enterMapping() {
    this.controller.setUp(FORMAT_WORDS, READS_BY_COMMAND);
    this.look();
  }

  /** Checks what `flash_range_erase` is given, before it is done. */
  beginErasure(from, count) {
    this.beginChange('erased', from, count, SECTOR);
    const block = Math.ceil(from / BLOCK) * BLOCK;
    if (block + BLOCK <= from + count) {
      throw new Error(`flash is erased by a block at ${hex(block)}: its time is not modelled`);
    }
  }

  /** Checks what `flash_range_program` is given, before it is done. */
  beginPages(to, count) {
    this.beginChange('written', to, count, PAGE);
  }

  /** Both leave the pad overridden that selects the chip. */
  beginChange(changed, from, count, unit) {
    const what = `flash is ${changed}, ${count} bytes from ${hex(from)} on`;
    if (!this.controller.sendsBytes || this.flash.isContinuous) {
      throw new Error(`${what}, without flash_exit_xip`);
    }
    if (from % unit !== 0 || count % unit !== 0) {
      throw new Error(`${what}: the chip changes whole units of ${unit} bytes`);
    }
    if (from + count > CHIP) throw new Error(`${what}: the chip ends at ${hex(CHIP)}`);
    this.pads.override = HIGH;
  }
}
