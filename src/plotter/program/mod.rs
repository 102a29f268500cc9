//! The G-code interpreter: it turns a line of G-code into an action for the machine, given the
//! modes that earlier lines have set.
//!
//! Lines are understood as Grbl 1.1 understands them, and refused with its numbers. [`block`] reads
//! and checks the words of a line, this file gives them their meaning, [`feed`] has the speed,
//! [`arc`] finds arcs, [`coordinates`] keeps the origins, and [`pen`] decides what is drawn.

mod arc;
mod block;
mod coordinates;
mod feed;
mod parameters;
mod pen;

pub(super) use block::{Flow, StoredPosition};
pub(super) use parameters::{Parameters, SYSTEMS, TEXT_LIMIT, Text};

use crate::drawing::{PAGE_LIMIT, PagePoint, StepsPerMillimetre};
use crate::fixed::{Decimal, Millimetres, divide_rounding, product};
use crate::machine::{Machine, Settings};
use crate::protocol::{BlockError, CommandError, GCode};
use crate::step::{Arc, Turn};
use block::{Action, AxisUse, Block};
use feed::{NO_FEED, inverse_feed};
use pen::PenRule;

/// A position of the machine, in millimetres from the page's origin. Z is only counted: the pen has
/// no other heights than up and down.
pub(super) type MachinePosition = [Millimetres; 3];

/// The modes and the position that the lines so far have set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Program {
    /// The kind of move that coordinates ask for.
    motion: Motion,
    /// The plane of arcs.
    plane: Plane,
    /// Whether lengths are in inches (G20). Otherwise they are in millimetres (G21).
    inches: bool,
    /// Whether coordinates are relative to the last position (G91). Otherwise they are absolute
    /// (G90).
    relative: bool,
    /// Whether F is one divided by the minutes of a move (G93). Otherwise it is mm/min (G94).
    inverse_time: bool,
    /// The index of the coordinate system, 0 for G54.
    system: u8,
    /// 3, 4 or 5 for M3, M4 or M5.
    spindle: u8,
    /// Whether M7 and M8 are in force.
    coolant: [bool; 2],
    /// The number of the tool.
    tool: u8,
    /// Whether the move of the last line draws.
    pub(super) draws: bool,
    /// S.
    speed: Millimetres,
    /// F in mm/min, [`NO_FEED`] if none is set.
    feed: Millimetres,
    /// F of the current move in mm/min, [`NO_FEED`] if none is set.
    move_feed: Millimetres,
    /// The end of the last move, as the lines give it.
    at: MachinePosition,
    /// The shift of the coordinates by G92.
    shift: MachinePosition,
    /// The shift of Z by G43.1.
    tool_length: Millimetres,
    /// What the program has shown of how it moves the pen.
    pen: pen::PenState,
}

/// The kind of move that coordinates ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motion {
    /// G0.
    Rapid,
    /// G1.
    Line,
    /// G2 and G3.
    Arc(Turn),
    /// G80.
    None,
}

/// The plane of arcs: 0 for X and Y (G17), 1 for Z and X (G18), 2 for Y and Z (G19).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Plane(u8);

impl Motion {
    /// The kind of move of G0 to G3.
    fn of(number: i32) -> Self {
        match number {
            0 => Self::Rapid,
            1 => Self::Line,
            2 => Self::Arc(Turn::Clockwise),
            _ => Self::Arc(Turn::Counterclockwise),
        }
    }

    /// The number after G.
    fn number(self) -> u8 {
        match self {
            Self::Rapid => 0,
            Self::Line => 1,
            Self::Arc(Turn::Clockwise) => 2,
            Self::Arc(Turn::Counterclockwise) => 3,
            Self::None => 80,
        }
    }
}

/// The action of a line: what the machine is to do now.
#[derive(Debug, Clone)]
pub(super) enum MachineAction {
    /// Nothing moves.
    Nothing,
    /// A straight move.
    Line(PagePoint),
    /// A move along an arc.
    Arc(Arc),
    /// Lowers the pen at the current position.
    Lower,
    /// A dwell, in units of 2^-16 s.
    Dwell(u32),
    /// Moves with the pen up, first to the one position and then to the other.
    Go([PagePoint; 2]),
    /// A parameter is set once the machine has stopped.
    Set(Parameter, MachinePosition),
    /// The position is reported.
    Position,
}

/// A position that a line of G-code sets and the plotter keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    /// The origin of the coordinate system with this index (G10).
    System(usize),
    /// The position of G28 or G30.
    Stored(StoredPosition),
}

