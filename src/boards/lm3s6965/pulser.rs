//! Stand-in until the machine's own pulser is there: an event's low bits are the pins' levels.

use embedded_hal::digital::OutputPin;
use penup::drawing::PagePoint;
use penup::motion::StepEvent;

use super::pins::MotorPins;

pub struct Pulser {
    pins: MotorPins,
    before: u32,
    position: PagePoint,
}

impl Pulser {
    pub fn new(pins: MotorPins) -> Self {
        Self { pins, before: 0, position: PagePoint::default() }
    }

    /// Writes the pins; the ticks until the next event.
    #[inline(always)]
    pub fn pulse(&mut self, event: StepEvent) -> u32 {
        let levels = event.bits() & 0xFF;
        let rises = levels & !self.before;
        self.before = levels;
        let Ok(()) = self.pins.dir_x.set_state((levels & 2 != 0).into());
        let Ok(()) = self.pins.dir_y.set_state((levels & 8 != 0).into());
        let Ok(()) = self.pins.step_x.set_state((levels & 1 != 0).into());
        let Ok(()) = self.pins.step_y.set_state((levels & 4 != 0).into());
        let Ok(()) = self.pins.pen.set_state((levels & 32 != 0).into());
        let sign = |bit: u32| if levels & bit == 0 { 1 } else { -1 };
        self.position.x += i32::from(rises & 1 != 0) * sign(2);
        self.position.y += i32::from(rises & 4 != 0) * sign(8);
        event.bits() >> 8
    }

    pub fn position(&self) -> PagePoint {
        self.position
    }

    /// Step pins low.
    pub fn release(&mut self) {
        self.before &= !5;
        let Ok(()) = self.pins.step_x.set_low();
        let Ok(()) = self.pins.step_y.set_low();
    }
}
