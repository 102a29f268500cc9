// The RP2040's USB controller as a device (data sheet, 4.1), and the host at the other end of the
// cable.
//
// Each packet is a transaction of its own time, data toggles are compared, frames begin every
// millisecond while the host does not suspend the bus, and requests are answered or stalled. Of the
// errata: E5 (without 800 us of idle bus after a reset the device does not connect; GPIO 15 can
// stand in for it), with other devices' packets on a busy bus, and E15 (an IN buffer that becomes
// available late in a frame may be asked for so late that the hub cuts its acknowledgement off; the
// controller then hangs until it is reset). Here every such buffer hangs it. So does a program that
// does what the controller may not bear, as it runs on another clock: see `misuse`.
//
// It is longer than 500 lines, because the controller and the host share the state of each
// transaction.

const MICROSECOND = 1000;
const MILLISECOND = 1000 * MICROSECOND;
/** Alarms come at cycles of the core. */
const CYCLE = 8;

const REGISTER = {
  ADDRESS: 0x00, MAIN: 0x40, SOF: 0x48, SIE: 0x4c, STATUS: 0x50, BUFFERS: 0x58, STALL_ARM: 0x68,
  MUXING: 0x74,
  POWER: 0x78, DIRECT: 0x7c, OVERRIDE: 0x80, RAW: 0x8c, ENABLED: 0x90, FORCED: 0x94, MASKED: 0x98,
};
const STATUS = {
  VBUS: 1, LINE: 3 << 2, SUSPENDED: 1 << 4, RESUME: 1 << 11, CONNECTED: 1 << 16, SETUP: 1 << 17,
  RESET: 1 << 19,
};
/** Interrupts that bits of the status raise. */
const RAISED = [
  [STATUS.RESET, 1 << 12], [STATUS.CONNECTED, 1 << 13], [STATUS.SUSPENDED, 1 << 14],
  [STATUS.RESUME, 1 << 15],
  [STATUS.SETUP, 1 << 16],
];
const BUFFER_DONE = 1 << 4;
const FRAME_BEGAN = 1 << 17;
const CONTROLLER_ON = 1;
const PULLED_UP = 1 << 16;
/** Each buffer of endpoint 0 that is done is reported. */
const REPORTS_0 = 1 << 29;
const TO_PHY = 1;
const TO_PAD = 1 << 2;
/** The program says when the pull-up is on. */
const SOFT_CONNECT = 1 << 3;
/** The bus has power, whatever a pin says. */
const POWERED = 3 << 2;
/** The bit that overrides it is the next. */
const DIRECT_PULL_UP = 1 << 1;
const J = 1 << 2;

/** Bits of a buffer's control word. */
const AVAILABLE = 1 << 10;
const STALL = 1 << 11;
const IS_DATA_1 = 1 << 13;
const FULL = 1 << 15;
const LENGTH = 0x3ff;
/** Bits of an endpoint's control word: it is on, reports each buffer, and is of the type bulk. */
const ENDPOINT_ON = 1 << 31;
const REPORTS = 1 << 29;
const TYPE = 3 << 26;
const BULK = 2 << 26;
const CONTROLS = 0x80;
const CONTROLS_END = 0x100;
const PACKET = 64;

/** In a frame, as the errata and TinyUSB's workaround have it. */
const CRITICAL_FROM = 800 * MICROSECOND;
const CRITICAL_TO = 998 * MICROSECOND;
const IDLE_TO_CONNECT = 800 * MICROSECOND;
/** The other bits of a control word must be there for so long before AVAILABLE (data sheet,
 * 4.1.2.5.1; the Pico SDK waits as long). */
const SETTLING = 12 * CYCLE;

const HOST = {
  PLUGS_IN: 1, STOPS: 2, TAKES: 3, SUSPENDS: 4, RESUMES: 5, UNPLUGS: 6, PLUGS_INTO_BUSY: 7,
  HAS_NO_POWER: 8, SENDS_TOO_MUCH: 9, CONFIGURES_AGAIN: 10, LIFTS_HALTS: 11,
};
/** More data of one request than the device has room for. */
const TOO_MUCH = 200;

