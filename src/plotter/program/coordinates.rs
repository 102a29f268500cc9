//! Coordinate systems, shifts and kept positions: G10, G28, G30, G43.1, G53 and G92.

use super::block::{Action, Block, StoredPosition};
use super::{
    Context, MachineAction, MachinePosition, Motion, Parameter, Parameters, Program, steps_at,
};
use crate::array::MapEach;
use crate::fixed::{Decimal, Millimetres};
use crate::protocol::{BlockError, CommandError};

/// The letters of the axes.
// A position has as many coordinates as there are axes, so the number of an axis is an index of it.
const AXES: [u8; 3] = [b'X', b'Y', b'Z'];

impl Program {
    /// The action of what a line does beside setting modes and moving.
    pub(super) fn action(
        &mut self,
        block: &Block,
        context: &Context<'_>,
    ) -> Result<MachineAction, CommandError> {
        Ok(match block.action {
            Action::None | Action::Servo | Action::EndShift => MachineAction::Nothing,
            Action::Position => MachineAction::Position,
            Action::Machine if matches!(self.motion, Motion::Rapid | Motion::Line) => {
                MachineAction::Nothing
            }
            Action::Machine => return Err(BlockError::Absolute.into()),
            Action::Dwell => {
                let seconds = block.number(b'P').ok_or(BlockError::Missing(b'P'))?;
                let seconds = seconds.to_millimetres().ok().map(|seconds| seconds.to_bits());
                let units = seconds.and_then(|bits| u32::try_from(bits).ok());
                let units =
                    units.map(|units| units / if self.counts_milliseconds() { 1000 } else { 1 });
                MachineAction::Dwell(units.ok_or(CommandError::NumberOutOfRange)?)
            }
            Action::SetSystem => self.set_system(block, context)?,
            Action::Shift => {
                let origin = self.parameters_origin(context);
                let [x, y, z] = self.origin_here(block, origin)?;
                self.shift = [x, y, z];
                MachineAction::Nothing
            }
            Action::StorePosition(kept) => {
                if block.has_any(b"XYZ") {
                    return Err(BlockError::AxisConflict.into());
                }
                MachineAction::Set(Parameter::Stored(kept), self.at)
            }
            Action::GoToStored(kept) => {
                let to = match kept {
                    StoredPosition::Park => [context.park[0], context.park[1], Millimetres::ZERO],
                    StoredPosition::Second => context.parameters.second,
                };
                let via = self.destination(block, context)?;
                // If the line has coordinates, only the named axes move to the stored position.
                let mut end = to;
                if block.has_any(b"XYZ") {
                    for (axis, &letter) in AXES.iter().enumerate() {
                        end[axis] = if block.has(letter) { to[axis] } else { via[axis] };
                    }
                }
                self.at = end;
                self.draws = false;
                if block.has(b'Z') || !block.has_any(b"XY") {
                    self.leave_height();
                }
                let steps = context.settings.page_steps();
                MachineAction::Go([via, end].map_each(|[x, y, _]| steps_at([x, y], steps)))
            }
            Action::ToolLength => {
                if !block.has(b'Z') || block.has_any(b"XY") {
                    return Err(BlockError::ToolAxis.into());
                }
                self.tool_length = self.coordinate(block, b'Z')?;
                MachineAction::Nothing
            }
            Action::EndToolLength => {
                self.tool_length = Millimetres::ZERO;
                MachineAction::Nothing
            }
        })
    }

    /// The action of G10.
    fn set_system(
        &self,
        block: &Block,
        context: &Context<'_>,
    ) -> Result<MachineAction, CommandError> {
        if !block.has_any(b"XYZ") {
            return Err(BlockError::NoAxis.into());
        }
        if !block.has_any(b"PL") {
            return Err(BlockError::Missing(b'P').into());
        }
        let whole = |letter| block.number(letter).map_or(Ok(0), Decimal::to_whole);
        let index = match whole(b'P') {
            Ok(0) => self.system.into(),
            Ok(system @ 1..=6) => system as usize - 1,
            _ => return Err(BlockError::NoSystem.into()),
        };
        let mut origin = context.parameters.system(index);
        match whole(b'L') {
            Ok(2) if block.has(b'R') => return Err(CommandError::UnsupportedWord(b'R')),
            Ok(2) => {
                for (position, letter) in origin.iter_mut().zip([b'X', b'Y', b'Z']) {
                    if block.has(letter) {
                        *position = self.coordinate(block, letter)?;
                    }
                }
            }
            Ok(20) => {
                let here = self.origin_here(block, self.shift)?;
                for (axis, &letter) in AXES.iter().enumerate() {
                    origin[axis] = if block.has(letter) { here[axis] } else { origin[axis] };
                }
            }
            _ => return Err(CommandError::UnsupportedWord(b'L')),
        }
        Ok(MachineAction::Set(Parameter::System(index), origin))
    }

    /// The shift with which the present position, less the origin `from`, has the coordinates of
    /// the line. Axes that the line does not name keep the shift of G92.
    fn origin_here(
        &self,
        block: &Block,
        from: MachinePosition,
    ) -> Result<MachinePosition, CommandError> {
        if !block.has_any(b"XYZ") {
            return Err(BlockError::NoAxis.into());
        }
        let mut origin = self.shift;
        for (axis, &letter) in AXES.iter().enumerate() {
            if !block.has(letter) {
                continue;
            }
            let tool_length = if axis == 2 { self.tool_length } else { Millimetres::ZERO };
            let (Some(at), Some(from)) = (self.at.get(axis), from.get(axis)) else { continue };
            let position = at.checked_sub(*from);
            let position = position.and_then(|position| position.checked_sub(tool_length));
            let coordinate = self.coordinate(block, letter)?;
            let shift = position.and_then(|position| position.checked_sub(coordinate));
            origin[axis] = shift.ok_or(CommandError::NumberOutOfRange)?;
        }
        Ok(origin)
    }

    /// The origin of the coordinate system in force.
    fn parameters_origin(&self, context: &Context<'_>) -> MachinePosition {
        context.parameters.system(self.system.into())
    }

    /// The origin of the coordinates in force, with all shifts.
    pub(in crate::plotter) fn origin(&self, parameters: &Parameters) -> MachinePosition {
        let mut origin = parameters.system(self.system.into());
        for (position, shift) in origin.iter_mut().zip(self.shift) {
            *position = position.saturating_add(shift);
        }
        origin[2] = origin[2].saturating_add(self.tool_length);
        origin
    }

    /// The end of a move with the coordinates of the line, in those of the machine.
    pub(super) fn destination(
        &self,
        block: &Block,
        context: &Context<'_>,
    ) -> Result<MachinePosition, CommandError> {
        let origin = self.origin(context.parameters);
        let end = |at: Millimetres, origin: Millimetres, letter: u8| {
            if !block.has(letter) {
                return Ok(at);
            }
            let base = match block.action {
                Action::Machine => Millimetres::ZERO,
                _ if self.relative => at,
                _ => origin,
            };
            let end = base.checked_add(self.coordinate(block, letter)?);
            end.ok_or(CommandError::NumberOutOfRange)
        };
        let ([x, y, z], [x0, y0, z0]) = (self.at, origin);
        Ok([end(x, x0, b'X')?, end(y, y0, b'Y')?, end(z, z0, b'Z')?])
    }
}
