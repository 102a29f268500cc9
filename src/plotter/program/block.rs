//! A block: the words of one line of G-code, checked against each other as Grbl 1.1 checks them.

use super::{Motion, Plane};
use crate::fixed::Decimal;
use crate::protocol::{BlockError, CommandError, GCode, Word};

/// The action of a line besides setting modes and moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Action {
    /// No other action.
    None,
    /// G4: a dwell.
    Dwell,
    /// G10: sets a coordinate system.
    SetSystem,
    /// G28 or G30: moves to a stored position.
    GoToStored(StoredPosition),
    /// G28.1 or G30.1: stores the current position.
    StorePosition(StoredPosition),
    /// G53: coordinates are those of the machine.
    Machine,
    /// G92: shifts the coordinates.
    Shift,
    /// G92.1: ends the shift.
    EndShift,
    /// G43.1: shifts Z.
    ToolLength,
    /// G49: ends the shift of Z.
    EndToolLength,
    /// M280 or M300: S moves the pen.
    Servo,
    /// M114: reports the position.
    Position,
}

/// The positions that a program can store and return to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) enum StoredPosition {
    /// The position of G28, where the pen is parked.
    Park,
    /// The position of G30.
    Second,
}

/// How a line ends the program or interrupts it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) enum Flow {
    /// M0.
    Pause,
    /// M6.
    ChangePen,
    /// M2 or M30.
    End,
}

/// The purpose of X, Y and Z in a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AxisUse {
    None,
    /// A move.
    Motion,
    /// G10, G28, G30 or G92.
    Action,
    /// G43.1 or G49.
    ToolLength,
}

/// The words of a line.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// The letters that have come, a bit each.
    letters: u32,
    /// The numbers of the letters that are not G or M.
    numbers: [Decimal; 26],
    /// The modal groups that have come, a bit each.
    groups: u16,
    pub(super) axis_use: AxisUse,
    pub(super) action: Action,
    pub(super) flow: Option<Flow>,
    pub(super) motion: Option<Motion>,
    pub(super) plane: Option<Plane>,
    pub(super) relative: Option<bool>,
    pub(super) inverse_time: Option<bool>,
    pub(super) inches: Option<bool>,
    pub(super) system: Option<u8>,
    /// The number of M3, M4 or M5, if the line has one.
    pub(super) spindle: Option<u8>,
    /// 7, 8 or 9.
    pub(super) coolant: Option<u8>,
    /// Whether a word for another kind of machine takes all numbers of the line.
    takes_all: bool,
}

/// The index of a letter.
const fn index(letter: u8) -> usize {
    (letter.wrapping_sub(b'A') & 31) as usize
}

/// The modal groups, and the one of words that are no modes, by the bits in [`Block::groups`].
mod group {
    pub const ACTION: u16 = 1;
    pub const MOTION: u16 = 1 << 1;
    pub const PLANE: u16 = 1 << 2;
    pub const DISTANCE: u16 = 1 << 3;
    pub const ARC_DISTANCE: u16 = 1 << 4;
    pub const FEED: u16 = 1 << 5;
    pub const UNITS: u16 = 1 << 6;
    pub const CUTTER: u16 = 1 << 7;
    pub const TOOL_LENGTH: u16 = 1 << 8;
    pub const SYSTEM: u16 = 1 << 9;
    pub const CONTROL: u16 = 1 << 10;
    pub const FLOW: u16 = 1 << 11;
    pub const SPINDLE: u16 = 1 << 12;
    pub const COOLANT: u16 = 1 << 13;
    pub const OTHER: u16 = 1 << 14;
}