/** Numbers from 0 to 1 without a pattern, the same for the same seed. */
function* numbers(seed) {
  for (let state = (seed ^ 0x6c078965) | 1; ; ) {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    yield (state >>> 0) / 2 ** 32;
  }
}

export class Usb {
  /** What the host is plugged into, takes and holds; outlives the chip's resets. */
  isPlugged = false;
  isBusy = false;
  takes = true;
  /** The line coding's rate, and whether the port is open: DTR. */
  rate = 115200;
  isOpen = true;
  bytes = [];

  /** `told` is called with what the host gets: `byte`, `serialNumber`. */
  constructor(told) {
    this.told = told;
  }

  /** A new chip is at this end of the cable. */
  attach(chip) {
    this.chip = chip;
    this.generation = (this.generation ?? 0) + 1;
    chip.usbCtrl = this;
    chip.peripherals[0x50110] = this;
    // Memory holds anything when the power comes.
    const random = numbers(0x50100);
    chip.usbDPRAM.forEach((_, at, memory) => (memory[at] = 256 * random.next().value));
    this.resetController();
    const resets = chip.peripherals[0x4000c];
    const write = resets.writeUint32.bind(resets);
    resets.writeUint32 = (offset, value) => {
      if (offset === 0 && value & (1 << 24)) this.resetController();
      write(offset, value);
    };
  }

  resetController() {
    Object.assign(this, {
      address: 0, main: 0, sie: 0, status: 0, buffers: 0, stallArm: 0, muxing: 0, power: 0,
      direct: 0, override: 0, isStepDue: false, available: 0,
      controls: new Uint32Array(32), settledAt: new Float64Array(32),
      enabled: 0, forced: 0, frame: 0, frameBegan: false, isHung: false, raised: false,
    });
    this.isFramed = false;
    this.frameAt = 0;
    this.isConfigured = false;
    this.transfer = null;
    this.generation++;
  }

  now() {
    return this.chip.clock.nanos;
  }

  /** Calls `work` later, unless the controller is reset before. */
  after(nanos, work) {
    const { generation } = this;
    const alarm = this.chip.clock.createAlarm(() => generation === this.generation && work());
    alarm.schedule(Math.ceil(nanos / CYCLE) * CYCLE);
  }

  /** Does the same whatever happens on the bus meanwhile, unless the chip is another one then. */
  later(nanos, work) {
    const { chip } = this;
    const alarm = chip.clock.createAlarm(() => chip === this.chip && work());
    alarm.schedule(Math.ceil(nanos / CYCLE) * CYCLE);
  }

  /** The program has done what the chip may not bear. */
  misuse(what) {
    console.error(`the USB controller may not bear this: ${what}`);
    this.isHung = true;
  }

  // --- The registers ---

  raw() {
    let raw = this.buffers ? BUFFER_DONE : 0;
    for (const [bit, interrupt] of RAISED) if (this.status & bit) raw |= interrupt;
    return this.frameBegan ? raw | FRAME_BEGAN : raw;
  }

  interrupt() {
    this.chip.setInterrupt(5, ((this.raw() & this.enabled) | this.forced) !== 0);
  }

  /** Whether the controller looks at the wires, and not at pins that stand for them. */
  seesWires() {
    return !(this.muxing & TO_PAD) || (this.muxing & TO_PHY) !== 0;
  }

  line() {
    if (!this.seesWires()) {
      const { ctrl } = this.chip.gpio[15];
      const [output, input] = [(ctrl >> 12) & 3, (ctrl >> 16) & 3];
      return (ctrl & 0x1f) === 8 && output === 2 && input === 3 ? J : 0;
    }
    return this.isBusReset ? 0 : J;
  }

  /** The same as the program reads it. On a busy bus packets end, each with both wires low for two
   * bit times: here every other look falls on such an end. */
  lineSeen() {
    const line = this.line();
    if (!this.isBusy || line !== J || this.muxing & TO_PAD) return line;
    this.isPacketsEnd = !this.isPacketsEnd;
    return this.isPacketsEnd ? 0 : J;
  }

