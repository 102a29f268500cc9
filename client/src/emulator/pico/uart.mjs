// UART0 of the emulated Pico, and what is at the other end of its cable.
//
// The UART of the RP2040 is Arm's PrimeCell PL011. rp2040js models hardly more than its data
// register, so this takes its place: both FIFOs of 32 places, the time that a byte takes each way,
// overrun, framing and parity errors and breaks, the interrupts with their trigger levels and the
// receive timeout, and the requests to DMA. The sources are Arm's manual DDI 0183 and the RP2040's
// data sheet, 4.2. Not modelled: flow control, loopback.
//
// The other end of the cable has 115200 baud, 8 bits, no parity and one stop bit. Where a byte goes
// either way while the UART has another format, which would lose or damage it, the emulation ends.
// The PL011 takes the divider of the rate over only when the line control is written, and neither
// may change while it is enabled (DDI 0183, 3.3.6 and 3.3.7).
//
// Until the first byte is sent to it, nothing is connected: GP1 has the level to which its pad
// pulls it. A low level that lasts is a break, as it is on the chip. A UART input that no pin is
// routed to is low.

const UART_FIFO = 32;
const UART_BASE = 0x40034;
const UART_PIN = 1;
const UART_FUNCTION = 2;
const UART_BAUD = 115200;
const UART_NANOS_PER_BIT = 1e9 / UART_BAUD;
const UART_BITS_PER_BYTE = 10;
/**
 * By how much the rate may differ: the middle of the last bit is 9.5 bits from the start, and both
 * ends and the sampling share the half bit by which it may be missed.
 */
const UART_RATE_TOLERANCE = 0.02;
/** The line control of 8 bits, no parity and one stop bit, with FIFOs. */
const UART_LINE_CONTROL = 0x70;

const UART_REGISTER = {
  DATA: 0x00,
  ERROR_CLEAR: 0x04,
  FLAGS: 0x18,
  BAUD_INTEGER: 0x24,
  BAUD_FRACTION: 0x28,
  LINE_CONTROL: 0x2c,
  CONTROL: 0x30,
  LEVELS: 0x34,
  MASK: 0x38,
  RAW: 0x3c,
  MASKED: 0x40,
  CLEAR: 0x44,
  DMA: 0x48,
};
const UART_FLAG = {
  BUSY: 1 << 3,
  RECEIVER_EMPTY: 1 << 4,
  SENDER_FULL: 1 << 5,
  RECEIVER_FULL: 1 << 6,
  SENDER_EMPTY: 1 << 7,
};
const UART_CONTROL = { ENABLED: 1, SENDS: 1 << 8, RECEIVES: 1 << 9 };
const UART_INTERRUPT = {
  RECEIVED: 1 << 4,
  SENT: 1 << 5,
  TIMEOUT: 1 << 6,
  FRAMING: 1 << 7,
  PARITY: 1 << 8,
  BREAK: 1 << 9,
  OVERRUN: 1 << 10,
};
/** In the data register, above the byte. */
const UART_ERROR = { FRAMING: 1 << 8, PARITY: 1 << 9, BREAK: 1 << 10, OVERRUN: 1 << 11 };
const UART_DMA_RECEIVES = 1;
const UART_DMA_SENDS = 2;
/**
 * Bit times without a byte after which the receiver's FIFO is to be read however little is in it.
 */
const UART_TIMEOUT_BITS = 32;
/** Places by the selection of a trigger level. */
const UART_TRIGGER = [4, 8, 16, 24, 28];

/** In nanoseconds, rounded to whole cycles of the core: the clock stops at nothing else. */
const wholeCycles = (nanos) => Math.round(nanos / 8) * 8;

/**
 * `cable.bytes` are the bytes on their way to the chip, each with its error bits; they outlive a
 * reset. `sent` is told each byte when it has left, and `came` each one that has arrived.
 */