/// The state outside the program that its interpreter needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context<'c> {
    /// The settings of the machine.
    pub(super) settings: &'c Settings,
    /// The coordinate systems and kept positions.
    pub(super) parameters: &'c Parameters,
    /// The position of G28.
    pub(super) park: [Millimetres; 2],
    /// Whether the machine is idle, so that the pen is raised whatever the program says.
    pub(super) is_idle: bool,
}

impl Default for Program {
    fn default() -> Self {
        Self {
            motion: Motion::Rapid,
            plane: Plane(0),
            inches: false,
            relative: false,
            inverse_time: false,
            system: 0,
            spindle: 5,
            coolant: [false; 2],
            tool: 0,
            draws: false,
            speed: Millimetres::ZERO,
            feed: NO_FEED,
            move_feed: NO_FEED,
            at: [Millimetres::ZERO; 3],
            shift: [Millimetres::ZERO; 3],
            tool_length: Millimetres::ZERO,
            pen: pen::PenState::default(),
        }
    }
}

impl Program {
    /// The program, continued from the position where `machine` will stop. While the machine only
    /// checks G-code (`checking`), it does not move, so the program keeps its own position.
    pub(super) fn at(self, machine: &Machine<'_>, checking: bool) -> Self {
        let steps = machine.settings().page_steps();
        let [x, y, z] = self.at;
        if checking || steps_at([x, y], steps) == machine.end() {
            return self;
        }
        let [x, y] = machine.millimetres(machine.end());
        Self { at: [x, y, z], ..self }
    }

    /// The program as a reset leaves it: only Z stays.
    pub(super) fn reset(self) -> Self {
        let [.., z] = self.at;
        Self { at: [Millimetres::ZERO, Millimetres::ZERO, z], ..Self::default() }
    }

    /// The program with another Z of the machine.
    pub(super) fn with_z(self, z: Millimetres) -> Self {
        let [x, y, _] = self.at;
        Self { at: [x, y, z], ..self }
    }

    /// Z of the machine, in millimetres.
    pub(super) fn z(&self) -> Millimetres {
        self.at[2]
    }

