//! The PIO state machine and the DMA channel of the steps: their registers, the program, and the
//! commands to them.

use penup::motion::{StepEvent, TICKS_PER_SECOND};

use super::word_ring::{Ring, ring_address};
use crate::boards::pico::clock;
use crate::boards::pico::pins::FIRST_MOTOR_PIN;
use crate::boards::pico::registers::{self, DMA, PIO0, reset};

/// The cycles of one pass of the counting loop, which is one tick.
const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(CYCLES_PER_TICK == 5 && clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));
/// The address at which the program continues, in the bits of a word that hold it.
pub mod target {
    pub const MOVE_PEN: u32 = 0;
    pub const WAIT: u32 = 1 << 5;
    pub const PULSE: u32 = 6 << 5;
}
pub const TARGETS: u32 = 7 << 5;
/// The ticks that a word takes beyond its count, by its target. A pulse takes its width in
/// addition.
pub const WAIT_TICKS: u32 = 2;
pub const PEN_TICKS: u32 = 3;
pub const PULSE_TICKS: u32 = 2;
/// The ticks of a pulse beyond its count.
const WIDTH_TICKS: u32 = 2;

/// Registers of the PIO block and its state machine 0.
pub mod machine {
    pub const CONTROL: usize = 0x000;
    pub const FIFO_DEBUG: usize = 0x008;
    pub const FIFO_LEVEL: usize = 0x00C;
    pub const SEND: usize = 0x010;
    pub const FLAGS: usize = 0x030;
    pub const INSTRUCTIONS: usize = 0x048;
    pub const EXECUTION: usize = 0x0CC;
    pub const SHIFT: usize = 0x0D0;
    pub const ADDRESS: usize = 0x0D4;
    pub const INSTRUCTION: usize = 0x0D8;
    pub const PINS: usize = 0x0DC;
    pub const INTERRUPT_ENABLE: usize = 0x12C;
}
const ENABLE: u32 = 1;
const RESTART: u32 = 1 << 4;
pub const STALLED: u32 = 1 << 24;
pub const LEVEL: u32 = 0xF;
/// Flag 0, in the register of flags and in that of interrupts.
pub const FLAG: u32 = 1;
const FLAG_INTERRUPT: u32 = 1 << 8;
const SHIFT_RIGHT_BOTH: u32 = 0b11 << 18;
/// Joins the slots of the receiver to those of the sender, which gives 8 words.
const JOIN_SENDER: u32 = 1 << 30;

/// Instructions that the core makes the state machine execute.
pub mod order {
    pub const JUMP_TO_START: u32 = super::START;
    /// Moves the width of the pulses from the queue to where the program reads it.
    pub const PULL: u32 = 0x80A0;
    pub const KEEP_WIDTH: u32 = 0xA0C7;
    pub const PULL_WITHOUT_WAITING: u32 = 0x8080;
    pub const SET_PINS: u32 = 0xE000;
    pub const SET_DIRECTIONS: u32 = 0xE080;
}

/// The registers of DMA channel 0, and those common to all channels.
pub mod channel {
    pub const READ_ADDRESS: usize = 0x00;
    pub const WRITE_ADDRESS: usize = 0x04;
    pub const COUNT: usize = 0x08;
    /// Writing this register does not start the channel.
    pub const CONTROL: usize = 0x10;
    /// Writing the count here starts the channel.
    pub const START: usize = 0x1C;
    pub const INTERRUPT_ENABLE: usize = 0x404;
    pub const INTERRUPT: usize = 0x40C;
    pub const ABORT: usize = 0x444;
}
pub const CHANNEL: u32 = 1;
pub const BUSY: u32 = 1 << 24;
/// Enabled, high priority, words, reading around the ring, no chain, paced by `SEND`.
const FEED: u32 = 1 | 1 << 1 | 2 << 2 | 1 << 4 | size_of::<Ring>().trailing_zeros() << 6;

/// The address at which the program waits for the next word.
const START: u32 = 3;
pub const LEVELS: u32 = 0x1F;
pub const PULSES: u32 = (StepEvent::STEP_X | StepEvent::STEP_Y) as u32;
/// The levels without pulses and with the drivers off; their pin is active low.
pub const RELEASED: u32 = StepEvent::DRIVERS_ON as u32;

/// Sets up the state machine and the channel. Afterwards the pins are outputs and the drivers are
/// off.
pub fn set_up() {
    registers::restart(reset::PIO0 | reset::DMA);
    let program = pio::pio_asm!(
        ".origin 0",
        "move_pen:",
        "    irq set 0 [4]",
        "rest:",
        "    out x, 24",
        "count:",
        "    jmp x-- count [4]",
        "start:",
        "    pull block",
        "    out pins, 5",
        "    out pc, 3 [1]",
        "pulse:",
        "    mov x, isr [1]",
        "high:",
        "    jmp x-- high [4]",
        "    set pins, 0 [1]",
        "    jmp rest",
    );
    for (index, &instruction) in program.program.code.iter().enumerate() {
        PIO0.write(machine::INSTRUCTIONS + 4 * index, u32::from(instruction));
    }
    const WRAP_AT_END: u32 = 31 << 12;
    PIO0.write(machine::EXECUTION, WRAP_AT_END);
    PIO0.write(machine::SHIFT, SHIFT_RIGHT_BOTH | JOIN_SENDER);
    set_pins(RELEASED);
    PIO0.write(machine::INTERRUPT_ENABLE, FLAG_INTERRUPT);
    order(order::JUMP_TO_START);

    DMA.write(channel::READ_ADDRESS, ring_address(0));
    DMA.write(channel::WRITE_ADDRESS, PIO0.address(machine::SEND));
    DMA.write(channel::CONTROL, FEED);
    DMA.write(channel::INTERRUPT_ENABLE, CHANNEL);
}

/// Makes the state machine execute an instruction at once.
pub fn order(instruction: u32) {
    PIO0.write(machine::INSTRUCTION, instruction);
}

/// Makes the pins outputs with these levels, at once. The program's `set` instruction affects only
/// the pulse pins.
pub fn set_pins(levels: u32) {
    let first = FIRST_MOTOR_PIN;
    let pins = |set: u32| set.count_ones() << 26 | LEVELS.count_ones() << 20 | first << 5 | first;
    PIO0.write(machine::PINS, pins(LEVELS));
    order(order::SET_PINS | levels);
    order(order::SET_DIRECTIONS | LEVELS);
    PIO0.write(machine::PINS, pins(PULSES));
}

/// Starts the state machine with pulses of this width. Its queue must be empty.
pub fn begin(pulse_ticks: u32) {
    PIO0.write(machine::CONTROL, RESTART);
    PIO0.write(machine::SEND, pulse_ticks.saturating_sub(WIDTH_TICKS));
    order(order::PULL);
    order(order::KEEP_WIDTH);
    order(order::JUMP_TO_START);
    PIO0.write(machine::CONTROL, ENABLE);
}

/// Stops the state machine for good with the drivers off, after a fault.
pub fn release() {
    PIO0.write(machine::CONTROL, 0);
    set_pins(RELEASED);
}
