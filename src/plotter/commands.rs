//! Carries out the commands of lines.

use super::stream::{Listing, Task};
use super::{Board, Inner, Reply, records};
use crate::index::Index;
use crate::machine::{MachineError, Setting, SettingError, State, Value};
use crate::model::Model;
use crate::protocol::{Command, CommandError, Significant, next_number};

/// The task that is left after a line has been carried out. Jobs are left to the caller, because
/// their computation needs much stack.
pub(super) enum Next {
    /// The line has been carried out completely.
    Nothing,
    /// The plotter is reset, as by ctrl-X.
    Reset,
    /// Compute the model's job and draw it (`$plot`).
    Plot,
    /// Draw the last job again (`$again`).
    Again,
    /// Draw the rest of the job that has stopped (`$resume`).
    #[cfg(feature = "resume")]
    Resume {
        /// Whether the user has put the pen at the origin.
        at_origin: bool,
    },
    /// Become the USB drive onto which a new firmware image is copied (`$UF2`).
    ShowDrive,
}

impl<I: Index> Inner<'_, I> {
    /// Carries out a line. Returns what is left to the caller to do.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn carry_out<B: Board>(
        &mut self,
        line: &str,
        board: &mut B,
    ) -> Result<Next, CommandError> {
        let command = Command::parse(line)?;
        #[cfg(feature = "tiles")]
        let Some(command) = self.carry_out_in_flash(command, board)? else {
            return Ok(Next::Nothing);
        };
        let one_pen = self.options.one_pen;
        let (model, mut undo_copy, _) = self.split();
        let save_copy = &mut |model: &Model<'_, I>| undo_copy.save(model);
        let added = match command {
            Command::Nothing => Ok(()),
            Command::Vertex(coordinates) => model.add_vertex(coordinates, save_copy),
            Command::Face(numbers) => model.add_face(numbers.iter(), save_copy),
            Command::Polyline(numbers) => model.add_polyline(numbers.iter(), save_copy),
            Command::Degree(degree) => model.set_degree(degree),
            Command::Curve { ends, control } => model.begin_curve(ends, control.iter()),
            Command::Knots(knots) => model.add_knots(knots.iter()),
            // With a single pen, choices of a pen are ignored: no file can then use too many pens.
            Command::Pen { .. } if one_pen => Ok(()),
            Command::Pen { by_material, name } => model.choose_pen(by_material, name, save_copy),
            Command::EndCurve => model.end_curve(save_copy),
            Command::Clear => {
                save_copy(model);
                model.clear();
                Ok(())
            }
            command => return self.carry_out_other(command, board),
        };
        added.map_err(CommandError::Model)?;
        Ok(Next::Nothing)
    }

    /// Carries out a command that is no line of a model. Returns what is left to the caller to do.
    #[inline(never)] // Inlined, its frame would take stack while a model is sent.
    fn carry_out_other<B: Board>(
        &mut self,
        command: Command<'_>,
        board: &mut B,
    ) -> Result<Next, CommandError> {
        match command {
            // The caller has carried these out.
            Command::Nothing
            | Command::Vertex(_)
            | Command::Face(_)
            | Command::Polyline(_)
            | Command::Degree(_)
            | Command::Curve { .. }
            | Command::Knots(_)
            | Command::Pen { .. }
            | Command::EndCurve
            | Command::Clear => {}
            Command::Help => self.task = Some(Task::List(Listing::Help, 0)),
            Command::BuildInfo => {
                self.check_idle()?;
                self.report_build(board);
            }
            Command::Settings { named } => {
                #[cfg(feature = "stream")]
                let may_run = self.is_streamed();
                #[cfg(not(feature = "stream"))]
                let may_run = false;
                let state = self.machine.state();
                let has_stopped = matches!(state, State::Hold { stopped: true });
                if !may_run && !has_stopped && !matches!(state, State::Check | State::Jog) {
                    self.check_idle()?;
                }
                self.task = Some(Task::List(Listing::Settings { named }, 0));
            }
            Command::Modes => self.report_modes(board),
            Command::Parameters => {
                self.check_idle()?;
                self.report_parameters(board);
            }
            Command::StartupLines => {
                self.check_idle()?;
                self.report_startup_lines(board);
            }
            Command::SetStartupLine { index, line } => self.set_startup_line(index, line, board)?,
            Command::SetInfo(text) => {
                self.check_idle()?;
                self.set_info(text, board)?;
            }
            Command::Restore { settings, parameters, texts } => {
                let is_over = self.restore([settings, parameters, texts], board)?;
                return Ok(if is_over { Next::Reset } else { Next::Nothing });
            }
            Command::Assign { name, value } => {
                if !self.options.set(name, value)? {
                    let before = self.machine.held_to();
                    self.change_setting(name, value)?;
                    #[cfg(feature = "driver-pins")]
                    self.set_driver_pins(board);
                    self.report_held(before, board);
                    records::save_settings(self.machine.settings(), board)?;
                }
            }
            Command::Options => self.task = Some(Task::List(Listing::Options, 0)),
            // A model in flash is completed, and no step is made while flash is written.
            #[cfg(feature = "tiles")]
            Command::Model if self.is_uploading() && !self.machine.is_stopped() => {
                return Err(CommandError::Busy);
            }
            Command::Model => self.report_model(board),
            Command::Edit(edit) => self.edit(edit, board)?,
            Command::List(part, numbers) => self.begin_list(part, numbers)?,
            Command::Undo => self.undo()?,
            Command::Plot => return Ok(Next::Plot),
            Command::Again => return Ok(Next::Again),
            #[cfg(feature = "resume")]
            Command::Resume { at_origin } if board.keeps_progress() => {
                return Ok(Next::Resume { at_origin });
            }
            Command::Resume { .. } => return Err(CommandError::NoJobKept),
            Command::ShowDrive if !B::HAS_DRIVE => return Err(CommandError::UnknownSystemCommand),
            Command::ShowDrive if !self.is_without_job() => return Err(CommandError::Busy),
            Command::ShowDrive => return Ok(Next::ShowDrive),
            // The receive interrupt does not know it in this form.
            #[cfg(feature = "hpgl")]
            Command::HpGl => return Err(CommandError::UnknownSystemCommand),
            #[cfg(feature = "stream")]
            Command::BeginStream(header) => self.begin_streamed(header, board)?,
            #[cfg(feature = "stream")]
            Command::Strokes(strokes) => self.take_strokes(strokes)?,
            #[cfg(feature = "stream")]
            Command::Stream => self.report_streamed(board)?,
            Command::Unlock => self.unlock(board)?,
            Command::Home => self.home()?,
            Command::Check => {
                let is_over = self.machine.state() == State::Check;
                // From now on the program follows its own position.
                self.program = self.program.at(&self.machine, is_over);
                self.machine.check(!is_over).map_err(|_| CommandError::Busy)?;
                if is_over {
                    self.restore_z();
                } else {
                    self.z_before_check = Some(self.program.z());
                }
                let text = if is_over { "Disabled" } else { "Enabled" };
                Reply(board).line(format_args!("[MSG:{text}]"));
                if is_over {
                    return Ok(Next::Reset);
                }
            }
            Command::Sleep => {
                self.machine.sleep()?;
                self.resumption.lose_position();
                Reply(board).line(format_args!("[MSG:Sleeping]"));
            }
            Command::Jog(line) => self.jog(line)?,
            Command::GCode(line) => {
                self.run_gcode(line, board).or_else(|error| self.end_at_travel(error))?;
            }
        }
        Ok(Next::Nothing)
    }

    /// Sets the setting with the number `name`.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn change_setting(&mut self, name: &str, value: &str) -> Result<(), CommandError> {
        let mut name = Significant(name.bytes());
        let number = next_number(&mut name).filter(|_| name.next().is_none());
        let setting = number
            .and_then(|number| u16::try_from(number.to_whole().ok()?).ok())
            .and_then(Setting::numbered)
            .ok_or(CommandError::UnknownSystemCommand)?;
        let mut value = Significant(value.bytes());
        let number = next_number(&mut value).ok_or(CommandError::NotANumber)?;
        if value.next().is_some() {
            return Err(CommandError::UnknownSystemCommand);
        }
        let value: Value = number.to_millimetres().map_err(|_| CommandError::NumberOutOfRange)?;
        self.machine.set(setting, value).map_err(CommandError::Setting)
    }
}

impl From<MachineError> for CommandError {
    fn from(error: MachineError) -> Self {
        match error {
            MachineError::State(State::Alarm(_) | State::Sleep) => Self::Locked,
            MachineError::State(_) => Self::Busy,
            error => Self::Machine(error),
        }
    }
}

impl From<SettingError> for CommandError {
    fn from(error: SettingError) -> Self {
        Self::Setting(error)
    }
}
