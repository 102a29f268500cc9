//! What lowers and raises the pen. Programs for plotters do it in several ways; the settings choose
//! one of them, or leave the choice to what a program shows.

use super::{Motion, Program};
use crate::fixed::Millimetres;
use crate::machine::{Setting, Settings, Value};

/// The words of a program that move the pen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PenRule {
    /// What a program shows: Z, M3 and M5, or both. As long as it has shown neither, G1 to G3 draw.
    Auto,
    /// M3 and M5; with S0 the pen is up.
    Spindle,
    /// Z.
    Height,
    /// S, with M3, M280 or M300.
    Power,
    /// G1 to G3, with M3 or M4 and S above 0.
    Laser,
}

impl PenRule {
    /// The rule that the settings choose.
    pub(super) fn of(settings: &Settings) -> Self {
        if settings.is_on(Setting::Laser) {
            return Self::Laser;
        }
        match settings.get(Setting::PenMode).to_num::<u8>() {
            1 => Self::Spindle,
            2 => Self::Height,
            3 => Self::Power,
            _ => Self::Auto,
        }
    }
}

/// Whether the pen is down at this Z: that of the program, or in relative coordinates how far Z
/// moves, where 0 says nothing.
pub(super) fn is_down_at(z: Millimetres, relative: bool, settings: &Settings) -> Option<bool> {
    let above = settings.is_on(Setting::PenZAbove);
    let from = if relative { Value::ZERO } else { settings.get(Setting::PenZ) };
    match z.cmp(&from) {
        core::cmp::Ordering::Equal => (!relative).then_some(true),
        order => Some(order.is_gt() == above),
    }
}

/// Whether the pen is down at this S.
fn is_down_by(speed: Millimetres, settings: &Settings) -> bool {
    let at = settings.get(Setting::PenS);
    if settings.is_on(Setting::PenSBelow) { speed <= at } else { speed >= at }
}

/// What a program has shown of how it moves the pen, and what it has drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct PenState {
    /// The number of lines of the program that have come; more than 255 count as 255.
    lines: u8,
    /// Whether M3 or M4 has come.
    has_on: bool,
    /// Whether M5 has come.
    has_off: bool,
    /// Whether S has come.
    has_speed: bool,
    /// Whether M280 or M300 has come.
    has_servo: bool,
    /// Whether Z put the pen down last; `None` before the first Z.
    z_is_down: Option<bool>,
    /// Whether S put the pen down last.
    s_is_down: bool,
    /// Whether M3 has come and no move or Z since. The pen then goes down with the next move, or
    /// for a dot.
    waits: bool,
    /// Whether S has changed from one number to another without M5 between.
    varies: bool,
    /// Whether the program has shown nothing and yet drawn, by G1 to G3 alone.
    draws_by_feed: bool,
    /// Whether the first line was a move of G1 to G3 that did not draw because it stood alone.
    first_is_dry: bool,
    /// The number of moves of G1 to G3 with the pen down and up; more than 65535 count as 65535.
    inked: u16,
    dry: u16,
}

impl Program {
    /// Begins a line: it counts.
    pub(in crate::plotter) fn begin_line(&mut self) {
        self.pen.lines = self.pen.lines.saturating_add(1);
    }

    /// Whether lines have come since the program ended last.
    pub(in crate::plotter) fn is_open(&self) -> bool {
        self.pen.lines > 0
    }

    /// Notes M3, M4 or M5.
    pub(super) fn turn(&mut self, spindle: u8, rule: PenRule) {
        self.spindle = spindle;
        let is_on = spindle != 5;
        self.pen.has_on |= is_on;
        self.pen.has_off |= !is_on;
        // Somebody who types M3 alone wants to see the pen go down. In a program it may be a
        // spindle, which Z will tell.
        self.pen.waits =
            is_on && rule == PenRule::Auto && self.pen.lines > 1 && self.pen.z_is_down.is_none();
        self.pen.s_is_down &= is_on;
    }

    /// Notes S. `servo` says whether it belongs to M280 or M300, so that it needs no M3.
    pub(super) fn take_speed(&mut self, speed: Millimetres, servo: bool, settings: &Settings) {
        let is_change = self.pen.has_speed && speed != self.speed && speed > 0 && self.speed > 0;
        self.pen.varies |= is_change && self.is_on() && self.pen.has_on;
        self.speed = speed;
        self.pen.has_speed = true;
        if servo {
            self.pen.has_servo = true;
            self.pen.s_is_down = is_down_by(speed, settings);
        }
    }

    /// Notes whether Z puts the pen down.
    pub(super) fn take_height(&mut self, is_down: bool) {
        self.pen.z_is_down = Some(is_down);
        self.pen.waits = false;
    }

    /// Notes that Z goes to a stored position, which is never on the paper.
    pub(super) fn leave_height(&mut self) {
        if self.pen.z_is_down.is_some() {
            self.take_height(false);
        }
    }

    /// Brings the pen up to date with M3 and S at the end of the words.
    pub(super) fn settle_speed(&mut self, has_word: bool, settings: &Settings) {
        if has_word && self.is_on() && self.pen.has_speed {
            self.pen.s_is_down = is_down_by(self.speed, settings);
        }
    }

    /// Whether M3 or M4 is in force.
    fn is_on(&self) -> bool {
        self.spindle != 5
    }

    /// Whether S is 0, so that M3 does not put the pen down.
    pub(super) fn is_off_by_speed(&self) -> bool {
        self.pen.has_speed && self.speed == 0
    }

