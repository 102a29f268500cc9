//! Grbl's commands for what a program leaves behind: modes, coordinate systems, startup lines and
//! defaults.

#[cfg(feature = "early-ink")]
use super::plot::ANSWER_MICROSECONDS;
use super::program::{
    MachineAction, MachinePosition, Parameter, Parameters, Program, StoredPosition, TEXT_LIMIT,
    Text,
};
use super::reply::Reply;
#[cfg(feature = "early-ink")]
use super::stream::Task;
use super::{Board, Inner, records};
use crate::array::MapEach;
use crate::fixed::BinaryFraction;
use crate::index::Index;
use crate::machine::{Setting, Settings, State, Value};
use crate::protocol::{BlockError, CommandError, GCode, Significant};

/// The idleness that ends a program, in microseconds.
const IDLE_MICROSECONDS: u32 = 1_000_000;

/// If work on the flash took less than this many microseconds, nobody was kept waiting.
#[cfg(feature = "early-ink")]
const UNNOTICED_MICROSECONDS: u32 = 2_000;

/// The index of the text of `$I` among the texts; the startup lines come before it.
const INFO: usize = 2;

impl<I: Index> Inner<'_, I> {
    /// Checks that nothing runs, as for commands that take long to answer or change what is kept.
    ///
    /// # Errors
    /// [`CommandError::Busy`].
    pub(super) fn check_idle(&self) -> Result<(), CommandError> {
        match self.machine.state() {
            State::Idle | State::Alarm(_) | State::Sleep => Ok(()),
            _ => Err(CommandError::Busy),
        }
    }

    /// Whether a program is open that idleness would end, or drivers are to be switched off, so
    /// that time must be told. So it must be between two works on the flash.
    pub(super) fn is_timing(&self) -> bool {
        #[cfg(feature = "early-ink")]
        if matches!(self.task, Some(Task::Restore { .. })) {
            return true;
        }
        #[cfg(feature = "driver-pins")]
        if self.machine.driver_rest().is_some() {
            return true;
        }
        let is_at_rest =
            matches!(self.machine.state(), State::Idle | State::Check) && self.machine.is_stopped();
        self.program.is_open() && self.task.is_none() && is_at_rest
    }

    /// Ends the program if a second has passed since the plotter had something to do.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn watch_idleness<B: Board>(&mut self, board: &mut B) {
        if !self.program.is_open() {
            return;
        }
        let now = board.microseconds();
        if !self.is_timing() {
            self.busy_at = now;
        } else if now.wrapping_sub(self.busy_at) >= IDLE_MICROSECONDS {
            self.end_program(board);
        }
    }

    /// Switches the drivers off if the machine has been at rest for as long as `$1` says.
    #[cfg(feature = "driver-pins")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn watch_drivers<B: Board>(&mut self, board: &mut B) {
        let now = board.microseconds();
        match self.machine.driver_rest() {
            None => self.moved_at = now,
            Some(milliseconds) if now.wrapping_sub(self.moved_at) >= milliseconds * 1000 => {
                self.machine.release_drivers(board.queue());
            }
            Some(_) => {}
        }
    }

    /// Passes the settings of the drivers' pins to the board.
    #[cfg(feature = "driver-pins")]
    pub(super) fn set_driver_pins<B: Board>(&self, board: &mut B) {
        let settings = self.machine.settings();
        let steps = settings.get(Setting::InvertSteps).to_num::<u8>();
        board.invert_driver_pins(steps, settings.is_on(Setting::InvertEnable));
    }

    /// Ends the program, and says if it drew nothing.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn end_program<B: Board>(&mut self, board: &mut B) {
        if let Some(note) = self.program.end(self.machine.settings()) {
            Reply(board).line(format_args!("[MSG:{note}]"));
        }
    }

    /// Writes the modes of G-code.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn report_modes<B: Board>(&self, board: &mut B) {
        let ([motion, modes @ ..], spindle, coolant) = self.program.modes();
        let mut reply = Reply(board);
        reply.part(format_args!("[GC:G{motion}"));
        for mode in modes {
            reply.part(format_args!(" G{mode}"));
        }
        let coolant = match coolant {
            [false, false] => "M9",
            [true, false] => "M7",
            [false, true] => "M8",
            [true, true] => "M7 M8",
        };
        let (tool, feed, speed) = self.program.numbers();
        let feed = rate(feed, self.in_inches());
        let speed = whole(speed);
        reply.line(format_args!(" M{spindle} {coolant} T{tool} F{feed} S{speed}]"));
    }

    /// Whether reports are in inches.
    pub(super) fn in_inches(&self) -> bool {
        self.machine.settings().is_on(Setting::ReportInches)
    }

    /// Writes the coordinate systems, kept positions and shifts.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn report_parameters<B: Board>(&self, board: &mut B) {
        let inches = self.in_inches();
        let mut reply = Reply(board);
        let [x, y] = self.context().park;
        let park = [x, y, Value::ZERO];
        let (shift, tool_length) = self.program.shifts();
        let systems = self.parameters.systems.iter().zip([54, 55, 56, 57, 58, 59]);
        for (position, number) in
            systems.chain([(&park, 28), (&self.parameters.second, 30), (&shift, 92)])
        {
            reply.part(format_args!("[G{number}:"));
            reply.coordinates(*position, inches);
            reply.line(format_args!("]"));
        }
        reply.line(format_args!("[TLO:{}]", coordinate(tool_length, inches)));
        reply.part(format_args!("[PRB:"));
        reply.coordinates([Value::ZERO; 3], inches);
        reply.line(format_args!(":0]"));
    }

    /// Writes the position as programs for other machines expect it after M114.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn report_position<B: Board>(&self, board: &mut B) {
        let [x, y] = self.machine.position_mm().map_each(|mm| coordinate(mm, false));
        let z = coordinate(self.program.z(), false);
        Reply(board).line(format_args!("X:{x} Y:{y} Z:{z} E:0.000"));
    }

    /// Writes the startup lines.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn report_startup_lines<B: Board>(&self, board: &mut B) {
        for (index, line) in self.parameters.texts.iter().take(INFO).enumerate() {
            Reply(board).line(format_args!("$N{index}={line}"));
        }
    }

    /// The text that `$I` reports.
    pub(super) fn info(&self) -> &str {
        self.parameters.texts.get(INFO).map_or("", |text| text.as_str())
    }

    /// Sets a startup line, after trying it.
    ///
    /// # Errors
    /// [`CommandError::LineTooLong`], or the refusal of the line. The old line then stays.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn set_startup_line<B: Board>(
        &mut self,
        index: usize,
        line: GCode<'_>,
        board: &mut B,
    ) -> Result<(), CommandError> {
        if self.machine.state() != State::Idle {
            return Err(CommandError::Busy);
        }
        let program = self.after_startup_line(line)?;
        self.set_text(index, &mut Significant(line.text().bytes()).map(char::from), board)?;
        self.note_shift(&program);
        self.program = program;
        // The line is no program.
        let _ = self.program.end(self.machine.settings());
        Ok(())
    }

    /// Sets the text of `$I`.
    ///
    /// # Errors
    /// [`CommandError::LineTooLong`]. The old text then stays.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn set_info<B: Board>(
        &mut self,
        text: &str,
        board: &mut B,
    ) -> Result<(), CommandError> {
        self.set_text(INFO, &mut text.chars(), board)
    }

    fn set_text<B: Board>(
        &mut self,
        index: usize,
        letters: &mut dyn Iterator<Item = char>,
        board: &mut B,
    ) -> Result<(), CommandError> {
        if !self.machine.is_stopped() {
            return Err(CommandError::Busy);
        }
        let mut text = Text::new();
        for letter in letters {
            let too_long = CommandError::LineTooLong { limit: TEXT_LIMIT };
            text.push(letter).map_err(|_| too_long)?;
        }
        if let Some(kept) = self.parameters.texts.get_mut(index) {
            *kept = text;
        }
        records::save_parameters(&self.parameters, board)
    }

    /// The program after a startup line, which may only set modes.
    fn after_startup_line(&self, line: GCode<'_>) -> Result<Program, CommandError> {
        let program = self.program.at(&self.machine, false);
        let (program, action, flow) = program.after(line, &self.context())?;
        match (action, flow) {
            (MachineAction::Nothing, None) => Ok(program),
            _ => Err(BlockError::NotAtStart.into()),
        }
    }

    /// Carries out the startup lines and says how each went, unless the plotter is locked. While
    /// the machine still slows down behind ctrl-X they wait, as all lines do: a position that they
    /// use is the one at which it stops.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn run_startup_lines<B: Board>(&mut self, board: &mut B) {
        self.startup_due = self.machine.state() == State::Abort;
        if self.startup_due {
            return;
        }
        if let State::Alarm(_) = self.machine.state() {
            Reply(board).line(format_args!("[MSG:'$H'|'$X' to unlock]"));
            return;
        }
        for index in 0..INFO {
            let Some(line) = self.parameters.texts.get(index).cloned() else { continue };
            if line.is_empty() {
                continue;
            }
            match GCode::new(&line).and_then(|line| self.after_startup_line(line)) {
                Ok(program) => {
                    self.note_shift(&program);
                    self.program = program;
                    Reply(board).line(format_args!(">{line}:ok"));
                }
                Err(error) => {
                    let number = u32::from(error.number());
                    Reply(board).line(format_args!(">{line}:error:{number}"));
                }
            }
        }
        // These lines are not part of a program, so there is nothing to report at its end.
        let _ = self.program.end(self.machine.settings());
    }

    /// Sets and keeps a parameter.
    ///
    /// # Errors
    /// [`CommandError::Setting`] for a position of G28 that the settings do not hold, or
    /// [`CommandError::NotStored`].
    pub(super) fn set_parameter<B: Board>(
        &mut self,
        parameter: Parameter,
        position: MachinePosition,
        board: &mut B,
    ) -> Result<(), CommandError> {
        let [x, y, _] = position;
        match parameter {
            Parameter::System(index) => {
                if let Some(system) = self.parameters.systems.get_mut(index) {
                    *system = position;
                }
                self.report_counts.origin = 0;
            }
            Parameter::Stored(StoredPosition::Park) => self.machine.set_park([x, y])?,
            Parameter::Stored(StoredPosition::Second) => self.parameters.second = position,
        }
        self.keep(parameter == Parameter::Stored(StoredPosition::Park), board)
    }

    /// Keeps the parameters, or the settings if `settings`.
    pub(super) fn keep<B: Board>(
        &mut self,
        settings: bool,
        board: &mut B,
    ) -> Result<(), CommandError> {
        if settings {
            return records::save_settings(self.machine.settings(), board);
        }
        records::save_parameters(&self.parameters, board)
    }

    /// Ends an alarm, or wakes the plotter. Otherwise nothing is locked, and nothing happens.
    ///
    /// # Errors
    /// [`CommandError::Locked`] while the emergency stop is pressed or the pins still move.
    pub(super) fn unlock<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        if let State::Alarm(_) | State::Sleep = self.machine.state() {
            self.machine.unlock()?;
            Reply(board).line(format_args!("[MSG:Caution: Unlocked]"));
        }
        Ok(())
    }

    /// Notes what the next status report must hold because the program has changed.
    pub(super) fn note_shift(&mut self, program: &Program) {
        let before = &self.program;
        let (modes, spindle, coolant) = program.modes();
        let (modes_before, spindle_before, coolant_before) = before.modes();
        if program.shifts() != before.shifts() || modes[1] != modes_before[1] {
            self.report_counts.origin = 0;
        }
        if (spindle, coolant) != (spindle_before, coolant_before) {
            self.report_counts.overrides = 0;
        }
    }

    /// Restores the defaults of the settings, of the coordinate systems, and of the texts. Returns
    /// whether all is kept. If not, a task keeps the rest.
    ///
    /// # Errors
    /// [`CommandError::Busy`], or [`CommandError::NotStored`]: they are in force, but not kept.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn restore<B: Board>(
        &mut self,
        [settings, parameters, texts]: [bool; 3],
        board: &mut B,
    ) -> Result<bool, CommandError> {
        self.check_idle()?;
        // Steps that are planned may still be due, and none is made while flash is written. What
        // follows would end the sleep.
        if !self.machine.is_stopped() || self.machine.state() == State::Sleep {
            return Err(CommandError::Busy);
        }
        if settings {
            self.machine.restore(Settings::default())?;
        }
        if parameters {
            self.machine.set_park([Value::ZERO; 2])?;
            self.parameters = Parameters {
                texts: core::mem::take(&mut self.parameters.texts),
                ..Parameters::default()
            };
        }
        if texts {
            self.parameters.texts = Default::default();
        }
        #[cfg(feature = "driver-pins")]
        self.set_driver_pins(board);
        Reply(board).line(format_args!("[MSG:Restoring defaults]"));
        #[cfg(feature = "early-ink")]
        let begun = board.microseconds();
        records::save_settings(self.machine.settings(), board)?;
        if !parameters && !texts {
            return Ok(true);
        }
        #[cfg(feature = "early-ink")]
        {
            let now = board.microseconds();
            if now.wrapping_sub(begun) >= UNNOTICED_MICROSECONDS {
                self.task = Some(Task::Restore { since: now });
                return Ok(false);
            }
        }
        records::save_parameters(&self.parameters, board)?;
        Ok(true)
    }

    /// Keeps the parameters after the settings were kept for [`Inner::restore`], if that is the
    /// task. In between the user is listened to for a moment, unless `at_once`, because a sector of
    /// flash may take 400 ms to be erased. Returns the outcome, once there is one.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // It is called seldom.
    pub(super) fn keep_rest<B: Board>(
        &mut self,
        at_once: bool,
        board: &mut B,
    ) -> Option<Result<(), CommandError>> {
        let Some(Task::Restore { since }) = self.task else { return None };
        if !at_once && board.microseconds().wrapping_sub(since) < ANSWER_MICROSECONDS {
            return None;
        }
        self.task = None;
        Some(records::save_parameters(&self.parameters, board))
    }
}

/// Formats a coordinate: millimetres with three decimals, or inches with four.
pub(super) fn coordinate(mm: Value, inches: bool) -> BinaryFraction {
    let units = i64::from(mm.to_bits());
    if inches {
        // An inch is 127/5 mm. Sixteen more bits keep the fourth decimal right.
        let units = (units << 16) * 5 / 127;
        return BinaryFraction { units, fraction_bits: 32, decimals: 4 };
    }
    BinaryFraction { units, fraction_bits: 16, decimals: 3 }
}

/// Formats a speed: whole mm/min, or inches a minute with one decimal.
pub(super) fn rate(mm_per_min: Value, inches: bool) -> BinaryFraction {
    BinaryFraction { decimals: u32::from(inches), ..coordinate(mm_per_min, inches) }
}

/// Formats a number without decimals.
pub(super) fn whole(number: Value) -> BinaryFraction {
    BinaryFraction { units: number.to_bits().into(), fraction_bits: 16, decimals: 0 }
}