  readUint32(offset) {
    switch (offset) {
      case REGISTER.ADDRESS: return this.address;
      case REGISTER.MAIN: return this.main;
      case REGISTER.SOF:
        this.frameBegan = false;
        this.interrupt();
        return this.frame & 0x7ff;
      case REGISTER.SIE: return this.sie;
      case REGISTER.STATUS:
        return (this.status & ~STATUS.LINE) | this.lineSeen() | (this.power & 8 ? STATUS.VBUS : 0);
      case REGISTER.BUFFERS: return this.buffers;
      case REGISTER.STALL_ARM: return this.stallArm;
      case REGISTER.MUXING: return this.muxing;
      case REGISTER.POWER: return this.power;
      case REGISTER.DIRECT: return this.direct;
      case REGISTER.OVERRIDE: return this.override;
      case REGISTER.RAW: return this.raw();
      case REGISTER.ENABLED: return this.enabled;
      case REGISTER.FORCED: return this.forced;
      case REGISTER.MASKED: return (this.raw() & this.enabled) | this.forced;
      default: return 0;
    }
  }

  writeUint32Atomic(offset, value, type) {
    const apply = (before) => [value, before ^ value, before | value, before & ~value][type];
    switch (offset) {
      case REGISTER.ADDRESS: this.address = apply(this.address); break;
      case REGISTER.MAIN: this.main = apply(this.main); break;
      case REGISTER.SIE: {
        const before = this.sie;
        this.sie = apply(before);
        const isNew = this.sie & ~before & PULLED_UP;
        if (isNew && this.isPlugged) this.after(MILLISECOND, () => this.enumerate());
        break;
      }
      // Written ones clear, and nothing is said about the aliases.
      case REGISTER.STATUS:
      case REGISTER.BUFFERS:
        if (type !== 0) this.misuse('an alias of a register that written ones clear');
        if (offset === REGISTER.STATUS) this.status &= ~value;
        else this.buffers &= ~value;
        break;
      case REGISTER.STALL_ARM: this.stallArm = apply(this.stallArm); break;
      case REGISTER.MUXING:
        this.muxing = apply(this.muxing);
        if (this.muxing & TO_PAD && !(this.direct & this.override / 2 & DIRECT_PULL_UP)) {
          console.error('the host sees the device leave: nothing pulls D+ up');
          this.isPlugged = false;
        }
        // A reset that the controller could not see, because it looked at the pins, is still on.
        if (this.isBusReset && this.seesWires() && !(this.status & STATUS.RESET)) this.seeReset();
        if (this.line() === J) this.connectIfIdle();
        break;
      case REGISTER.POWER: this.power = apply(this.power); break;
      case REGISTER.DIRECT: this.direct = apply(this.direct); break;
      case REGISTER.OVERRIDE: this.override = apply(this.override); break;
      case REGISTER.ENABLED: this.enabled = apply(this.enabled) & 0xfffff; break;
      case REGISTER.FORCED: this.forced = apply(this.forced) & 0xfffff; break;
    }
    this.interrupt();
  }

  // --- The buffers ---

  control(endpoint, isOut) {
    return CONTROLS + 8 * endpoint + (isOut ? 4 : 0);
  }

  word(endpoint, isOut) {
    return this.chip.usbDPRAMView.getUint32(this.control(endpoint, isOut), true);
  }

  endpointWord(endpoint, isOut) {
    return this.chip.usbDPRAMView.getUint32(8 * endpoint + (isOut ? 4 : 0), true);
  }

  /** Whether an endpoint of the port answers. */
  isOn(endpoint, isOut) {
    const word = this.endpointWord(endpoint, isOut);
    return (word & ENDPOINT_ON) !== 0 && (word & TYPE) === BULK;
  }

  place(endpoint, isOut) {
    return endpoint === 0 ? 0x100 : this.endpointWord(endpoint, isOut) & 0xffc0;
  }

  finish(endpoint, isOut, word) {
    this.chip.usbDPRAMView.setUint32(this.control(endpoint, isOut), word, true);
    const index = 2 * endpoint + (isOut ? 1 : 0);
    this.controls[index] = word;
    this.available &= ~(1 << index);
    const reports = endpoint ? this.endpointWord(endpoint, isOut) & REPORTS : this.sie & REPORTS_0;
    if (reports) this.buffers |= 1 << index;
    this.interrupt();
  }

