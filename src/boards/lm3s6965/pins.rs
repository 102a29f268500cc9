//! The machine's pins, all on port B.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use penup::board_table::Pins;
use penup::machine::{Axes, PinOrder};

use super::registers::{GPIO_B, SYSTEM_CONTROL};

mod offset {
    pub const DIRECTION: usize = 0x400;
    pub const ALTERNATE_FUNCTION: usize = 0x420;
    pub const DIGITAL_ENABLE: usize = 0x51C;
    pub const LOCK: usize = 0x520;
    pub const COMMIT: usize = 0x524;
    /// In system control.
    pub const GPIO_CLOCKS: usize = 0x108;
}
const PORT_B_CLOCK: u32 = 1 << 1;
/// The key that unlocks the register that lets PB7 be used for something else than JTAG's reset.
const UNLOCK: u32 = 0x1ACC_E551;

/// Pin `NUMBER` of port B as an output.
pub struct Pin<const NUMBER: u8>(());

/// The pin of the pen.
pub type PenPin = Pin<{ PINS.pen }>;

/// The pins of the axes.
pub struct AxisPins(());

/// The pins that the step interrupt moves.
pub struct MotorPins {
    /// The pins of the axes and of the pen's motor.
    pub axes: AxisPins,
    /// The pin of the pen.
    pub pen: PenPin,
}

const PINS: Pins = super::ROW.pins;
const STEP_X: u32 = 1 << PINS.step_x;
const STEP_Y: u32 = 1 << PINS.step_y;
const ENABLE: u32 = 1 << PINS.enable;
const AXES: u32 = STEP_X | STEP_Y | 1 << PINS.dir_x | 1 << PINS.dir_y | ENABLE;
const STEP_Z: u32 = 1 << PINS.step_z;
const DIRECTION_Z: u32 = 1 << PINS.dir_z;
const ALL: u32 = AXES | STEP_Z | DIRECTION_Z | 1 << PINS.pen;

impl Axes for AxisPins {
    /// The bits STEP_X, STEP_Y, DIR_X, DIR_Y and ENABLE of an event. A high direction pin counts
    /// up, and a low enable pin switches the drivers on.
    const ORDER: &'static PinOrder = &PinOrder::new(
        [PINS.step_x, PINS.step_y, PINS.dir_x, PINS.dir_y, PINS.enable],
        (AXES & !STEP_X & !STEP_Y) as u8,
    );

    #[inline(always)]
    fn set(&mut self, levels: u32) {
        write(AXES, levels);
    }

    fn set_z_axis(&mut self, step: bool, down: bool) {
        let levels = if step { STEP_Z } else { 0 } | if down { DIRECTION_Z } else { 0 };
        write(STEP_Z | DIRECTION_Z, levels);
    }

    #[inline(always)]
    fn end_pulses(&mut self) {
        write(STEP_X | STEP_Y | STEP_Z, 0);
    }
}

impl<const NUMBER: u8> ErrorType for Pin<NUMBER> {
    type Error = Infallible;
}

impl<const NUMBER: u8> OutputPin for Pin<NUMBER> {
    #[inline(always)]
    fn set_low(&mut self) -> Result<(), Infallible> {
        write(1 << NUMBER, 0);
        Ok(())
    }

    #[inline(always)]
    fn set_high(&mut self) -> Result<(), Infallible> {
        write(1 << NUMBER, 1 << NUMBER);
        Ok(())
    }
}

/// Sets the pins of `mask` to `levels` in one store and leaves the others unchanged. Bits 2 to 9 of
/// the address of the data register are its mask.
#[inline(always)]
fn write(mask: u32, levels: u32) {
    GPIO_B.write((mask << 2) as usize, levels);
}

/// Switches the drivers off, raises the pen and sets the step pins low. It is safe at any time,
/// including in a fault.
pub fn release() {
    write(ALL, ENABLE);
}

/// Makes the pins outputs, with the levels of [`release`].
pub fn set_up() -> MotorPins {
    SYSTEM_CONTROL.set_bits(offset::GPIO_CLOCKS, PORT_B_CLOCK);
    // The port responds three cycles after its clock is on; this read takes longer.
    SYSTEM_CONTROL.read(offset::GPIO_CLOCKS);
    GPIO_B.write(offset::LOCK, UNLOCK);
    GPIO_B.write(offset::COMMIT, ALL);
    GPIO_B.write(offset::ALTERNATE_FUNCTION, GPIO_B.read(offset::ALTERNATE_FUNCTION) & !ALL);
    GPIO_B.set_bits(offset::DIRECTION, ALL);
    release();
    GPIO_B.set_bits(offset::DIGITAL_ENABLE, ALL);
    MotorPins { axes: AxisPins(()), pen: Pin(()) }
}
