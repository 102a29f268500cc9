//! Homing: finds the corner of the travel by the limit switches.
//!
//! Each axis in turn runs to its switch, backs off, approaches the switch again slowly, and backs
//! off to its final position. The position of the axis there becomes 0, or its travel if the switch
//! lies at the high end (`$23`). Which motors run, and what the position becomes on a machine that
//! hangs on belts, is asked of the kinematics.

use super::kinematics::{HomingSpace, Kinematics};
use super::state::Activity;
use super::{Alarm, Machine, MachineError, Setting, Target, Tool};
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::motion::{Move, PushError, SpeedLimit};

/// The most steps of a belt that homing winds up, less the half that is added to a travel: with it,
/// they are less than the 2^22 steps of the longest move.
const LONGEST_BELT: i32 = PAGE_LIMIT / 2 * 5;

/// One of the two axes of the page, as a limit switch belongs to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// The axis that counts to the right.
    X,
    /// The axis that counts upward.
    Y,
}

impl Axis {
    /// The value of this axis, of those of x and y.
    pub(super) fn of<T>(self, [x, y]: [T; 2]) -> T {
        match self {
            Self::X => x,
            Self::Y => y,
        }
    }
}

/// The state of the limit switches: `true` where a switch is pressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Switches {
    /// The switch of x.
    pub x: bool,
    /// The switch of y.
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

    /// Returns the limit switches among the contacts, without the emergency stop.
    #[must_use]
    pub const fn switches(self) -> Switches {
        Switches { x: self.x, y: self.y }
    }
}

/// The phases of homing one axis, in the order in which they follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Phase {
    /// Backs off from a switch that was already pressed at the start.
    Leave,
    /// Runs quickly to the switch, until it is pressed.
    Seek,
    /// Backs off from the switch, until it is released.
    Release,
    /// Runs slowly to the switch again, to find its exact position.
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
    /// The current phase of the axis that is being homed.
    pub(super) phase: Phase,
    /// The position of the pins when the switch was pressed during this phase or the one before;
    /// `None` if it was not.
    pub(super) pressed_at: Option<PagePoint>,
    /// Whether the move of this phase has been planned to its end.
    pub(super) is_stopped: bool,
    /// Whether the position is unknown, as it was when homing began or because one axis is homed.
    pub(super) is_lost: bool,
}

impl Homing {
    /// Returns the first phase of homing an axis, which depends on whether its switch is `pressed`
    /// already.
    pub(super) const fn begin(axis: Axis, pressed: bool, is_lost: bool) -> Self {
        let phase = if pressed { Phase::Leave } else { Phase::Seek };
        Self { axis, phase, pressed_at: None, is_stopped: false, is_lost }
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
                    // From here on x counts from its switch, but y does not yet.
                    Axis::X => Ok(Some(Self::begin(Axis::Y, switches.y, true))),
                    Axis::Y => Ok(None),
                };
            }
        };
        Ok(Some(Self { phase, pressed_at: None, is_stopped: false, ..self }))
    }
}