  /** The program may not write to a buffer that the controller has. */
  checkPacket(offset) {
    for (let index = 0; index < 32; index++) {
      if (!(this.available & (1 << index))) continue;
      const from = this.place(index >> 1, (index & 1) !== 0);
      const length = this.controls[index] & LENGTH;
      if (offset >= from && offset < from + length) this.misuse(`a write to buffer ${index}`);
    }
  }

  /** A buffer becomes available some time after the other bits of its control word, and while it
   * is, only the data toggle and the stall may change. */
  checkControl(index, before, value) {
    const changed = value ^ before;
    if (!(value & AVAILABLE)) {
      if (changed) this.settledAt[index] = this.now();
    } else if (before & AVAILABLE) {
      if (changed & ~(STALL | IS_DATA_1)) this.misuse(`a change of buffer ${index}`);
    } else if (changed !== AVAILABLE || this.now() - this.settledAt[index] < SETTLING) {
      this.misuse(`buffer ${index} becomes available too early`);
    }
  }

  /** The chip has written a word of the controller's memory. */
  DPRAMUpdated(offset, value) {
    if (offset >= CONTROLS_END) this.checkPacket(offset);
    if (offset < CONTROLS || offset >= CONTROLS_END) return;
    const [endpoint, isOut] = [(offset - CONTROLS) >> 3, (offset & 4) !== 0];
    const index = (offset - CONTROLS) >> 2;
    this.checkControl(index, this.controls[index], value);
    this.controls[index] = value;
    const bit = 1 << index;
    const wasAvailable = (this.available & bit) !== 0;
    this.available = value & AVAILABLE ? this.available | bit : this.available & ~bit;
    if (endpoint === 0) this.goOnWithTransfer();
    else if (value & AVAILABLE && isOut) this.offer();
    else if (value & AVAILABLE && !wasAvailable) {
      const phase = this.now() - this.frameAt;
      if (this.isFramed && phase >= CRITICAL_FROM && phase <= CRITICAL_TO) {
        const late = phase / MICROSECOND;
        console.error(`erratum E15: endpoint ${endpoint} available ${late} us into a frame`);
        this.isHung = true;
      }
      this.take();
    }
  }

  /** Whether the device answers at all. */
  answers() {
    const isConnected = (this.status & STATUS.CONNECTED) !== 0;
    const has = (register, bits) => (register & bits) === bits;
    const isOn = has(this.main, CONTROLLER_ON) && has(this.sie, PULLED_UP);
    const isWired = has(this.muxing, TO_PHY | SOFT_CONNECT) && has(this.power, POWERED);
    return isConnected && isOn && isWired && this.isPlugged && !this.isHung && !this.isBusReset;
  }

  /** The host asks for the next packet of the device's, if it wants one. */
  take() {
    const endpoint = this.inEndpoint;
    if (this.isTaking || !endpoint || !(this.word(endpoint, false) & AVAILABLE)) return;
    if (!this.isConfigured || !this.isFramed || !this.takes || !this.isOpen) return;
    const length = this.word(endpoint, false) & LENGTH;
    let time = 15 * MICROSECOND + length * 700;
    const left = this.frameAt + MILLISECOND - this.now();
    if (time + 10 * MICROSECOND > left) time += left;
    this.isTaking = true;
    this.after(time, () => {
      this.isTaking = false;
      const word = this.word(endpoint, false);
      if (!this.answers() || !this.isFramed || !this.isOpen || !this.takes) return;
      if (!(word & AVAILABLE) || !(word & FULL) || !this.isOn(endpoint, false)) return;
      const from = this.place(endpoint, false);
      const data = this.chip.usbDPRAM.slice(from, from + (word & LENGTH));
      if (((word & IS_DATA_1) !== 0) === this.inToggle) {
        this.inToggle = !this.inToggle;
        data.forEach((byte) => this.told.byte(byte));
      } else console.error('the host takes a packet for one that it has already');
      this.finish(endpoint, false, word & ~(AVAILABLE | FULL));
    });
  }