export class Uart {
  constructor(chip, cable, sent, came) {
    const { irq, dreq } = chip.uart[0];
    Object.assign(this, { chip, cable, sent, came, irq, dreq });
    this.rawWriteValue = 0;
    this.received = [];
    this.toSend = [];
    this.shifted = null;
    this.overrun = false;
    this.control = UART_CONTROL.SENDS | UART_CONTROL.RECEIVES;
    this.lineControl = this.baudInteger = this.baudFraction = this.mask = this.raw = this.dma = 0;
    this.levels = 0b010010;
    /** What divides the clock, since the line control was last written. */
    this.divisor = 0;
    this.arrival = chip.clock.createAlarm(() => this.arrive());
    this.departure = chip.clock.createAlarm(() => this.depart());
    this.timeout = chip.clock.createAlarm(() => this.timeOut());
    /** The byte that arrives. */
    this.arriving = null;
    /** Since when the input has been low without a byte that explains it. */
    this.lowSince = null;
    this.lowEnds = chip.clock.createAlarm(() => this.endLow());
    chip.uart[0] = this;
    chip.peripherals[UART_BASE] = this;
    const pin = chip.gpio[UART_PIN];
    const update = pin.checkForUpdates.bind(pin);
    pin.checkForUpdates = () => {
      update();
      this.watchInput();
    };
    this.listen();
  }

  /** Whether a byte is on its way. */
  get busy() {
    return (
      this.arriving !== null ||
      this.cable.bytes.length > 0 ||
      this.shifted !== null ||
      this.lowEnds.scheduled
    );
  }

  get receives() {
    const needed = UART_CONTROL.ENABLED | UART_CONTROL.RECEIVES;
    return (this.control & needed) === needed;
  }

  // --- The cable
  // -----------------------------------------------------------------------------------

  /** The next byte begins to arrive. */
  listen() {
    if (this.arriving || this.cable.bytes.length === 0) return;
    this.cable.connected = true;
    this.watchInput();
    this.arriving = this.cable.bytes.shift();
    this.arrival.schedule(wholeCycles(UART_BITS_PER_BYTE * UART_NANOS_PER_BIT));
  }

  arrive() {
    const { value, errors } = this.arriving;
    this.arriving = null;
    if (this.receives && this.isRouted) {
      this.checkFormat('receives');
      this.came(value);
      this.receive(value | errors);
    }
    this.listen();
  }

  get isRouted() {
    return this.chip.gpio[UART_PIN].functionSelect === UART_FUNCTION;
  }

  /** The level of the input while no byte arrives. */
  get input() {
    if (!this.isRouted) return false;
    return this.cable.connected || this.chip.gpio[UART_PIN].pullupEnabled;
  }

  /** Something has changed that the input's level depends on, or whether it is watched. */
  watchInput() {
    const { clock } = this.chip;
    const low = this.receives && !this.input;
    if (low && this.lowSince === null) {
      this.lowSince = clock.nanos;
      this.lowEnds.schedule(wholeCycles(UART_BITS_PER_BYTE * UART_NANOS_PER_BIT));
    } else if (!low && this.lowSince !== null) {
      if (this.receives && this.lowEnds.scheduled) {
        this.receiveLow((clock.nanos - this.lowSince) / UART_NANOS_PER_BIT);
      }
      this.lowEnds.cancel();
      this.lowSince = null;
    }
  }

  /** It has been low for a whole frame: a break. Nothing more is received until it is high. */
  endLow() {
    this.lowEnds.scheduled = false;
    this.receive(UART_ERROR.BREAK | UART_ERROR.FRAMING);
  }

  /** It was low for so many bits, then high: the start bit and zeros, then ones. */
  receiveLow(bits) {
    const zeros = Math.round(bits) - 1;
    if (bits >= 0.5) this.receive((0xff << Math.max(zeros, 0)) & 0xff);
  }

  // --- Receiving
  // -----------------------------------------------------------------------------------