    /// Whether the pen is down while the machine is at rest.
    pub(super) fn is_down_at_rest(&self, rule: PenRule) -> bool {
        let is_on = self.is_on() && !self.is_off_by_speed();
        match rule {
            PenRule::Auto => {
                let by_spindle = if self.pen.has_on {
                    is_on && !self.pen.waits
                } else {
                    self.pen.z_is_down.is_some()
                };
                by_spindle && self.pen.z_is_down.unwrap_or(true)
            }
            PenRule::Spindle => is_on,
            PenRule::Height => self.pen.z_is_down == Some(true),
            PenRule::Power => self.pen.s_is_down,
            PenRule::Laser => false,
        }
    }

    /// Counts a move, and returns whether a move of the current kind draws.
    pub(super) fn begin_move(&mut self, rule: PenRule) -> bool {
        self.pen.waits = false;
        let is_feed = self.motion != Motion::Rapid;
        let has_shown = self.pen.has_on || self.pen.has_off || self.pen.z_is_down.is_some();
        let draws = match rule {
            // A line that is typed alone draws nothing unless the pen was put down, or the program
            // has drawn before its sender made a pause.
            PenRule::Auto if !has_shown => {
                let draws = is_feed && (self.pen.lines > 1 || self.pen.draws_by_feed);
                self.pen.first_is_dry |= is_feed && !draws;
                self.pen.draws_by_feed |= draws;
                draws
            }
            PenRule::Laser => is_feed && self.is_on() && self.speed > 0,
            rule => self.is_down_at_rest(rule),
        };
        let count = if draws { &mut self.pen.inked } else { &mut self.pen.dry };
        if draws || is_feed {
            *count = count.saturating_add(1);
        }
        draws
    }

    /// Whether P of G4 counts milliseconds, as for the machines that know M280 and M300.
    pub(super) fn counts_milliseconds(&self) -> bool {
        self.pen.has_servo
    }

    /// Returns whether M3 and M5 without a move between them ask for a dot. The request is then
    /// forgotten.
    pub(super) fn take_dot(&mut self) -> bool {
        core::mem::take(&mut self.pen.waits)
    }

    /// Lets a dot wait, or not.
    pub(super) fn set_dot(&mut self, waits: bool) {
        self.pen.waits |= waits;
    }

    /// Ends the program, whose modes stay, as does what it has shown of the pen: a sender may only
    /// have made a pause. Returns what the user is to be told.
    pub(in crate::plotter) fn end(&mut self, settings: &Settings) -> Option<&'static str> {
        let rule = PenRule::of(settings);
        let pen = &self.pen;
        let note = if pen.inked == 0 && pen.dry > 0 {
            Some(match rule {
                PenRule::Auto if pen.lines == 1 => {
                    "no ink was drawn: a line that is sent alone draws after M3"
                }
                PenRule::Auto if pen.z_is_down.is_some() => {
                    "no ink was drawn: Z never went down to $207, or $208 has the wrong side; \
                     $206=1 draws by M3"
                }
                PenRule::Auto | PenRule::Spindle => {
                    "no ink was drawn: M3 never came, or with S0: $206 says what moves the pen"
                }
                PenRule::Height => {
                    "no ink was drawn: Z never came to $207, or $208 has the wrong side: $206=0 \
                     goes by the program"
                }
                PenRule::Power => {
                    "no ink was drawn: S never came to $216, or $217 has the wrong side: $206=0 \
                     goes by the program"
                }
                PenRule::Laser => {
                    "no ink was drawn: with $32=1 it takes M3 or M4, and S above 0: $32=0 goes by \
                     M3 or Z"
                }
            })
        } else if pen.first_is_dry && pen.inked > 0 {
            Some("the first line was not inked: it might have been typed. Begin with G0 or M3")
        } else if pen.varies && matches!(rule, PenRule::Auto | PenRule::Spindle) {
            Some("S changed while M3 was on: if S moves the pen, set $206=3, and $216 and $217")
        } else if pen.inked > 0 && pen.dry > 8 && pen.dry / 2 > pen.inked {
            Some(
                "most of G1 to G3 had the pen up: if lines are missing, see $206, and $207 and \
                 $208 for Z",
            )
        } else {
            None
        };
        self.pen = PenState {
            lines: 0,
            inked: 0,
            dry: 0,
            varies: false,
            first_is_dry: false,
            waits: false,
            ..self.pen
        };
        note
    }

    /// Forgets what the program has shown of the pen, unless M3 is in force or the pen is down.
    pub(in crate::plotter) fn forget_raised_pen(&mut self, settings: &Settings) {
        if !self.is_on() && !self.is_down_at_rest(PenRule::of(settings)) {
            self.pen = PenState::default();
        }
    }

    /// Raises the pen, as M5 and Z do, because the machine has raised it in an alarm or in sleep.
    /// The next program draws only where it puts the pen down. Returns whether M3 was in force.
    pub(in crate::plotter) fn raise_pen(&mut self) -> bool {
        self.draws = false;
        self.pen.draws_by_feed = false;
        self.pen.s_is_down = false;
        self.pen.waits = false;
        self.leave_height();
        core::mem::replace(&mut self.spindle, 5) != 5
    }

    /// Raises the pen and forgets what the program has shown of it.
    pub(in crate::plotter) fn forget_pen(&mut self) {
        self.raise_pen();
        self.pen = PenState::default();
    }
}
