//! Homing: finds the corner of the travel by the limit switches.
//!
//! Each axis in turn runs to its switch, backs off, approaches the switch again slowly, and backs
//! off to its final position. The position of the axis there becomes 0. A polargraph winds one belt
//! after the other; the length of a homed belt is a setting.

use super::{Alarm, Kinematics, Machine, MachineError, Setting, State, Target};
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::motion::{Move, PathLength, PushError};

/// An axis of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// The axis that counts to the right.
    X,
    /// The axis that counts upward.
    Y,
}

/// The state of the limit switches: `true` where a switch is pressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Switches {
    /// The switch at the low end of x.
    pub x: bool,
    /// The switch at the low end of y.
    pub y: bool,
}

impl Switches {
    /// Whether the switch of an axis is pressed.
    pub const fn of(self, axis: Axis) -> bool {
        match axis {
            Axis::X => self.x,
            Axis::Y => self.y,
        }
    }

    /// Whether any switch is pressed.
    pub const fn any(self) -> bool {
        self.x || self.y
    }
}

/// The state of the contacts at the board's inputs: `true` where a contact is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contacts {
    /// The contact of the limit switch of x.
    pub x: bool,
    /// The contact of the limit switch of y.
    pub y: bool,
    /// The contact of the emergency stop.
    pub stop: bool,
}

impl Contacts {
    /// The contacts that are pressed. `mask` says which contacts are closed when they are not
    /// pressed: bit 0 for x, bit 1 for y, bit 2 for the emergency stop.
    #[must_use]
    pub const fn pressed(self, mask: u8) -> Self {
        Self {
            x: self.x != (mask & 1 != 0),
            y: self.y != (mask & 2 != 0),
            stop: self.stop != (mask & 4 != 0),
        }
    }
}

/// The phases of homing one axis, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Phase {
    /// Backs off from a switch that was already pressed at the start.
    Leave,
    /// Runs quickly to the switch.
    Seek,
    /// Backs off from the switch.
    Release,
    /// Runs slowly to the switch again.
    Approach,
    /// Backs off to the final position, where the switch must be released.
    PullOff,
}

/// The error when a switch was not found within the travel, or was still pressed after backing off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SwitchFault;

/// The progress of homing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Homing {
    /// The axis that is being homed.
    pub(super) axis: Axis,
    /// The present phase.
    pub(super) phase: Phase,
    /// The position of the pins when the switch was pressed during this phase or the one before;
    /// `None` if it was not.
    pub(super) pressed_at: Option<PagePoint>,
    /// Whether the move of this phase has been planned to its end.
    pub(super) is_stopped: bool,
}

impl Homing {
    /// The first phase of an axis whose switch is `pressed` or not.
    pub(super) const fn begin(axis: Axis, pressed: bool) -> Self {
        let phase = if pressed { Phase::Leave } else { Phase::Seek };
        Self { axis, phase, pressed_at: None, is_stopped: false }
    }

    /// Whether the axis moves slowly in this phase.
    pub(super) const fn is_slow(self) -> bool {
        matches!(self.phase, Phase::Approach | Phase::PullOff)
    }

    /// The signed distance that the axis may go in this phase, in the unit of `travel` and
    /// `pull_off`.
    pub(super) const fn distance(self, travel: i32, pull_off: i32) -> i32 {
        match self.phase {
            Phase::Leave | Phase::Release | Phase::PullOff => pull_off,
            Phase::Seek => -(travel + travel / 2),
            Phase::Approach => -2 * pull_off,
        }
    }

    /// Whether the phase ends when the switch is pressed.
    pub(super) const fn seeks(self) -> bool {
        matches!(self.phase, Phase::Seek | Phase::Approach)
    }

    /// The phase that follows once the machine has stopped; `None` after the last one.
    ///
    /// # Errors
    /// [`SwitchFault`] if the switch was not found, or is still pressed.
    pub(super) const fn next(self, switches: Switches) -> Result<Option<Self>, SwitchFault> {
        let pressed = switches.of(self.axis);
        let phase = match self.phase {
            Phase::Leave | Phase::Release if pressed => return Err(SwitchFault),
            Phase::Seek | Phase::Approach if self.pressed_at.is_none() => return Err(SwitchFault),
            Phase::Leave => Phase::Seek,
            // The next phase measures from where the switch was pressed, however far the axis ran
            // on.
            Phase::Seek => {
                return Ok(Some(Self { phase: Phase::Release, is_stopped: false, ..self }));
            }
            Phase::Release => Phase::Approach,
            Phase::Approach => {
                return Ok(Some(Self { phase: Phase::PullOff, is_stopped: false, ..self }));
            }
            Phase::PullOff => {
                return match self.axis {
                    _ if pressed => Err(SwitchFault),
                    Axis::X => Ok(Some(Self::begin(Axis::Y, switches.y))),
                    Axis::Y => Ok(None),
                };
            }
        };
        Ok(Some(Self { axis: self.axis, phase, pressed_at: None, is_stopped: false }))
    }
}

