//! The output pins of a board, and how their changes translate into actions of the machine.

use penup::board_table::Pins;
use penup::boards::host::{Change, Stamped};
use penup::machine::{Setting, Settings};
use std::time::Duration;

/// An output pin of the plotter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pin {
    /// A rising edge steps x.
    StepX,
    /// The direction of x: high means that x increases.
    DirX,
    /// A rising edge steps y.
    StepY,
    /// The direction of y: high means that y increases.
    DirY,
    /// The enable pin of the motor drivers: low means that the motors have current.
    Enable,
    /// High: the pen is down. This is so even where a servo is mounted the other way round.
    Pen,
    /// A rising edge steps the motor that lifts the pen.
    StepZ,
    /// The direction of that motor: high lowers the pen.
    DirZ,
}

impl Pin {
    /// Returns the output pin with this number on a board with these pins.
    pub fn numbered(number: u8, pins: &Pins) -> Option<Self> {
        let outputs = [
            (pins.step_x, Self::StepX),
            (pins.dir_x, Self::DirX),
            (pins.step_y, Self::StepY),
            (pins.dir_y, Self::DirY),
            (pins.enable, Self::Enable),
            (pins.pen, Self::Pen),
            (pins.step_z, Self::StepZ),
            (pins.dir_z, Self::DirZ),
        ];
        outputs.into_iter().find_map(|(of, pin)| (of == number).then_some(pin))
    }
}

/// A change of a pin's level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PinChange {
    /// The pin.
    pub pin: Pin,
    /// The new level.
    pub high: bool,
    /// The time on the board's clock: its last reading before the change. The step interrupt reads
    /// the clock when it begins, so all changes of one interrupt have the same time, exact to a
    /// cycle of 20 ns, and the pins follow it by the same few instructions each time.
    pub at: Duration,
}

impl PinChange {
    /// Whether this is a rising edge that makes x or y step.
    pub fn is_step(self) -> bool {
        self.high && matches!(self.pin, Pin::StepX | Pin::StepY)
    }
}

impl PinChange {
    /// Converts a change of the board in memory, whose ticks are 40 ns long, with a pen that is
    /// raised and lowered to these `heights`.
    pub fn of(Stamped { time, change }: &Stamped, heights: PenHeights) -> Self {
        let (pin, high) = match *change {
            Change::StepX(high) => (Pin::StepX, high),
            Change::StepY(high) => (Pin::StepY, high),
            Change::UpX(high) => (Pin::DirX, high),
            Change::UpY(high) => (Pin::DirY, high),
            // The drivers are on while the pin is low.
            Change::Enable(on) => (Pin::Enable, !on),
            Change::Pen(height) => (Pin::Pen, heights.is_down(height)),
            Change::StepZ(high) => (Pin::StepZ, high),
            Change::DownZ(high) => (Pin::DirZ, high),
        };
        Self { pin, high, at: Duration::from_nanos(time * 40) }
    }
}

impl From<&Stamped> for PinChange {
    /// Converts a change of the board in memory whose pen has the usual heights.
    fn from(stamped: &Stamped) -> Self {
        Self::of(stamped, PenHeights::default())
    }
}

/// The heights of the raised and of the lowered pen, `$210` and `$211`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PenHeights {
    /// The height of the raised pen, from 0 to 127.
    pub up: u8,
    /// The height of the lowered pen.
    pub down: u8,
}

impl Default for PenHeights {
    /// The heights that a board has before it is told others.
    fn default() -> Self {
        Self { up: 0, down: 127 }
    }
}

impl PenHeights {
    /// The heights that the settings of a machine say.
    pub fn of(settings: &Settings) -> Self {
        let [up, down] = [Setting::PenUpHeight, Setting::PenDownHeight]
            .map(|setting| settings.get(setting).to_num::<u8>());
        Self { up, down }
    }

    /// Whether a pen at `height` is down: nearer to the height of the lowered pen than to that of
    /// the raised one.
    ///
    /// ```
    /// use penup_job::pins::PenHeights;
    /// let reversed = PenHeights { up: 100, down: 20 };
    /// assert!(reversed.is_down(0) && !reversed.is_down(127));
    /// let low = PenHeights { up: 10, down: 40 };
    /// assert!(low.is_down(40) && !low.is_down(10));
    /// ```
    pub fn is_down(self, height: u8) -> bool {
        height.abs_diff(self.down) < height.abs_diff(self.up)
    }
}

/// An action of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MachineEvent {
    /// The kind of action.
    pub kind: MachineEventKind,
    /// The time, as in [`PinChange::at`].
    pub at: Duration,
}

/// The kinds of actions that the pins show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineEventKind {
    /// A single step of one axis or of both at once. Each component is -1, 0 or 1.
    Step {
        /// The step in x, positive to the right.
        x: i8,
        /// The step in y, positive upwards.
        y: i8,
    },
    /// The pen was lowered or raised.
    Pen {
        /// Whether it was lowered.
        down: bool,
    },
    /// A step of the motor that lifts the pen.
    ZStep {
        /// Whether the step moves the pen towards the paper.
        down: bool,
    },
    /// The motors' current was turned on or off.
    Drivers {
        /// Whether the current was turned on.
        on: bool,
    },
}

