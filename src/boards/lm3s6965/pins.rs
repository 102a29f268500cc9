//! The machine's pins, all on port B.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use penup::board_table::Pins;
use penup::machine::{Axes, Pen, PinOrder, Solenoid};

use super::registers::{GPIO_B, SYSTEM_CONTROL};
use super::steps::STATE;
use crate::boards::peripheral::Offset;

/// The registers of the port that are used here, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register that says, by one bit for each pin, which pins of a port are outputs.
    pub const DIRECTION: Offset = Offset::new(0x400);
    /// The register that says, by one bit for each pin, which pins a peripheral of the chip uses
    /// instead of the port.
    pub const ALTERNATE_FUNCTION: Offset = Offset::new(0x420);
    /// The register that says, by one bit for each pin, which pins are digital.
    pub const DIGITAL_ENABLE: Offset = Offset::new(0x51C);
    /// The register that lets [`COMMIT`] be written once [`UNLOCK`](super::UNLOCK) is written to
    /// it.
    pub const LOCK: Offset = Offset::new(0x520);
    /// The register that says, by one bit for each pin, which of the protected pins may get another
    /// function.
    pub const COMMIT: Offset = Offset::new(0x524);
    /// The register of system control that switches the clocks of the ports on.
    pub const GPIO_CLOCKS: Offset = Offset::new(0x108);
}
/// The bit that switches the clock of port B on.
const PORT_B_CLOCK: u32 = 1 << 1;
/// The key that unlocks the register that lets PB7 be used for something else than JTAG's reset.
const UNLOCK: u32 = 0x1ACC_E551;

/// Pin `NUMBER` of port B as an output.
pub struct Pin<const NUMBER: u8>(());

/// The pin of the solenoid that lowers the pen.
pub type PenPin = Pin<{ PINS.pen }>;

/// The pins of the motors. The value is proof that they are set up.
pub struct AxisPins(());

/// What [`set_up`] returns: the pins that the step interrupt moves.
pub struct MotorPins {
    /// The pins of the axes and of the pen's motor.
    pub axes: AxisPins,
    /// The pin of the solenoid that lowers the pen.
    pub pen: PenPin,
}

/// The numbers of the machine's pins, from the table of the boards.
const PINS: Pins = super::ROW.pins;
/// The bit of the step pin of x.
const STEP_X: u32 = 1 << PINS.step_x;
/// The bit of the step pin of y.
const STEP_Y: u32 = 1 << PINS.step_y;
/// The bit of the pin that enables the motor drivers while it is low.
const ENABLE: u32 = 1 << PINS.enable;
/// The bits of the pins that an event of the axes sets.
const AXES: u32 = STEP_X | STEP_Y | 1 << PINS.dir_x | 1 << PINS.dir_y | ENABLE;
/// The bit of the step pin of the motor that lifts the pen.
const STEP_Z: u32 = 1 << PINS.step_z;
/// The bit of the direction pin of that motor.
const DIRECTION_Z: u32 = 1 << PINS.dir_z;
/// The bits of all pins of the machine.
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

/// Sets the pins of `mask` to `levels` in one store and leaves the others unchanged.
#[inline(always)]
fn write(mask: u32, levels: u32) {
    GPIO_B.write(Offset::of_pins(mask as u8), levels);
}

/// Switches the drivers off, raises the pen and sets the step pins low. It is safe at any time,
/// including in a fault.
pub fn release() {
    Solenoid(Pin::<{ PINS.pen }>(())).set_height(STATE.up_height());
    write(ALL & !(1 << PINS.pen), ENABLE);
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
