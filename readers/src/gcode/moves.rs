//! The moves of a program, of which there may be millions: each takes 16 bytes, and 16 more for
//! each point to which it goes.

use super::distance;
use super::pens::Choice;

/// The number of settings of the signals that a new one is compared with. A pen goes up and down
/// again and again.
const COMPARED: usize = 8;

/// The values of the signals that may lift the pen during a move.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Signals {
    pub servo: Option<f64>,
    pub height: Option<f64>,
    /// Whether the height has grown when it changed last: 1.0, or -1.0 if it has not.
    pub growth: Option<f64>,
    /// Whether the spindle is on; `None` if the program has not said.
    pub spindle: Option<bool>,
    pub power: Option<f64>,
    /// Whether the fan is on (`M106`, `M107`); `None` if the program has not said.
    pub fan: Option<bool>,
    /// Whether the coolant is on (`M7` to `M9`); `None` if the program has not said.
    pub coolant: Option<bool>,
    /// Whether the extruder of a 3D printer pushes.
    pub extrudes: bool,
    /// Whether the pen has been lifted to a height of the machine (`G53`, `G28`), and to no other
    /// since.
    pub is_parked: bool,
    /// The line that has changed the height by a distance since the pen was lifted so.
    pub unknown_height: Option<u32>,
    /// The line of the `G53` or `G28` because of which it is not known where the move begins or
    /// ends.
    pub unplaced: Option<u32>,
    /// What has chosen the pen.
    pub choice: Choice,
}

/// A move of the program in mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Move<'m> {
    pub line: u32,
    pub is_rapid: bool,
    pub signals: &'m Signals,
    /// Where it begins, and the points to which it goes, two at least. A touch has one.
    pub points: &'m [[f64; 2]],
}

impl Signals {
    /// Whether what may lift the pen is as with `other`.
    pub fn lifts_as(&self, other: &Self) -> bool {
        let of = |it: &Self| (it.servo, it.height, it.spindle, it.power, it.fan, it.coolant);
        of(self) == of(other) && self.is_parked == other.is_parked
    }
}

impl Move<'_> {
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|ends| distance(ends[0], ends[1])).sum()
    }
}

/// A move as it is kept.
#[derive(Debug)]
struct Kept {
    line: u32,
    is_rapid: bool,
    /// The number of its signals.
    signals: u32,
    /// The number of its last point.
    end: u32,
}

/// The moves of a program. Each begins where the one before has ended.
#[derive(Debug)]
pub(super) struct Moves {
    /// Where the first move begins, and the points to which the moves go.
    points: Vec<[f64; 2]>,
    each: Vec<Kept>,
    /// The places at which the signals changed twice without a move between: there the pen may have
    /// been put down and lifted. For each its line, the number of the signals between the two
    /// changes, and that of the moves before.
    touches: Vec<[u32; 3]>,
    /// The signals that the moves and touches have.
    signals: Vec<Signals>,
}

fn short(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

impl Moves {
    /// No moves, from this point.
    pub fn from(point: [f64; 2]) -> Self {
        Self { points: vec![point], each: Vec::new(), touches: Vec::new(), signals: Vec::new() }
    }

    /// Where the last move has ended.
    pub fn at(&self) -> [f64; 2] {
        self.points.last().copied().unwrap_or_default()
    }

    /// The number of points to which the moves go.
    pub fn point_count(&self) -> usize {
        self.points.len() - 1
    }

    /// The number of these signals.
    fn number_of(&mut self, signals: Signals) -> u32 {
        let last = self.signals.len().saturating_sub(COMPARED);
        let same = self.signals.iter().skip(last).position(|it| *it == signals);
        let number = same.map_or(self.signals.len(), |position| last + position);
        if same.is_none() {
            self.signals.push(signals);
        }
        short(number)
    }

    /// Adds a move to these points, one at least.
    pub fn push(&mut self, line: usize, is_rapid: bool, signals: Signals, to: &[[f64; 2]]) {
        self.points.extend_from_slice(to);
        let (signals, end) = (self.number_of(signals), short(self.point_count()));
        self.each.push(Kept { line: short(line), is_rapid, signals, end });
    }

    /// Adds a touch behind so many moves.
    pub fn touch(&mut self, line: usize, signals: Signals, after: usize) {
        let touch = [short(line), self.number_of(signals), short(after)];
        self.touches.push(touch);
    }

    /// The touches in order, as moves of one point, each with the number of the moves before it.
    pub fn touches(&self) -> impl ExactSizeIterator<Item = (usize, Move<'_>)> + Clone {
        self.touches.iter().map(|&[line, signals, after]| {
            let end = self.each[..after as usize].last().map_or(0, |before| before.end as usize);
            let (signals, points) = (&self.signals[signals as usize], &self.points[end..=end]);
            (after as usize, Move { line, is_rapid: false, signals, points })
        })
    }

    /// The number of moves.
    pub fn len(&self) -> usize {
        self.each.len()
    }

    /// The moves in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = Move<'_>> + ExactSizeIterator + Clone {
        (0..self.each.len()).map(|index| {
            let begin = index.checked_sub(1).map_or(0, |before| self.each[before].end as usize);
            let Kept { line, is_rapid, signals, end } = self.each[index];
            let signals = &self.signals[signals as usize];
            Move { line, is_rapid, signals, points: &self.points[begin..=end as usize] }
        })
    }
}