/// Converts changes of pins into actions of the machine.
///
/// Simultaneous steps of both axes are one event, so an event is complete only when the next one
/// begins. [`Machine::change`] returns the event before, and [`Machine::last`] the last one.
///
/// ```
/// use penup_job::pins::{Machine, MachineEventKind::Step, Pin, PinChange};
/// use std::time::Duration;
///
/// let change = |pin, high| PinChange { pin, high, at: Duration::ZERO };
/// let mut machine = Machine::default();
/// assert_eq!(machine.change(change(Pin::DirX, true)), None);
/// assert_eq!(machine.change(change(Pin::StepX, true)), None);
/// assert_eq!(machine.change(change(Pin::StepY, true)), None);
/// let step = machine.last().map(|event| event.kind);
/// assert_eq!(step, Some(Step { x: 1, y: -1 }));
/// assert_eq!(machine.position(), (1, -1));
/// ```
#[derive(Debug, Clone, Default)]
pub struct Machine {
    up_x: bool,
    up_y: bool,
    down_z: bool,
    pen_down: bool,
    position: (i32, i32),
    /// The last event, which may still be combined with a step of the other axis.
    waiting: Option<MachineEvent>,
}

impl Machine {
    /// Processes the next change. If it starts a new event, returns the event before it.
    pub fn change(&mut self, change: PinChange) -> Option<MachineEvent> {
        let PinChange { pin, high, at } = change;
        let kind = match pin {
            Pin::DirX => {
                self.up_x = high;
                return None;
            }
            Pin::DirY => {
                self.up_y = high;
                return None;
            }
            Pin::DirZ => {
                self.down_z = high;
                return None;
            }
            Pin::StepX | Pin::StepY | Pin::StepZ if !high => return None,
            Pin::StepZ => MachineEventKind::ZStep { down: self.down_z },
            Pin::StepX => self.step(direction(self.up_x), 0),
            Pin::StepY => self.step(0, direction(self.up_y)),
            Pin::Enable => MachineEventKind::Drivers { on: !high },
            // The pen has a new height on the same side of the middle.
            Pin::Pen if high == self.pen_down => return None,
            Pin::Pen => {
                self.pen_down = high;
                MachineEventKind::Pen { down: high }
            }
        };
        if let Some(waiting) = &mut self.waiting
            && waiting.at == at
            && let Some(diagonal) = joined(waiting.kind, kind)
        {
            waiting.kind = diagonal;
            return None;
        }
        self.waiting.replace(MachineEvent { kind, at })
    }

    /// Counts the steps in x and y, each -1, 0 or 1, and returns their event.
    fn step(&mut self, x: i8, y: i8) -> MachineEventKind {
        self.position.0 += i32::from(x);
        self.position.1 += i32::from(y);
        MachineEventKind::Step { x, y }
    }

    /// Returns the last event, once there are no more changes.
    pub fn last(&mut self) -> Option<MachineEvent> {
        self.waiting.take()
    }

    /// The position: the sums of all steps in x and in y.
    pub fn position(&self) -> (i32, i32) {
        self.position
    }

    /// Whether the pen is down.
    pub fn pen_is_down(&self) -> bool {
        self.pen_down
    }
}

/// Returns the sign of a step by the level of the direction pin.
fn direction(up: bool) -> i8 {
    if up { 1 } else { -1 }
}

/// Combines two steps of different axes into a diagonal step; `None` for any other pair.
fn joined(first: MachineEventKind, second: MachineEventKind) -> Option<MachineEventKind> {
    let (MachineEventKind::Step { x: x1, y: y1 }, MachineEventKind::Step { x: x2, y: y2 }) =
        (first, second)
    else {
        return None;
    };
    let different_axes = x1 * x2 == 0 && y1 * y2 == 0;
    different_axes.then_some(MachineEventKind::Step { x: x1 + x2, y: y1 + y2 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use MachineEventKind::{Drivers, Pen, Step};

    /// The events of a list of changes, with all times in microseconds.
    fn folded(changes: &[(u64, Pin, bool)]) -> Vec<(u64, MachineEventKind)> {
        let mut machine = Machine::default();
        let mut events: Vec<_> = changes
            .iter()
            .filter_map(|&(at, pin, high)| {
                let at = Duration::from_micros(at);
                machine.change(PinChange { pin, high, at })
            })
            .collect();
        events.extend(machine.last());
        events.iter().map(|event| (event.at.as_micros() as u64, event.kind)).collect()
    }

    #[test]
    fn a_stroke_in_its_order() {
        let events = folded(&[
            (0, Pin::Enable, false),
            (1, Pin::Pen, true),
            (2, Pin::DirX, true),
            (3, Pin::StepX, true),
            (4, Pin::StepX, false),
            (5, Pin::StepX, true),
            (5, Pin::StepY, true),
            (6, Pin::StepX, false),
            (6, Pin::StepY, false),
            (7, Pin::Pen, false),
            (8, Pin::Enable, true),
        ]);
        let expected = [
            (0, Drivers { on: true }),
            (1, Pen { down: true }),
            (3, Step { x: 1, y: 0 }),
            (5, Step { x: 1, y: -1 }),
            (7, Pen { down: false }),
            (8, Drivers { on: false }),
        ];
        assert_eq!(events, expected);
    }

    #[test]
    fn steps_at_two_instants_or_of_one_axis_are_two() {
        let events = folded(&[
            (1, Pin::StepX, true),
            (2, Pin::StepY, true),
            (2, Pin::StepY, false),
            (2, Pin::StepY, true),
        ]);
        let expected =
            [(1, Step { x: -1, y: 0 }), (2, Step { x: 0, y: -1 }), (2, Step { x: 0, y: -1 })];
        assert_eq!(events, expected);
    }

    #[test]
    fn nothing_of_nothing() {
        assert_eq!(folded(&[]), []);
        assert_eq!(folded(&[(0, Pin::DirX, true), (1, Pin::StepX, false)]), []);
    }
}