impl Machine<'_> {
    /// Homes x first, then y. Afterwards the machine is in the corner of the switches, one pull-off
    /// away from each: at (0, 0) if both lie at the low ends. [`Machine::watch`] must be called
    /// often meanwhile.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle or in an alarm that can be ended.
    pub fn home(&mut self, switches: Switches) -> Result<(), MachineError> {
        let is_lost = match self.activity {
            Activity::Idle if self.is_stopped() => false,
            Activity::Alarm(alarm) => {
                self.release_pins(alarm)?;
                if alarm == Alarm::Restarted {
                    self.forget_what_needs_current();
                }
                // A line that led beyond the travel has lost nothing.
                alarm != Alarm::SoftLimit
            }
            _ => return Err(self.refusal()),
        };
        self.forget_backlash();
        self.begin_phase(Homing::begin(Axis::X, switches.x, is_lost));
        Ok(())
    }

    /// Which contacts are closed when they are not pressed: the mask of [`Contacts::pressed`].
    pub(crate) fn inverted_contacts(&self) -> u8 {
        self.settings.whole(Setting::InvertContacts) as u8 // at most 7
    }

    /// Reports the present state of the contacts. Call it in every turn of the main loop. A pressed
    /// emergency stop raises an alarm in any state. The limit switches are passed on to
    /// [`Machine::watch`].
    pub fn observe(&mut self, contacts: Contacts) {
        self.contacts = contacts.pressed(self.inverted_contacts());
        let is_known = matches!(self.activity, Activity::Alarm(Alarm::EmergencyStop));
        if self.contacts.stop && !is_known {
            self.alarm(Alarm::EmergencyStop);
        }
        self.watch(self.contacts.switches());
    }

    /// Reports the present state of the limit switches. During homing, a pressed switch ends the
    /// approach. In any other motion it raises an alarm if [`Setting::HardLimits`] is on.
    pub fn watch(&mut self, switches: Switches) {
        match self.activity {
            Activity::Home(homing) => self.watch_homing(homing, switches),
            Activity::Check | Activity::Sleep { .. } | Activity::Alarm(_) => {}
            Activity::Run(_)
            | Activity::Hold { .. }
            | Activity::Jog
            | Activity::Abort
            | Activity::Idle => {
                // The state becomes idle as soon as all events are planned, while the pins still
                // move.
                let is_limit = switches.any() && self.settings.is_on(Setting::HardLimits);
                if is_limit && !self.is_stopped() {
                    self.alarm(Alarm::HardLimit);
                }
            }
        }
    }

    /// Continues homing as the switches and the end of the present move allow.
    fn watch_homing(&mut self, homing: Homing, switches: Switches) {
        if homing.seeks() && homing.pressed_at.is_none() && switches.of(homing.axis) {
            let pressed_at = Some(self.homing_position(self.motors_now()));
            self.activity = Activity::Home(Homing { pressed_at, ..homing });
            self.runner.stop();
        } else if homing.is_stopped && self.is_stopped() {
            match homing.next(switches) {
                Ok(next) => {
                    if homing.phase == Phase::PullOff {
                        self.set_homed(homing.axis);
                    }
                    match next {
                        Some(next) => self.begin_phase(next),
                        None => self.end_motion(Activity::Idle),
                    }
                }
                Err(SwitchFault) => self.alarm(Alarm::HomingFailed(homing.axis)),
            }
        }
    }

    /// Goes on with the activity `next`, now that no motion is planned any more. The limits of
    /// homing, which also hold while it is given up, and the speeds of a jog, which has no
    /// override, end here: other ones in mid motion would not fit its speed.
    pub(super) fn end_motion(&mut self, next: Activity) {
        let before = core::mem::replace(&mut self.activity, next);
        if let Activity::Home(_) | Activity::Abort = before {
            self.take_settings();
        } else {
            self.apply_override();
        }
    }

    /// Plans the move of a phase. Raises an alarm if the move cannot be planned.
    fn begin_phase(&mut self, homing: Homing) {
        let speed = if homing.is_slow() { Setting::HomingFeed } else { Setting::HomingSeek };
        let pen = Tool::positions(&self.settings);
        self.runner.set_limits(self.settings.limits_at(speed, self.pins.queue()), pen);
        let properties = Kinematics::properties(&self.settings);
        let steps = |setting| {
            let steps_per_mm = homing.axis.of(properties.steps_per_mm);
            self.settings.millimetres_as_steps(setting, steps_per_mm).min(PAGE_LIMIT)
        };
        let mut travel = steps(homing.axis.of(properties.homing_travel));
        if let Some(anchors) = self.settings.kinematics().belts() {
            let longest = homing.axis.of(anchors.longest_belts(self.travel().x));
            // With the half that is added to a travel, an eighth to spare.
            travel = travel.max((longest - longest / 4).min(LONGEST_BELT));
        }
        let distance = homing.distance(travel, steps(Setting::HomingPullOff));
        let distance = if self.homes_low(homing.axis) { distance } else { -distance };
        let mut point = self.homing_position(self.planned_motors());
        let from = homing.pressed_at.unwrap_or(point);
        match homing.axis {
            Axis::X => point.x = from.x + distance,
            Axis::Y => point.y = from.y + distance,
        }
        self.activity = Activity::Home(homing);
        let pushed = match properties.homing_space {
            HomingSpace::Page => self.push(Target { point, ink: None }, SpeedLimit::NONE).map(drop),
            HomingSpace::Motors => self.push_motor(point),
        };
        if pushed.is_err() {
            self.alarm(Alarm::HomingFailed(homing.axis));
        }
    }

    /// Plans the move of a single motor. Where that leads the pen does not matter, only how far the
    /// motor moves.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
    fn push_motor(&mut self, motors: PagePoint) -> Result<(), PushError> {
        let (end, page) = (self.motors_end(), self.runner.page_end());
        let (dx, dy) = (motors.x - end.x, motors.y - end.y);
        let page = PagePoint { x: page.x + dx, y: page.y + dy };
        let chord = self.runner.chord(dx, dy).ok_or(PushError::TooLong)?;
        let belt = Move::whole(motors, page, &chord);
        // The first call may only take up the backlash; then the move itself follows.
        if !self.push_motors(&belt, None, SpeedLimit::NONE)? {
            self.push_motors(&belt, None, SpeedLimit::NONE)?;
        }
        Ok(())
    }

    /// Converts motor positions to the coordinates in which this kind of machine is homed.
    fn homing_position(&self, motors: PagePoint) -> PagePoint {
        match Kinematics::properties(&self.settings).homing_space {
            HomingSpace::Page => self.settings.kinematics().page(motors),
            HomingSpace::Motors => motors,
        }
    }

    /// Whether the switch of an axis lies at its low end.
    fn homes_low(&self, axis: Axis) -> bool {
        self.settings.whole(Setting::HomingDirection) & 1 << axis as u32 != 0
    }

    /// Sets the position of an axis after its last phase: to 0 or its travel, or to the homed
    /// length of a belt.
    fn set_homed(&mut self, axis: Axis) {
        let properties = Kinematics::properties(&self.settings);
        let mut position = self.homing_position(self.planned_motors());
        let end = if self.homes_low(axis) { None } else { Some(axis.of(properties.homing_travel)) };
        let homed = properties.homed_length.or(end).map_or(0, |setting| {
            let steps_per_mm = axis.of(properties.steps_per_mm);
            self.settings.millimetres_as_steps(setting, steps_per_mm)
        });
        match axis {
            Axis::X => position.x = homed,
            Axis::Y => position.y = homed,
        }
        match properties.homing_space {
            HomingSpace::Page => self.set_position(position),
            HomingSpace::Motors => {
                self.set_motors(position, self.settings.kinematics().page(position));
            }
        }
    }
}