impl Machine<'_> {
    /// Homes x first, then y. Afterwards the machine is at (0, 0), one pull-off away from each
    /// switch. [`Machine::watch`] must be called often meanwhile.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle or in [`Alarm::NotHomed`].
    pub fn home(&mut self, switches: Switches) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Alarm(Alarm::NotHomed)) || !self.is_stopped()
        {
            return Err(MachineError::State(self.state));
        }
        self.state = State::Home;
        self.slack.forget();
        self.begin_phase(Homing::begin(Axis::X, switches.x));
        Ok(())
    }

    /// Reports the present state of the contacts. Call it in every turn of the main loop. A pressed
    /// emergency stop raises an alarm in any state. The limit switches are passed on to
    /// [`Machine::watch`].
    pub fn observe(&mut self, contacts: Contacts) {
        let pressed = contacts.pressed(self.settings.get(Setting::InvertContacts).to_num());
        self.switches = Switches { x: pressed.x, y: pressed.y };
        self.stop_is_pressed = pressed.stop;
        if pressed.stop && self.state != State::Alarm(Alarm::EmergencyStop) {
            self.alarm(Alarm::EmergencyStop);
        }
        self.watch(self.switches);
    }

    /// Reports the present state of the limit switches. During homing, a pressed switch ends the
    /// approach. In any other motion it raises an alarm if [`Setting::HardLimits`] is on.
    pub fn watch(&mut self, switches: Switches) {
        match (self.state, self.homing) {
            (State::Home, Some(homing)) => self.watch_homing(homing, switches),
            (State::Home | State::Check | State::Sleep | State::Alarm(_), _) => {}
            (State::Run | State::Hold { .. } | State::Jog | State::Abort | State::Idle, _) => {
                // The state becomes idle as soon as all events are planned, while the pins still
                // move.
                let is_limit = switches.any() && self.settings.is_on(Setting::HardLimits);
                if is_limit && !self.is_stopped() {
                    self.alarm(Alarm::HardLimit);
                }
            }
        }
    }

    fn watch_homing(&mut self, homing: Homing, switches: Switches) {
        if homing.seeks() && homing.pressed_at.is_none() && switches.of(homing.axis) {
            let pressed_at = Some(self.homing_place(self.motors_now()));
            self.homing = Some(Homing { pressed_at, ..homing });
            self.runner.stop();
        } else if homing.is_stopped && self.is_stopped() {
            match homing.next(switches) {
                Ok(next) => {
                    if homing.phase == Phase::PullOff {
                        self.set_zero(homing.axis);
                    }
                    match next {
                        Some(next) => self.begin_phase(next),
                        None => {
                            self.end_homing();
                            self.state = State::Idle;
                        }
                    }
                }
                Err(SwitchFault) => self.alarm(Alarm::HomingFailed(homing.axis)),
            }
        }
    }

    /// Ends homing, if it is in progress, and restores the normal limits.
    pub(super) fn end_homing(&mut self) {
        if self.homing.take().is_some() {
            self.take_settings();
        }
    }

    /// Plans the move of a phase. Raises an alarm if the move cannot be planned.
    fn begin_phase(&mut self, homing: Homing) {
        let speed = if homing.is_slow() { Setting::HomingFeed } else { Setting::HomingSeek };
        self.runner.set_limits(self.settings.limits_at(speed), self.settings.pen_positions());
        let polargraph = matches!(self.settings.kinematics(), Kinematics::Polargraph(_));
        let (travel, steps_per_mm) = match homing.axis {
            _ if polargraph => (Setting::AnchorWidth, Setting::StepsPerMmX),
            Axis::X => (Setting::TravelX, Setting::StepsPerMmX),
            Axis::Y => (Setting::TravelY, self.settings.steps_per_mm_y()),
        };
        let steps =
            |setting| self.settings.millimetres_as_steps(setting, steps_per_mm).min(PAGE_LIMIT / 2);
        let distance = homing.distance(steps(travel), steps(Setting::HomingPullOff));
        let mut point = self.homing_place(self.runner.position());
        let from = homing.pressed_at.unwrap_or(point);
        match homing.axis {
            Axis::X => point.x = from.x + distance,
            Axis::Y => point.y = from.y + distance,
        }
        self.homing = Some(homing);
        let pushed = if polargraph {
            // Only one belt moves. Where that leads the pen does not matter, only how far the belt
            // moves.
            let (end, page) = (self.runner.end(), self.runner.page_end());
            let page = PagePoint { x: page.x + point.x - end.x, y: page.y + point.y - end.y };
            let way = (page.x - self.runner.page_end().x, page.y - self.runner.page_end().y);
            let length = self.runner.limits().length(way.0, way.1);
            length.ok_or(PushError::TooLong).and_then(|length| {
                let (motors, offsets, is_gap) = (point, [0; 2], false);
                let belt = Move { motors, offsets, page, way, whole: length, length, is_gap };
                // The first call may only take up the slack; then the move itself follows.
                if !self.push_motors(&belt, None, PathLength::MAX)? {
                    self.push_motors(&belt, None, PathLength::MAX)?;
                }
                Ok(())
            })
        } else {
            self.push(Target { point, ink: None }, PathLength::MAX).map(|_| ())
        };
        if pushed.is_err() {
            self.alarm(Alarm::HomingFailed(homing.axis));
        }
    }

    /// The position in the coordinates that homing uses: the belt lengths of a polargraph,
    /// otherwise the page.
    fn homing_place(&self, motors: PagePoint) -> PagePoint {
        match self.settings.kinematics() {
            Kinematics::Polargraph(_) => motors,
            build => build.page(motors),
        }
    }

    /// Sets the position of an axis after its last phase: to 0, or to the homed length of a
    /// polargraph's belt.
    fn set_zero(&mut self, axis: Axis) {
        let build = self.settings.kinematics();
        let mut place = self.homing_place(self.runner.position());
        let zero = match build {
            Kinematics::Polargraph(_) => {
                self.settings.millimetres_as_steps(Setting::HomedBelt, Setting::StepsPerMmX)
            }
            _ => 0,
        };
        match axis {
            Axis::X => place.x = zero,
            Axis::Y => place.y = zero,
        }
        match build {
            Kinematics::Polargraph(_) => self.set_motors(place, build.page(place)),
            _ => self.set_position(place),
        }
    }
}