  /** The host sends its next packet, if the device has a place for it. */
  offer() {
    const endpoint = this.outEndpoint;
    if (this.isOffering || !endpoint || !(this.word(endpoint, true) & AVAILABLE)) return;
    if (!this.isConfigured || !this.isFramed || !this.isOpen || !this.bytes.length) return;
    this.isOffering = true;
    this.after(50 * MICROSECOND, () => {
      this.isOffering = false;
      const word = this.word(endpoint, true);
      if (!this.answers() || !this.isFramed || !(word & AVAILABLE)) return;
      if (!this.isOn(endpoint, true)) return;
      const data = Uint8Array.from(this.bytes.splice(0, Math.min(word & LENGTH, PACKET)));
      if (((word & IS_DATA_1) !== 0) !== this.outToggle) {
        console.error('the device takes a packet for one that it has already');
        return;
      }
      this.outToggle = !this.outToggle;
      this.chip.usbDPRAM.set(data, this.place(endpoint, true));
      this.finish(endpoint, true, (word & ~(AVAILABLE | LENGTH)) | FULL | data.length);
    });
  }

  // --- The bus ---

  beginFrame() {
    if (!this.isFramed) return;
    this.frame++;
    this.frameAt = this.now();
    if (this.answers()) this.frameBegan = true;
    this.interrupt();
    this.after(MILLISECOND, () => this.beginFrame());
    this.take();
    this.offer();
  }

  beginFrames() {
    if (this.isFramed) return;
    this.isFramed = true;
    this.beginFrame();
  }

  connectIfIdle() {
    const wasForced = this.muxing & TO_PAD;
    if (this.status & STATUS.CONNECTED || this.line() !== J) return;
    if (this.isBusy && !wasForced) return;
    this.after(IDLE_TO_CONNECT, () => {
      if (this.line() !== J || (this.muxing & TO_PAD) !== wasForced) return;
      this.status |= STATUS.CONNECTED;
      this.interrupt();
    });
  }

  suspend() {
    this.isFramed = false;
    this.after(3 * MILLISECOND, () => {
      if (this.isFramed) return;
      this.status |= STATUS.SUSPENDED;
      this.interrupt();
    });
  }

  resume() {
    this.status |= STATUS.RESUME;
    this.interrupt();
    this.after(20 * MILLISECOND, () => this.beginFrames());
  }

  seeReset() {
    this.status = (this.status & ~STATUS.CONNECTED) | STATUS.RESET;
    this.interrupt();
  }

  /** Both wires are low from now on: whatever was on its way is not any more. */
  beginReset() {
    this.generation++;
    this.isBusReset = true;
    this.isConfigured = this.isFramed = this.isTaking = this.isOffering = false;
    this.isStepDue = false;
    this.transfer = null;
    // The controller may not see it. Its address and its buffers stay as they are until the
    // program changes them.
    if (this.seesWires()) this.seeReset();
  }

  endReset() {
    this.isBusReset = false;
    this.connectIfIdle();
  }

  /**
   * The host resets the bus so many times, each time before it has found the device, or when it has
   * just done so, and then finds it. The times are random, by a seed. What the program at the host
   * had sent and was not taken is lost: its port has gone.
   */
  storm(count, seed) {
    const random = numbers(seed);
    const time = (least, factor) => least * factor ** random.next().value;
    this.bytes.length = 0;
    if (!count) return this.enumerate();
    this.beginReset();
    // From 10 microseconds to 20 milliseconds; a host that keeps to the rules takes 10 ms at least.
    this.later(time(10 * MICROSECOND, 2000), () => {
      this.endReset();
      this.search();
      // Sometimes it gives up early, before or while it finds the device; sometimes it is through.
      const next = Math.floor(random.next().value * 2 ** 24);
      this.later(time(20 * MICROSECOND, 5000), () => this.storm(count - 1, next));
    });
  }

  /** Finds the device and opens its port. */
  async enumerate() {
    this.beginReset();
    await this.pause(10 * MILLISECOND);
    this.endReset();
    await this.search();
  }