  receive(data) {
    this.timeout.cancel();
    this.timeout.schedule(wholeCycles(UART_TIMEOUT_BITS * UART_NANOS_PER_BIT));
    if (this.received.length === UART_FIFO) {
      // The next byte that finds a place tells of it.
      this.overrun = true;
      this.raw |= UART_INTERRUPT.OVERRUN;
      return this.update();
    }
    if (this.overrun) data |= UART_ERROR.OVERRUN;
    this.overrun = false;
    this.received.push(data);
    if (data & UART_ERROR.FRAMING) this.raw |= UART_INTERRUPT.FRAMING;
    if (data & UART_ERROR.PARITY) this.raw |= UART_INTERRUPT.PARITY;
    if (data & UART_ERROR.BREAK) this.raw |= UART_INTERRUPT.BREAK;
    if (this.received.length >= UART_TRIGGER[(this.levels >> 3) & 7]) {
      this.raw |= UART_INTERRUPT.RECEIVED;
    }
    this.update();
  }

  timeOut() {
    this.timeout.scheduled = false;
    if (this.received.length === 0) return;
    this.raw |= UART_INTERRUPT.TIMEOUT;
    this.update();
  }

  take() {
    const data = this.received.shift() ?? 0;
    if (this.received.length < UART_TRIGGER[(this.levels >> 3) & 7]) {
      this.raw &= ~UART_INTERRUPT.RECEIVED;
    }
    if (this.received.length === 0) this.raw &= ~UART_INTERRUPT.TIMEOUT;
    this.update();
    return data;
  }

  // --- Sending
  // -------------------------------------------------------------------------------------

  /** Bits per second; 0 without a clock or a divider. */
  get baud() {
    return this.divisor === 0 ? 0 : this.chip.clocks.periFreq / (16 * this.divisor);
  }

  /** rp2040js tells of it; the rate is computed for each byte. */
  clkPeriChanged() {}

  /** Ends the emulation unless the format is that of the other end. */
  checkFormat(does) {
    const isRate = Math.abs(this.baud / UART_BAUD - 1) <= UART_RATE_TOLERANCE;
    if (isRate && this.lineControl === UART_LINE_CONTROL) return;
    throw new Error(
      `UART0 ${does} a byte at ${Math.round(this.baud)} baud with the line control ` +
        `0x${this.lineControl.toString(16)}; the other end has ${UART_BAUD} baud and ` +
        `0x${UART_LINE_CONTROL.toString(16)}`,
    );
  }

  put(byte) {
    if (!(this.control & UART_CONTROL.ENABLED) || !(this.control & UART_CONTROL.SENDS)) return;
    if (this.toSend.length === UART_FIFO) {
      this.chip.logger.error('UART0', 'a byte is lost: it was written to a full FIFO');
      return;
    }
    this.toSend.push(byte);
    if (this.toSend.length > UART_TRIGGER[this.levels & 7]) this.raw &= ~UART_INTERRUPT.SENT;
    if (this.shifted === null) this.shift();
    this.update();
  }

  shift() {
    this.shifted = this.toSend.shift() ?? null;
    if (this.shifted === null) return;
    this.checkFormat('sends');
    this.departure.schedule(wholeCycles((UART_BITS_PER_BYTE * 1e9) / this.baud));
    if (this.toSend.length === UART_TRIGGER[this.levels & 7]) this.raw |= UART_INTERRUPT.SENT;
  }

  depart() {
    this.departure.scheduled = false;
    this.sent(this.shifted);
    this.shift();
    this.update();
  }

  // --- Registers
  // -----------------------------------------------------------------------------------

  /** Interrupt and requests as the state has them. */
  update() {
    const { chip } = this;
    chip.setInterrupt(this.irq, (this.raw & this.mask) !== 0);
    const request = (number, wanted) =>
      wanted ? chip.dma.setDREQ(number) : chip.dma.clearDREQ(number);
    request(this.dreq.rx, (this.dma & UART_DMA_RECEIVES) !== 0 && this.received.length > 0);
    const hasPlace = this.toSend.length < UART_FIFO;
    request(this.dreq.tx, (this.dma & UART_DMA_SENDS) !== 0 && hasPlace);
  }