    /// The program after `line`, the action of that line, and behind it what M0, M2, M6 or M30
    /// order: only a straight move or a dot may come before.
    ///
    /// # Errors
    /// [`CommandError::UnsupportedWord`] for a word that is not known, [`CommandError::Block`] for
    /// words that do not fit together, [`CommandError::NumberOutOfRange`], [`CommandError::Arc`] if
    /// there is no such arc.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn after(
        mut self,
        line: GCode<'_>,
        context: &Context<'_>,
    ) -> Result<(Self, MachineAction, Option<Flow>), CommandError> {
        let block = Block::read(line)?;
        let settings = context.settings;
        let rule = PenRule::of(settings);
        self.begin_line();
        let was_down_at_rest = self.is_down_at_rest(rule);
        let ([from_x, from_y, _], drew) = (self.at, self.draws);
        self.set_feed(&block)?;
        self.set_modes(&block, settings)?;
        let mut action = self.action(&block, context)?;
        self.take_z(&block, settings)?;
        let is_motion =
            block.axis_use == AxisUse::Motion && matches!(action, MachineAction::Nothing);
        if self.motion == Motion::None && block.axis_use != AxisUse::None && block.has_any(b"XYZ") {
            return Err(BlockError::AxisAfterCancel.into());
        }
        if is_motion && !(block.has_any(b"XYZ") || matches!(self.motion, Motion::Arc(_))) {
            // G0 or G1 alone only sets the mode.
        } else if is_motion {
            action = self.motion(&block, context, rule)?;
            let is_dot = self.draws && !drew && !was_down_at_rest;
            let here = steps_at([from_x, from_y], settings.page_steps());
            if is_dot && matches!(action, MachineAction::Line(point) if point == here) {
                // The pen goes down for a move that leads nowhere.
                action = MachineAction::Lower;
            }
        } else if block.axis_use == AxisUse::Motion && block.has_any(b"XYZ") {
            // Beside a dwell or a report of the position.
            return Err(BlockError::AxisConflict.into());
        } else {
            self.check_used(&block)?;
        }
        if block.action == Action::EndShift {
            self.shift = [Millimetres::ZERO; 3];
        }
        if matches!(action, MachineAction::Nothing) {
            let has_dot = block.spindle == Some(5) && self.take_dot();
            // A pen that was raised by itself goes down again if the line speaks of it.
            let goes_down = !was_down_at_rest || (context.is_idle && block.tells_pen());
            if has_dot || (self.is_down_at_rest(rule) && goes_down) {
                action = MachineAction::Lower;
            }
        }
        let is_short = matches!(
            action,
            MachineAction::Nothing | MachineAction::Lower | MachineAction::Line(_)
        );
        if block.flow.is_some() && !is_short {
            return Err(BlockError::AxisConflict.into());
        }
        if block.flow == Some(Flow::End) {
            self.end_modes();
        }
        Ok((self, action, block.flow))
    }

    /// The program after a jog, whose modes are for itself, and the position to go to.
    ///
    /// # Errors
    /// As [`Program::after`].
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn after_jog(
        mut self,
        line: GCode<'_>,
        context: &Context<'_>,
    ) -> Result<(Self, PagePoint), CommandError> {
        let block = Block::read(line)?;
        let mut jog = Self { motion: Motion::Line, inverse_time: false, ..self };
        jog.feed = Millimetres::ZERO;
        block.check_jog()?;
        block.check_used(b"")?;
        jog.set_feed(&block)?;
        if let Some(unused) = [b'S', b'T'].into_iter().find(|letter| block.has(*letter)) {
            return Err(BlockError::Unused(unused).into());
        }
        if jog.feed <= 0 {
            return Err(BlockError::NoFeed.into());
        }
        if !block.has_any(b"XYZ") {
            return Err(BlockError::NoAxis.into());
        }
        jog.inches = block.inches.unwrap_or(jog.inches);
        jog.relative = block.relative.unwrap_or(jog.relative);
        let [x, y, z] = jog.destination(&block, context)?;
        let point = steps_at([x, y], context.settings.page_steps());
        if block.has(b'Z') {
            // A person who moves Z by hand means to lift the pen: a jog never lowers it.
            self.leave_height();
        }
        Ok((Self { at: [x, y, z], move_feed: jog.feed, ..self }, point))
    }

    /// Sets the modes of the line, and what its M3 to M9, S and T say.
    fn set_modes(&mut self, block: &Block, settings: &Settings) -> Result<(), CommandError> {
        self.motion = block.motion.unwrap_or(self.motion);
        self.plane = block.plane.unwrap_or(self.plane);
        self.relative = block.relative.unwrap_or(self.relative);
        self.system = block.system.unwrap_or(self.system);
        match block.coolant {
            Some(7) => self.coolant[0] = true,
            Some(8) => self.coolant[1] = true,
            Some(_) => self.coolant = [false; 2],
            None => {}
        }
        // A dot that M3 asked for is still to be drawn, unless it came with S0.
        let waited = block.spindle == Some(5) && self.take_dot() && !self.is_off_by_speed();
        if let Some(Ok(tool)) = block.number(b'T').map(Decimal::to_whole) {
            self.tool = tool.clamp(0, 255) as u8;
        }
        let servo = block.action == Action::Servo;
        if let Some(speed) = block.number(b'S')
            && block.speed_counts()
        {
            self.take_speed(clamped(speed), servo, settings);
        }
        if let Some(spindle) = block.spindle {
            self.turn(spindle, PenRule::of(settings));
            self.set_dot(waited);
        }
        self.settle_speed(block.has(b'S') || block.spindle.is_some(), settings);
        if servo && PenRule::of(settings) != PenRule::Power {
            return Err(BlockError::ServoIsOff.into());
        }
        Ok(())
    }

    /// Notes what Z says of the pen.
    fn take_z(&mut self, block: &Block, settings: &Settings) -> Result<(), CommandError> {
        if block.axis_use != AxisUse::Motion || !block.has(b'Z') {
            return Ok(());
        }
        let is_down = match block.action {
            // Whatever height the machine's own coordinates name, programs go there to lift.
            Action::Machine => Some(false),
            _ => pen::is_down_at(self.coordinate(block, b'Z')?, self.relative, settings),
        };
        if let Some(is_down) = is_down {
            self.take_height(is_down);
        }
        Ok(())
    }

    /// The action for the coordinates of a line. Moves the position to their end.
    fn motion(
        &mut self,
        block: &Block,
        context: &Context<'_>,
        rule: PenRule,
    ) -> Result<MachineAction, CommandError> {
        let steps = context.settings.page_steps();
        let [from_x, from_y, _] = self.at;
        let [x, y, z] = self.destination(block, context)?;
        if let Motion::Arc(turn) = self.motion {
            let arc = self.arc(block, [[from_x, from_y], [x, y]], turn, steps)?;
            self.check_used_in_motion(block)?;
            if self.inverse_time {
                return Err(BlockError::InverseArc.into());
            }
            self.at = [x, y, z];
            self.draws = self.begin_move(rule);
            let end = steps_at([x, y], steps);
            return Ok(arc.map_or(MachineAction::Line(end), MachineAction::Arc));
        }
        self.check_used_in_motion(block)?;
        if self.inverse_time && self.motion == Motion::Line {
            self.move_feed = inverse_feed([from_x, from_y], [x, y], self.feed);
        }
        if self.motion == Motion::Rapid {
            self.move_feed = NO_FEED;
        }
        self.at = [x, y, z];
        if !block.has_any(b"XY") && block.action != Action::Machine {
            // A move along Z alone only moves the pen.
            return Ok(MachineAction::Nothing);
        }
        self.draws = self.begin_move(rule);
        Ok(MachineAction::Line(steps_at([x, y], steps)))
    }

    /// Checks that a line that does not move has no words that it does not use.
    fn check_used(&self, block: &Block) -> Result<(), CommandError> {
        block.check_used(match block.action {
            Action::Dwell => b"P",
            Action::SetSystem => b"PL",
            _ => b"",
        })
    }

    /// Checks that a move has no words that it does not use.
    fn check_used_in_motion(&self, block: &Block) -> Result<(), CommandError> {
        block.check_used(match self.motion {
            Motion::Arc(_) if block.has(b'R') => b"R",
            Motion::Arc(_) => b"IJK",
            _ => b"",
        })
    }

    /// Sets the modes that M2 and M30 leave.
    fn end_modes(&mut self) {
        self.motion = Motion::Line;
        self.plane = Plane(0);
        self.relative = false;
        if core::mem::take(&mut self.inverse_time) {
            // F is no speed then.
            self.feed = NO_FEED;
        }
        self.system = 0;
        self.coolant = [false; 2];
    }

    /// The coordinate of a letter, in millimetres.
    fn coordinate(&self, block: &Block, letter: u8) -> Result<Millimetres, CommandError> {
        block.number(letter).map_or(Ok(Millimetres::ZERO), |number| self.length(number))
    }

    /// A length as given in the current unit, in millimetres.
    fn length(&self, number: Decimal) -> Result<Millimetres, CommandError> {
        // An inch is 127/5 mm. Sixteen more bits leave only the rounding to 2^-16 mm.
        let bits = number.to_binary_truncated(32).map_err(|_| CommandError::NumberOutOfRange)?;
        let bits = product(bits, if self.inches { 127 } else { 5 });
        i32::try_from(divide_rounding(bits, 5 << 16))
            .map(Millimetres::from_bits)
            .map_err(|_| CommandError::NumberOutOfRange)
    }

    /// The modes as `$G` shows them: the numbers after G, those after M without the coolant, and
    /// whether M7 and M8 are in force.
    pub(super) fn modes(&self) -> ([u8; 6], u8, [bool; 2]) {
        let distance = 90 + u8::from(self.relative);
        let feed = 94 - u8::from(self.inverse_time);
        let units = 21 - u8::from(self.inches);
        let plane = 17 + self.plane.0;
        let modes = [self.motion.number(), 54 + self.system, plane, units, distance, feed];
        (modes, self.spindle, self.coolant)
    }

    /// T, F in mm/min or 1/min, and S. F is 0 if none is set, as Grbl reports it.
    pub(super) fn numbers(&self) -> (u8, Millimetres, Millimetres) {
        let feed = if self.feed == NO_FEED { Millimetres::ZERO } else { self.feed };
        (self.tool, feed, self.speed)
    }

    /// S as a status report has it: 0 while M5 is in force.
    pub(super) fn speed_in_force(&self) -> Millimetres {
        if self.spindle == 5 { Millimetres::ZERO } else { self.speed }
    }

    /// The shift by G92, and that of Z by G43.1.
    pub(super) fn shifts(&self) -> (MachinePosition, Millimetres) {
        (self.shift, self.tool_length)
    }
}

/// Converts a number that is not a length, limiting it to the range.
fn clamped(number: Decimal) -> Millimetres {
    number.to_millimetres().unwrap_or(Millimetres::MAX)
}

/// The length in steps from the page's origin, clamped to a value that still lies beyond every
/// page.
pub fn to_steps(length: Millimetres, per_mm: Millimetres) -> i32 {
    to_steps_within(2 * PAGE_LIMIT, length, per_mm)
}

/// The length in steps from the page's origin, clamped to ± `limit`.
fn to_steps_within(limit: i32, length: Millimetres, per_mm: Millimetres) -> i32 {
    let exact = i64::from(length.to_bits()) * i64::from(per_mm.to_bits());
    let steps = divide_rounding(exact.into(), 1 << 32);
    steps.clamp((-limit).into(), limit.into()) as i32
}

/// A position in steps.
fn steps_at([x, y]: [Millimetres; 2], steps: StepsPerMillimetre) -> PagePoint {
    PagePoint { x: to_steps(x, steps[0]), y: to_steps(y, steps[1]) }
}
