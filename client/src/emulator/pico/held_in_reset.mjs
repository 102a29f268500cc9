// Ends the emulation where a program uses a peripheral that is held in reset or has no clock,
// because the chip does not say what comes of that.
//
// When the chip begins, all peripherals are held in reset but those that the boot ROM needs for
// itself (RP2040 data sheet, 2.14, and the sources of the boot ROM). A program releases what it
// uses by the register RESET, and must wait until its bit is set in RESET_DONE. So here it may use
// a peripheral only when it has seen that bit. rp2040js lets it use all of them at any time.

const RESETS = 0x4000c;
const RESET = 0x0;
const RESET_DONE = 0x8;
const ALL = 0x1ffffff;
const IO_QSPI = 1 << 6;
const PADS_QSPI = 1 << 9;
const TIMER = 1 << 21;
const RELEASED_BY_BOOT_ROM = IO_QSPI | PADS_QSPI | TIMER;

/** The bit that runs the clock of a peripheral, in the control register of that clock. */
const CLOCK_ENABLED = 1 << 11;
const WATCHDOG = 0x40058;
const TICK = 0x2c;
const TICK_CYCLES = 0x1ff;
const TICK_ENABLED = 1 << 9;

/** The names of the peripherals by the upper bits of their addresses, and their bits in RESET. */
const HELD = new Map([
  [0x40000, ['SYSINFO', 19]], [0x40004, ['SYSCFG', 18]], [0x40014, ['IO_BANK0', 5]],
  [0x40018, ['IO_QSPI', 6]], [0x4001c, ['PADS_BANK0', 8]], [0x40020, ['PADS_QSPI', 9]],
  [0x40028, ['PLL_SYS', 12]], [0x4002c, ['PLL_USB', 13]], [0x40030, ['BUSCTRL', 1]],
  [0x40034, ['UART0', 22]], [0x40038, ['UART1', 23]], [0x4003c, ['SPI0', 16]],
  [0x40040, ['SPI1', 17]], [0x40044, ['I2C0', 3]], [0x40048, ['I2C1', 4]], [0x4004c, ['ADC', 0]],
  [0x40050, ['PWM', 14]], [0x40054, ['TIMER', 21]], [0x4005c, ['RTC', 15]],
  [0x4006c, ['TBMAN', 20]], [0x50000, ['DMA', 2]], [0x50100, ['the memory of USBCTRL', 24]],
  [0x50110, ['USBCTRL', 24]], [0x50200, ['PIO0', 10]], [0x50300, ['PIO1', 11]],
]);

/** Lets a new chip hold its peripherals in reset until the program has seen them released. */
export function holdInReset(chip) {
  const resets = chip.peripherals[RESETS];
  resets.reset = ALL & ~RELEASED_BY_BOOT_ROM;
  /** The bits of those that the program may use. */
  let usable = RELEASED_BY_BOOT_ROM;
  const read = resets.readUint32.bind(resets);
  resets.readUint32 = (offset) => {
    if (offset !== RESET_DONE) return read(offset);
    usable = ALL & ~resets.reset;
    return usable;
  };
  const write = resets.writeUint32.bind(resets);
  resets.writeUint32 = (offset, value) => {
    write(offset, value);
    if (offset === RESET) usable &= ~resets.reset;
  };

  const watchdog = chip.peripherals[WATCHDOG];
  let tick = 0;
  const writeWatchdog = watchdog.writeUint32.bind(watchdog);
  watchdog.writeUint32 = (offset, value) => {
    if (offset === TICK) tick = value;
    writeWatchdog(offset, value);
  };
  const ticksEachMicrosecond = () =>
    (tick & TICK_ENABLED) !== 0 && (tick & TICK_CYCLES) * 1e6 === chip.clocks.refFreq;
  /** Whether a peripheral that needs more than the clock of the core has it. */
  const hasClock = {
    UART0: () => chip.clocks.periFreq !== 0,
    UART1: () => chip.clocks.periFreq !== 0,
    SPI0: () => chip.clocks.periFreq !== 0,
    SPI1: () => chip.clocks.periFreq !== 0,
    USBCTRL: () => (chip.clocks.usbCtrl & CLOCK_ENABLED) !== 0,
    ADC: () => (chip.clocks.adcCtrl & CLOCK_ENABLED) !== 0,
    RTC: () => (chip.clocks.rtcCtrl & CLOCK_ENABLED) !== 0,
    TIMER: ticksEachMicrosecond,
  };

  /** Why a peripheral must not be used now, if so. */
  const reason = (name, mask) => {
    if (resets.reset & mask) return ', which is held in reset';
    if (!(usable & mask)) return ' before it has seen its bit in RESET_DONE';
    return hasClock[name] && !hasClock[name]() ? ', which has no clock' : null;
  };
  const check = (address) => {
    const held = HELD.get(((address >>> 14) << 2) >>> 0);
    if (held === undefined) return;
    const [name, bit] = held;
    const why = reason(name, 1 << bit);
    if (why === null) return;
    throw new Error(`the program uses ${name} at 0x${(address >>> 0).toString(16)}${why}`);
  };
  // What reads less than a word of a peripheral reads the word.
  for (const name of ['readUint32', 'writeUint32', 'writeUint16', 'writeUint8']) {
    const access = chip[name].bind(chip);
    chip[name] = (address, value) => {
      if (address >>> 28 === 4 || address >>> 28 === 5) check(address);
      return access(address, value);
    };
  }
}