  get flags() {
    return (
      (this.shifted === null ? 0 : UART_FLAG.BUSY) |
      (this.received.length === 0 ? UART_FLAG.RECEIVER_EMPTY : 0) |
      (this.received.length === UART_FIFO ? UART_FLAG.RECEIVER_FULL : 0) |
      (this.toSend.length === UART_FIFO ? UART_FLAG.SENDER_FULL : 0) |
      (this.toSend.length === 0 ? UART_FLAG.SENDER_EMPTY : 0)
    );
  }

  readUint32(offset) {
    switch (offset & 0xfff) {
      case UART_REGISTER.DATA:
        return this.take();
      case UART_REGISTER.FLAGS:
        return this.flags;
      case UART_REGISTER.BAUD_INTEGER:
        return this.baudInteger;
      case UART_REGISTER.BAUD_FRACTION:
        return this.baudFraction;
      case UART_REGISTER.LINE_CONTROL:
        return this.lineControl;
      case UART_REGISTER.CONTROL:
        return this.control;
      case UART_REGISTER.LEVELS:
        return this.levels;
      case UART_REGISTER.MASK:
        return this.mask;
      case UART_REGISTER.RAW:
        return this.raw;
      case UART_REGISTER.MASKED:
        return this.raw & this.mask;
      case UART_REGISTER.DMA:
        return this.dma;
    }
    const register = offset.toString(16);
        this.chip.logger.error('UART0', `register ${register} is read, which is not modelled`);
    return 0;
  }

  /** As every peripheral of the chip: the address says whether bits are toggled, set or cleared. */
  writeUint32Atomic(offset, value, type) {
    this.rawWriteValue = value;
    const before = type === 0 ? 0 : this.readUint32(offset);
    this.writeUint32(offset, [value, before ^ value, before | value, before & ~value][type]);
  }

  /** Ends the emulation if the format changes while it may be used. */
  refuseIfEnabled() {
    if (this.control & UART_CONTROL.ENABLED) {
      throw new Error('the rate or the line control of UART0 is written while it is enabled');
    }
  }

  writeUint32(offset, value) {
    switch (offset) {
      case UART_REGISTER.DATA:
        return this.put(value & 0xff);
      case UART_REGISTER.ERROR_CLEAR:
        return;
      case UART_REGISTER.BAUD_INTEGER:
        this.refuseIfEnabled();
        this.baudInteger = value & 0xffff;
        return;
      case UART_REGISTER.BAUD_FRACTION:
        this.refuseIfEnabled();
        this.baudFraction = value & 0x3f;
        return;
      case UART_REGISTER.LINE_CONTROL:
        this.refuseIfEnabled();
        this.lineControl = value & 0xff;
        this.divisor = this.baudInteger + this.baudFraction / 64;
        return;
      case UART_REGISTER.CONTROL:
        this.control = value & 0xffff;
        return this.watchInput();
      case UART_REGISTER.LEVELS:
        this.levels = value & 0x3f;
        return;
      case UART_REGISTER.MASK:
        this.mask = value & 0x7ff;
        return this.update();
      case UART_REGISTER.CLEAR:
        this.raw &= ~value;
        // What is still in the FIFO times out again.
        if (value & UART_INTERRUPT.TIMEOUT && this.received.length > 0) {
          this.timeout.cancel();
          this.timeout.schedule(wholeCycles(UART_TIMEOUT_BITS * UART_NANOS_PER_BIT));
        }
        return this.update();
      case UART_REGISTER.DMA:
        this.dma = value & 0x7;
        return this.update();
    }
    const register = offset.toString(16);
        this.chip.logger.error('UART0', `register ${register} is written, which is not modelled`);
  }
}