  /** Finds the device behind a reset. */
  async search() {
    const { generation } = this;
    await this.pause(MILLISECOND);
    this.beginFrames();
    await this.pause(4 * MILLISECOND);
    this.hostAddress = 0;
    const device = await this.request([0x80, 6, 0, 1, 0, 0, 64, 0]);
    if (generation !== this.generation) return;
    if (!device) {
      // It did not hear, or is not ready: again.
      this.isFramed = false;
      this.after(10 * MILLISECOND, () => this.enumerate());
      return;
    }
    await this.request([0, 5, 1, 0, 0, 0, 0, 0]);
    this.hostAddress = 1;
    await this.pause(2 * MILLISECOND);
    const configuration = await this.request([0x80, 6, 0, 2, 0, 0, 255, 0]);
    const serial = await this.request([0x80, 6, device[16], 3, 9, 4, 255, 0]);
    if (serial) this.told.serialNumber(Buffer.from(serial.slice(2)).toString('utf16le'));
    this.findEndpoints(configuration ?? []);
    await this.request([0, 9, 1, 0, 0, 0, 0, 0]);
    this.inToggle = this.outToggle = false;
    this.isConfigured = true;
    if (this.isOpen) await this.setLine(this.rate, true);
    this.take();
    this.offer();
  }

  findEndpoints(descriptors) {
    for (let at = 0, isData = false; at < descriptors.length; at += Math.max(descriptors[at], 1)) {
      if (descriptors[at + 1] === 4) isData = descriptors[at + 5] === 10;
      if (descriptors[at + 1] !== 5 || !isData) continue;
      const address = descriptors[at + 2];
      if (address & 0x80) this.inEndpoint = address & 15;
      else this.outEndpoint = address & 15;
    }
  }

  /** Opens the port or closes it, at a rate: one after the other. */
  async setLine(rate, isOpen) {
    const { generation } = this;
    const before = this.lastSet;
    let done;
    this.lastSet = new Promise((resolve) => (done = resolve));
    this.lastSet.generation = generation;
    if (before?.generation === generation) await before;
    await this.changeLine(rate, isOpen);
    done();
  }

  /** A line coding, then DTR. */
  async changeLine(rate, isOpen) {
    this.rate = rate;
    if (isOpen) this.isOpen = true;
    if (!this.isConfigured) return;
    const coding = [rate & 255, (rate >> 8) & 255, (rate >> 16) & 255, 0, 0, 0, 8];
    await this.request([0x21, 0x20, 0, 0, 0, 0, 7, 0], coding);
    await this.request([0x21, 0x22, isOpen ? 3 : 0, 0, 0, 0, 0, 0]);
    this.isOpen = isOpen;
    this.take();
    this.offer();
  }

  /** Makes a request whose data the device cannot take, so that it must refuse it. */
  async sendTooMuch() {
    const began = this.now();
    const answer = await this.request(
      [0x21, 0x20, 0, 0, 0, 0, TOO_MUCH, 0], new Array(TOO_MUCH).fill(0x55));
    if (answer) console.error('the device accepts a request with too much data');
    else if (this.now() - began > 100 * MILLISECOND) {
      console.error('the device neither accepts nor refuses a request with too much data');
    }
  }

  /** Makes requests behind which packets begin anew with DATA0, each way (USB 2.0, 9.1.1.5 and
   * 9.4.5). The host lets its other packets rest meanwhile. */
  async beginAnew(requests) {
    this.isConfigured = false;
    await this.pause(MILLISECOND);
    for (const request of requests) {
      if (!(await this.request(request))) console.error('the device refuses to begin anew');
    }
    this.inToggle = this.outToggle = false;
    this.isConfigured = true;
    this.take();
    this.offer();
  }

  pause(nanos) {
    return { then: (resolve) => this.after(nanos, () => resolve()) };
  }

  // --- Control transfers ---

  /** The answer to a request: bytes, or null if the device stalls it or is silent. */
  request(setup, data) {
    return {
      then: (resolve) => {
        this.after(100 * MICROSECOND, () => {
          if (!this.answers() || this.address !== this.hostAddress) {
            return this.after(5 * MILLISECOND, () => resolve(null));
          }
          this.chip.usbDPRAM.set(setup);
          this.stallArm &= ~3;
          this.status |= STATUS.SETUP;
          const isIn = (setup[0] & 0x80) !== 0;
          const length = setup[6] | (setup[7] << 8);
          const transfer = { resolve, isIn, length, data, sent: 0, got: [], toggle: true };
          transfer.isStatus = !isIn && !length;
          this.transfer = transfer;
          this.interrupt();
          this.after(500 * MILLISECOND, () => this.transfer === transfer && this.endTransfer(null));
        });
      },
    };
  }

