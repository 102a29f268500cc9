//! A model of backlash.

use penup::machine::{Setting, Settings};

/// A model of the backlash of a motor, which moves the pen only at either end of the backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backlash {
    backlash: i32,
    /// The offset of the motor relative to the pen at the lower end; `None` before it has moved.
    low: Option<i32>,
    beyond: i32,
}

impl Backlash {
    /// A motor at the end of its backlash at which its first move finds it.
    pub fn new(backlash: i32) -> Self {
        Self { backlash, low: None, beyond: 0 }
    }

    /// A motor in the middle of its backlash.
    pub fn in_the_middle(backlash: i32) -> Self {
        Self { backlash, low: Some(-backlash / 2), beyond: 0 }
    }

    /// Moves the motor by `steps` and returns by how many steps the pen moves.
    pub fn turn(&mut self, steps: i32) -> i32 {
        if steps == 0 {
            return 0;
        }
        let low = *self.low.get_or_insert(if steps > 0 { -self.backlash } else { 0 });
        let beyond = (self.beyond + steps).clamp(low, low + self.backlash);
        let moved = self.beyond + steps - beyond;
        self.beyond = beyond;
        moved
    }
}

/// The backlash of each motor in steps.
pub fn backlash_steps(settings: &Settings) -> [i32; 2] {
    let [x, y] = settings.page_steps();
    [(Setting::BacklashX, x), (Setting::BacklashY, y)].map(|(backlash, steps)| {
        (settings.get(backlash).to_num::<f64>() * steps.to_num::<f64>()).round() as i32
    })
}