impl Block {
    /// Reads the words of a line.
    ///
    /// # Errors
    /// [`CommandError::UnsupportedWord`] or [`CommandError::Block`] with the first fault.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn read(line: GCode<'_>) -> Result<Self, CommandError> {
        let mut block = Self {
            letters: 0,
            numbers: [Decimal::default(); 26],
            groups: 0,
            axis_use: AxisUse::None,
            action: Action::None,
            flow: None,
            motion: None,
            plane: None,
            relative: None,
            inverse_time: None,
            inches: None,
            system: None,
            spindle: None,
            coolant: None,
            takes_all: false,
        };
        for Word { letter, number } in line.words() {
            match letter {
                b'G' => block.take_g(number)?,
                b'M' => block.take_m(number)?,
                _ => block.take_number(letter, number)?,
            }
        }
        if block.axis_use == AxisUse::None && block.has_any(b"XYZ") && !block.takes_all {
            block.axis_use = AxisUse::Motion;
        }
        Ok(block)
    }

    /// The number of a letter, if it came.
    pub(super) fn number(&self, letter: u8) -> Option<Decimal> {
        self.has(letter).then(|| self.numbers.get(index(letter)).copied()).flatten()
    }

    /// Whether a letter came.
    pub(super) fn has(&self, letter: u8) -> bool {
        self.letters & 1 << index(letter) != 0
    }

    /// Whether any of the letters came.
    pub(super) fn has_any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|letter| self.has(*letter))
    }

    /// Checks that the line has no words but `letters`, and those that any line may have.
    ///
    /// # Errors
    /// [`BlockError::Unused`] with the first other word.
    pub(super) fn check_used(&self, letters: &[u8]) -> Result<(), CommandError> {
        let unused = (b'A'..=b'Z').find(|letter| {
            self.has(*letter) && !b"FNSTXYZ".contains(letter) && !letters.contains(letter)
        });
        match unused {
            Some(letter) if !self.takes_all => Err(BlockError::Unused(letter).into()),
            _ => Ok(()),
        }
    }

    /// Checks that the words are those of a jog.
    ///
    /// # Errors
    /// [`BlockError::NotInAJog`].
    pub(super) fn check_jog(&self) -> Result<(), CommandError> {
        let groups = group::DISTANCE | group::UNITS | group::ACTION;
        let is_jog =
            self.groups & !groups == 0 && matches!(self.action, Action::None | Action::Machine);
        if is_jog { Ok(()) } else { Err(BlockError::NotInAJog.into()) }
    }

    fn take_g(&mut self, number: Decimal) -> Result<(), CommandError> {
        let unknown = Err(CommandError::UnsupportedWord(b'G'));
        // Numbers are compared in hundredths: G28.1 is 2810.
        let Ok(hundredths) = number.to_hundredths() else { return unknown };
        let (whole, part) = (hundredths / 100, hundredths % 100);
        let mut has_part = false;
        let group = match whole {
            4 => self.act(Action::Dwell, group::ACTION)?,
            53 => self.act(Action::Machine, group::ACTION)?,
            10 | 28 | 30 | 92 => {
                if part == 0 {
                    self.use_axes(AxisUse::Action)?;
                }
                let action = match (whole, part) {
                    (10, _) => Action::SetSystem,
                    (28, 0) => Action::GoToStored(StoredPosition::Park),
                    (28, 10) => Action::StorePosition(StoredPosition::Park),
                    (30, 0) => Action::GoToStored(StoredPosition::Second),
                    (30, 10) => Action::StorePosition(StoredPosition::Second),
                    (92, 0) => Action::Shift,
                    (92, 10) => Action::EndShift,
                    _ => return unknown,
                };
                has_part = whole != 10;
                self.act(action, group::ACTION)?
            }
            0..=3 => {
                self.use_axes(AxisUse::Motion)?;
                self.motion = Some(Motion::of(whole));
                group::MOTION
            }
            80 => {
                self.motion = Some(Motion::None);
                group::MOTION
            }
            17..=19 => {
                self.plane = Some(Plane((whole - 17) as u8));
                group::PLANE
            }
            90 | 91 if part == 0 => {
                self.relative = Some(whole == 91);
                group::DISTANCE
            }
            91 if part == 10 => {
                has_part = true;
                group::ARC_DISTANCE
            }
            90 | 91 => return unknown,
            93 | 94 => {
                self.inverse_time = Some(whole == 93);
                group::FEED
            }
            20 | 21 => {
                self.inches = Some(whole == 20);
                group::UNITS
            }
            40 => group::CUTTER,
            43 | 49 => {
                self.use_axes(AxisUse::ToolLength)?;
                let action = match (whole, part) {
                    (49, _) => Action::EndToolLength,
                    (_, 10) => Action::ToolLength,
                    _ => return unknown,
                };
                has_part = true;
                self.act(action, group::TOOL_LENGTH)?
            }
            54..=58 => {
                self.system = Some((whole - 54) as u8);
                group::SYSTEM
            }
            59 if part == 0 => {
                self.system = Some(5);
                group::SYSTEM
            }
            59 => return Err(BlockError::NoSystem.into()),
            61 if part == 0 => group::CONTROL,
            _ => return unknown,
        };
        if part != 0 && !has_part {
            return Err(BlockError::NotWhole(b'G').into());
        }
        self.add_group(group)
    }

    fn take_m(&mut self, number: Decimal) -> Result<(), CommandError> {
        let unknown = Err(CommandError::UnsupportedWord(b'M'));
        let Ok(hundredths) = number.to_hundredths() else { return unknown };
        if hundredths % 100 != 0 {
            return Err(BlockError::NotWhole(b'M').into());
        }
        let whole = hundredths / 100;
        let group = match whole {
            0 => self.interrupt(Flow::Pause, group::FLOW)?,
            1 => group::FLOW,
            2 | 30 => self.interrupt(Flow::End, group::FLOW)?,
            3..=5 => {
                self.spindle = Some(whole as u8);
                group::SPINDLE
            }
            6 => self.interrupt(Flow::ChangePen, group::OTHER)?,
            7..=9 => {
                self.coolant = Some(whole as u8);
                group::COOLANT
            }
            // The motors are on while the plotter is awake, there is no fan, and moves are done in
            // order anyway.
            17 | 18 | 84 | 106 | 107 | 400 => {
                self.takes_all = true;
                group::OTHER
            }
            114 => self.act(Action::Position, group::OTHER)?,
            280 | 300 => {
                self.takes_all = true;
                self.act(Action::Servo, group::OTHER)?
            }
            _ => return unknown,
        };
        self.add_group(group)
    }

    fn take_number(&mut self, letter: u8, number: Decimal) -> Result<(), CommandError> {
        if !b"FIJKLNPRSTXYZ".contains(&letter) {
            return Err(CommandError::UnsupportedWord(letter));
        }
        if letter == b'T' && number.to_whole().is_ok_and(|tool| tool > 255) {
            return Err(BlockError::ToolNumber.into());
        }
        if self.has(letter) {
            return Err(BlockError::Repeated(letter).into());
        }
        if b"FNPST".contains(&letter) && number.is_negative() {
            return Err(BlockError::Negative(letter).into());
        }
        if letter == b'N' && !number.to_binary(0).is_ok_and(|line| line <= 9_999_999) {
            return Err(BlockError::LineNumber.into());
        }
        self.letters |= 1 << index(letter);
        if let Some(slot) = self.numbers.get_mut(index(letter)) {
            *slot = number;
        }
        Ok(())
    }

    /// Whether S is that of the pen or the spindle.
    pub(super) fn speed_counts(&self) -> bool {
        !self.takes_all || self.action == Action::Servo
    }

    /// Whether the line tells the pen to go up or down: by M3 to M5, S, or a move of Z.
    pub(super) fn tells_pen(&self) -> bool {
        self.spindle.is_some()
            || (self.has(b'S') && self.speed_counts())
            || (self.has(b'Z') && self.axis_use == AxisUse::Motion)
    }

    fn use_axes(&mut self, axis_use: AxisUse) -> Result<(), CommandError> {
        if self.axis_use != AxisUse::None {
            return Err(BlockError::AxisConflict.into());
        }
        self.axis_use = axis_use;
        Ok(())
    }

    /// Takes the action of a word of this group, and returns the group. A line has one action; a
    /// second one of the same group is refused with the group.
    fn act(&mut self, action: Action, group: u16) -> Result<u16, CommandError> {
        if self.action != Action::None && self.groups & group == 0 {
            return Err(BlockError::AxisConflict.into());
        }
        self.action = action;
        Ok(group)
    }

    /// Does the same with what ends the program or interrupts it.
    fn interrupt(&mut self, flow: Flow, group: u16) -> Result<u16, CommandError> {
        if self.flow.is_some() && self.groups & group == 0 {
            return Err(BlockError::AxisConflict.into());
        }
        self.flow = Some(flow);
        Ok(group)
    }

    fn add_group(&mut self, group: u16) -> Result<(), CommandError> {
        if self.groups & group != 0 {
            return Err(BlockError::ModalGroup.into());
        }
        self.groups |= group;
        Ok(())
    }
}

impl From<BlockError> for CommandError {
    fn from(error: BlockError) -> Self {
        Self::Block(error)
    }
}
