//! The pins of the motors, which a board has in an order of its own.

use crate::motion::StepEvent;
use core::convert::Infallible;
use embedded_hal::digital::{OutputPin, PinState};

/// The pins of a machine, one by one. A high step pin makes a step, a high direction pin counts up
/// (unless it is inverted), and a high enable pin switches the drivers on. A board with other
/// levels wraps the pin.
#[derive(Debug)]
pub struct Pins<SX, DX, SY, DY, E, SZ, DZ> {
    /// The step pin of x.
    pub step_x: SX,
    /// The direction pin of x.
    pub direction_x: DX,
    /// The step pin of y.
    pub step_y: SY,
    /// The direction pin of y.
    pub direction_y: DY,
    /// The enable pin of all drivers.
    pub enable: E,
    /// The step pin of z.
    pub step_z: SZ,
    /// The direction pin of z; a high level lowers the pen.
    pub direction_z: DZ,
}

/// The order in which the axes' pins, at most 5, are written: which pin has which bit.
#[derive(Debug)]
pub struct PinOrder {
    /// The levels of the pins for each combination of the levels of a [`StepEvent`].
    pub(super) pins: [u8; 32],
    /// The levels of a [`StepEvent`] for each combination of the levels of the pins.
    pub(super) levels: [u8; 32],
    /// The bits of the step pins, which a step sets only for a short time.
    pub(super) pulses: u8,
}

impl PinOrder {
    /// The order of the bits in a [`StepEvent`].
    pub const OF_EVENTS: Self = Self::new([0, 1, 2, 3, 4], 0);

    /// Creates the order in which bit i of an event, for i from 0 to 4, is pin number `numbers[i]`.
    /// The numbers are a permutation of 0 to 4. `inverted` is the mask of inverted pins.
    pub const fn new(numbers: [u8; 5], inverted: u8) -> Self {
        let (mut pins, mut levels, mut pulses) = ([0; 32], [0; 32], 0);
        let mut event = 0u8;
        while event < 32 {
            let (mut moved, mut bit) = (0, 0);
            while bit < 5 {
                moved |= (event >> bit & 1) << numbers[bit];
                bit += 1;
            }
            if event == StepEvent::STEP_X | StepEvent::STEP_Y {
                pulses = moved;
            }
            pins[event as usize] = moved ^ inverted;
            levels[(moved ^ inverted) as usize] = event;
            event += 1;
        }
        Self { pins, levels, pulses }
    }
}

/// The pins of the motors as the interrupt needs them: all of one event are set at once.
pub trait Axes {
    /// Which bit stands for which pin in the levels that [`Axes::set`] gets. No step pin is
    /// inverted in it.
    const ORDER: &'static PinOrder = &PinOrder::OF_EVENTS;
    /// Sets the pins to `levels`, in bits 0 to 4 in the order of [`Axes::ORDER`]; the other bits
    /// have no meaning. In the order of a [`StepEvent`] they are a high pulse for each step, the
    /// level of each direction pin where a motor runs down, and whether the drivers are on. It is
    /// called from the interrupt, so it must be brief.
    fn set(&mut self, levels: u32);
    /// Sets the direction pin of z, high to lower the pen, and makes a step if `step`
    /// is true. It is called from the interrupt, too.
    fn set_z_axis(&mut self, step: bool, down: bool);
    /// Sets all step pins low again. It is called from the interrupt, too.
    fn end_pulses(&mut self);
}

impl<SX, DX, SY, DY, E, SZ, DZ> Axes for Pins<SX, DX, SY, DY, E, SZ, DZ>
where
    SX: OutputPin<Error = Infallible>,
    DX: OutputPin<Error = Infallible>,
    SY: OutputPin<Error = Infallible>,
    DY: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible>,
    SZ: OutputPin<Error = Infallible>,
    DZ: OutputPin<Error = Infallible>,
{
    fn set(&mut self, levels: u32) {
        let is_set = |level: u8| levels & u32::from(level) != 0;
        write(&mut self.direction_x, !is_set(StepEvent::DOWN_X));
        write(&mut self.direction_y, !is_set(StepEvent::DOWN_Y));
        write(&mut self.enable, is_set(StepEvent::DRIVERS_ON));
        write(&mut self.step_x, is_set(StepEvent::STEP_X));
        write(&mut self.step_y, is_set(StepEvent::STEP_Y));
    }

    fn set_z_axis(&mut self, step: bool, down: bool) {
        write(&mut self.direction_z, down);
        write(&mut self.step_z, step);
    }

    fn end_pulses(&mut self) {
        write(&mut self.step_x, false);
        write(&mut self.step_y, false);
        write(&mut self.step_z, false);
    }
}

/// Sets one pin. A pin of the board cannot fail.
#[inline]
fn write(pin: &mut impl OutputPin<Error = Infallible>, high: bool) {
    let Ok(()) = pin.set_state(PinState::from(high));
}