  endTransfer(result) {
    const { resolve } = this.transfer;
    this.transfer = null;
    resolve(result);
  }

  goOnWithTransfer() {
    if (!this.transfer || this.isStepDue) return;
    this.isStepDue = true;
    this.after(20 * MICROSECOND, () => {
      this.isStepDue = false;
      if (this.transfer && this.answers()) this.stepTransfer();
    });
  }

  stepTransfer() {
    const { transfer } = this;
    // Until the setup packet is taken in, what is there is of the transfer before.
    if (this.status & STATUS.SETUP) return this.goOnWithTransfer();
    const isOut = transfer.isStatus ? transfer.isIn : !transfer.isIn;
    const word = this.word(0, isOut);
    if (word & STALL && this.stallArm & (isOut ? 2 : 1)) return this.endTransfer(null);
    if (!(word & AVAILABLE)) return;
    const isData1 = (word & IS_DATA_1) !== 0;
    if (isData1 !== (transfer.isStatus || transfer.toggle)) {
      console.error('a packet of a control transfer has the wrong toggle');
      return this.endTransfer(null);
    }
    if (isOut) {
      const { isStatus, sent } = transfer;
      const data = isStatus ? [] : transfer.data.slice(sent, sent + PACKET);
      if (data.length > (word & LENGTH)) return this.misuse('no room for data of a request');
      this.chip.usbDPRAM.set(data, 0x100);
      this.finish(0, true, (word & ~(AVAILABLE | LENGTH)) | FULL | data.length);
      if (transfer.isStatus) return this.endTransfer(transfer.got);
      transfer.toggle = !transfer.toggle;
      transfer.sent += data.length;
      transfer.isStatus = transfer.sent >= transfer.length;
    } else {
      if (!(word & FULL)) return;
      const length = word & LENGTH;
      transfer.got.push(...this.chip.usbDPRAM.slice(0x100, 0x100 + length));
      this.finish(0, false, word & ~(AVAILABLE | FULL));
      if (transfer.isStatus) return this.endTransfer(transfer.got);
      transfer.toggle = !transfer.toggle;
      if (length < PACKET || transfer.got.length >= transfer.length) transfer.isStatus = true;
    }
    this.goOnWithTransfer();
  }

  // --- What the test says ---

  /** A byte for the device. */
  send(byte) {
    this.bytes.push(byte);
  }

  act(what) {
    if (what === HOST.PLUGS_IN || what === HOST.PLUGS_INTO_BUSY) {
      this.isPlugged = true;
      this.isBusy = what === HOST.PLUGS_INTO_BUSY;
      if (this.sie & PULLED_UP) this.after(MILLISECOND, () => this.enumerate());
    } else if (what === HOST.UNPLUGS) {
      this.isPlugged = this.isConfigured = false;
      this.suspend();
    } else if (what === HOST.HAS_NO_POWER) {
      // It holds both wires low, which the controller takes for a reset that does not end.
      this.generation++;
      this.isBusReset = true;
      this.isConfigured = this.isFramed = false;
      this.status = (this.status & ~STATUS.CONNECTED) | STATUS.RESET;
      this.interrupt();
    } else if (what === HOST.SENDS_TOO_MUCH) this.sendTooMuch();
    else if (what === HOST.CONFIGURES_AGAIN) this.beginAnew([[0, 9, 1, 0, 0, 0, 0, 0]]);
    else if (what === HOST.LIFTS_HALTS) {
      const endpoints = [this.outEndpoint, 0x80 | this.inEndpoint];
      this.beginAnew(endpoints.map((endpoint) => [2, 1, 0, 0, endpoint, 0, 0, 0]));
    } else if (what === HOST.SUSPENDS) this.suspend();
    else if (what === HOST.RESUMES) this.resume();
    else {
      this.takes = what === HOST.TAKES;
      this.take();
    }
  }
}
