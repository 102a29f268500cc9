//! The PIO state machine and the DMA channel of the steps: their registers, the program, and the
//! commands to them.

use penup::motion::{StepEvent, TICKS_PER_SECOND};

use super::word_ring::{Ring, ring_address};
use crate::boards::pico::clock;
use crate::boards::pico::pins::FIRST_MOTOR_PIN;
use crate::boards::pico::registers::{self, DMA, PIO0, Put, reset};

/// The cycles of one pass of the counting loop, which is one tick.
const CYCLES_PER_TICK: u32 = clock::HERTZ / TICKS_PER_SECOND;
const _: () = assert!(CYCLES_PER_TICK == 5 && clock::HERTZ.is_multiple_of(TICKS_PER_SECOND));
/// The address at which the program continues, in the bits of a word that hold it.
pub mod target {
    /// Sets the pins, and causes the interrupt in which the core moves the pen.
    pub const MOVE_PEN: u32 = 0;
    /// Sets the pins, and counts the ticks.
    pub const WAIT: u32 = 1 << 5;
    /// Sets the pins, ends the pulse after its width, and counts the ticks.
    pub const PULSE: u32 = 6 << 5;
}
/// The bits of a word that hold the address.
pub const TARGETS: u32 = 7 << 5;
/// The ticks that a word that only waits takes in addition to the count that it carries.
pub const WAIT_TICKS: u32 = 2;
/// The ticks that a word that moves the pen takes in addition to the count that it carries.
pub const PEN_TICKS: u32 = 3;
/// The ticks that a word that pulses a step pin takes in addition to the count that it carries and
/// the width of the pulse.
pub const PULSE_TICKS: u32 = 2;
/// The ticks by which a pulse is wider than the count that the state machine gets for its width.
const WIDTH_TICKS: u32 = 2;

/// The bit that lets state machine 0 run.
const ENABLE: u32 = 1;
/// The bit that sets state machine 0 to its initial state.
const RESTART: u32 = 1 << 4;
/// The bit of the register `FDEBUG` for a state machine that found its queue empty.
pub const STALLED: u32 = 1 << 24;
/// The bits of the register `FLEVEL` that count the words in the queue of the state machine.
pub const LEVEL: u32 = 0xF;
/// The number of words that this queue holds: both of its halves serve the output.
pub const QUEUE_WORDS: u32 = 8;
/// The flag by which the state machine causes an interrupt: its bit in the registers of flags and
/// of interrupts.
pub const FLAG: u32 = 1;
/// The bit of flag 0 in the mask of the interrupts.
const FLAG_INTERRUPT: u32 = 1 << 8;

/// Instructions that the core makes the state machine execute.
pub mod order {
    use pio::{
        InstructionOperands, JmpCondition, MovDestination, MovOperation, MovSource, SetDestination,
    };

    /// Makes the program wait for its first word.
    pub const JUMP_TO_START: u16 =
        InstructionOperands::JMP { condition: JmpCondition::Always, address: super::START }
            .encode();
    /// Takes the width of the pulses from the queue.
    pub const PULL: u16 = InstructionOperands::PULL { if_empty: false, block: true }.encode();
    /// Moves the width of the pulses, after [`PULL`], to where the program reads it.
    pub const KEEP_WIDTH: u16 = InstructionOperands::MOV {
        destination: MovDestination::ISR,
        op: MovOperation::None,
        source: MovSource::OSR,
    }
    .encode();
    /// Takes a word from the queue, if there is one.
    pub const PULL_WITHOUT_WAITING: u16 =
        InstructionOperands::PULL { if_empty: false, block: false }.encode();
    /// Sets the pins; their levels are in the lowest 5 bits.
    pub const SET_PINS: u16 =
        InstructionOperands::SET { destination: SetDestination::PINS, data: 0 }.encode();
    /// Makes pins outputs, those of the mask in the lowest 5 bits.
    pub const SET_DIRECTIONS: u16 =
        InstructionOperands::SET { destination: SetDestination::PINDIRS, data: 0 }.encode();
}

/// The bit of DMA channel 0 in the registers that have one bit for each channel.
pub const CHANNEL: u32 = 1;
/// The bit of a channel's control register that says that it is transferring.
pub const BUSY: u32 = 1 << 24;
/// Enabled, high priority, words, reading around the ring, no chain, paced by the state machine.
const FEED: u32 = 1 | 1 << 1 | 2 << 2 | 1 << 4 | size_of::<Ring>().trailing_zeros() << 6;

/// The address at which the program waits for the next word.
pub const START: u8 = 3;
/// The bits of a word that hold the levels of the pins.
pub const LEVELS: u32 = 0x1F;
/// The bits of the levels that are step pulses.
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
        PIO0.instr_mem(index).put(u32::from(instruction));
    }
    // The program wraps at the end of the memory, which it does not reach.
    PIO0.sm(0).sm_execctrl().reset();
    PIO0.sm(0).sm_shiftctrl().write(|w| {
        // Joining the slots of the receiver to those of the sender gives 8 words.
        w.in_shiftdir().set_bit().out_shiftdir().set_bit().fjoin_tx().set_bit()
    });
    set_pins(RELEASED);
    PIO0.sm_irq(0).irq_inte().put(FLAG_INTERRUPT);
    order(order::JUMP_TO_START);

    // SAFETY: the channel reads the ring of atomics, and writes to the state machine.
    let dma = unsafe { DMA.registers() };
    dma.ch(0).ch_read_addr().put(ring_address(0));
    dma.ch(0).ch_write_addr().put(PIO0.txf(0).as_ptr() as u32);
    // This register does not start the channel.
    dma.ch(0).ch_al1_ctrl().put(FEED);
    dma.inte0().put(CHANNEL);
}

/// Makes the state machine execute an instruction at once.
pub fn order(instruction: u16) {
    PIO0.sm(0).sm_instr().put(u32::from(instruction));
}

/// Makes the pins outputs with these levels, at once. The program's `set` instruction affects only
/// the pulse pins.
pub fn set_pins(levels: u32) {
    assign_pins(LEVELS.count_ones());
    order(order::SET_PINS | levels as u16);
    order(order::SET_DIRECTIONS | LEVELS as u16);
    assign_pins(PULSES.count_ones());
}

/// Assigns the first `count` pins to the instruction `set`, and all of them to `out`.
fn assign_pins(count: u32) {
    let count = count as u8;
    // SAFETY: these are numbers and counts of pins of the board.
    PIO0.sm(0).sm_pinctrl().write(|w| unsafe {
        w.set_count().bits(count).out_count().bits(LEVELS.count_ones() as u8);
        w.set_base().bits(FIRST_MOTOR_PIN).out_base().bits(FIRST_MOTOR_PIN)
    });
}

/// Starts the state machine with pulses of this width. Its queue must be empty.
pub fn begin(pulse_ticks: u32) {
    PIO0.ctrl().put(RESTART);
    PIO0.txf(0).put(pulse_ticks.saturating_sub(WIDTH_TICKS));
    order(order::PULL);
    order(order::KEEP_WIDTH);
    order(order::JUMP_TO_START);
    PIO0.ctrl().put(ENABLE);
}

/// Stops the state machine for good with the drivers off, after a fault.
pub fn release() {
    PIO0.ctrl().put(0);
    set_pins(RELEASED);
}
