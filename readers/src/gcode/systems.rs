//! The coordinate systems of a program, `G54` to `G59.3`, and the origin that `G92` sets.
//!
//! The system that is in force at the first move is that of the drawing. Where another one lies is
//! known if the program has told both in coordinates of the machine (`G10 L2`), or which
//! coordinates the pen has in it (`G10 L20`, or `G92`). An absolute coordinate in a system whose
//! place is not known is refused: parts of the drawing would lie upon each other.

use super::{Interpreter, RefusalText};

/// The number of systems.
const COUNT: usize = 9;

/// A command and its line.
pub(super) type Command = (String, usize);

/// What is known of the systems along x or y, in mm.
#[derive(Debug, Clone)]
struct Axis {
    /// Where the coordinate 0 lies in the drawing.
    zero: Option<f64>,
    /// The part of it that G92 has added.
    added: Option<f64>,
    /// What G92 has added last, which `G92.3` adds again.
    kept: Option<f64>,
    /// Where the systems lie in the drawing.
    places: [Option<f64>; COUNT],
    /// Where the systems lie in coordinates of the machine.
    offsets: [Option<f64>; COUNT],
    /// Where the coordinates of the machine lie in the drawing.
    machine: Option<f64>,
    /// What has made the coordinate 0 unknown.
    lost_by: Command,
}

/// The sum of two distances, if both are known.
fn sum(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    Some(one? + other?)
}

/// The distance from `from`, if both ends are known.
fn difference(to: Option<f64>, from: Option<f64>) -> Option<f64> {
    Some(to? - from?)
}

impl Axis {
    fn new() -> Self {
        let mut places = [None; COUNT];
        places[0] = Some(0.0);
        Self {
            zero: Some(0.0),
            added: Some(0.0),
            kept: Some(0.0),
            places,
            offsets: [None; COUNT],
            machine: None,
            lost_by: (String::new(), 0),
        }
    }

    /// Before the first move, nothing of the drawing has a place but the system in force.
    fn begin_in(&mut self, active: usize, place: Option<f64>) {
        self.machine = difference(place, self.offsets[active]);
        self.places = self.offsets.map(|offset| sum(self.machine, offset));
        self.places[active] = place;
    }

    /// Finds the coordinate 0 after a command.
    fn settle(&mut self, active: usize, by: &Command) {
        let zero = sum(self.places[active], self.added);
        if self.zero.is_some() && zero.is_none() {
            self.lost_by = by.clone();
        }
        self.zero = zero;
    }
}

/// The systems, and the origin that G92 has set, along x and y.
#[derive(Debug)]
pub(super) struct Systems {
    active: usize,
    axes: [Axis; 2],
}

/// The number of the system that a code in tenths chooses: G54 to G59, and G59.1 to G59.3.
pub(super) fn chosen(code: i64) -> usize {
    let number = if code > 590 { code - 585 } else { (code - 540) / 10 };
    usize::try_from(number).unwrap_or_default().min(COUNT - 1)
}

impl Systems {
    pub fn new() -> Self {
        Self { active: 0, axes: [Axis::new(), Axis::new()] }
    }

    /// Chooses a system, before the first move or after it.
    pub fn choose(&mut self, system: usize, is_before: bool, by: &Command) {
        if system == self.active {
            return;
        }
        for axis in &mut self.axes {
            if is_before {
                axis.begin_in(system, axis.places[self.active]);
            }
            axis.settle(system, by);
        }
        self.active = system;
    }

    /// The number of the system that the P of G10 means.
    fn named(&self, p: Option<f64>) -> Option<usize> {
        match p.unwrap_or(0.0) {
            0.0 => Some(self.active),
            p if p.fract() == 0.0 && (1.0..=COUNT as f64).contains(&p) => Some(p as usize - 1),
            _ => None,
        }
    }

    /// Carries out `G10 L2`: a system lies at `to` in coordinates of the machine. Returns whether
    /// there is such a system.
    pub fn put(
        &mut self,
        p: Option<f64>,
        to: [Option<f64>; 2],
        is_before: bool,
        by: &Command,
    ) -> bool {
        let Some(system) = self.named(p) else { return false };
        for (axis, to) in self.axes.iter_mut().zip(to) {
            if to.is_none() {
                continue;
            }
            axis.offsets[system] = to;
            match is_before {
                true => axis.begin_in(self.active, axis.places[self.active]),
                false => axis.places[system] = sum(axis.machine, to),
            }
            axis.settle(self.active, by);
        }
        true
    }

    /// Carries out `G10 L20`: in a system, the pen is at `to`, while it is at `at` in the drawing.
    /// Returns whether there is such a system.
    pub fn put_here(
        &mut self,
        p: Option<f64>,
        to: [Option<f64>; 2],
        at: [Option<f64>; 2],
        is_before: bool,
        by: &Command,
    ) -> bool {
        let Some(system) = self.named(p) else { return false };
        for ((axis, to), at) in self.axes.iter_mut().zip(to).zip(at) {
            if to.is_none() {
                continue;
            }
            let zero = difference(at, to);
            let place = difference(zero, axis.added);
            // Where the pen is at first is not known in any other system.
            if is_before {
                axis.offsets[system] = None;
                let own = if system == self.active { place } else { axis.places[self.active] };
                axis.begin_in(self.active, own);
            } else {
                axis.places[system] = place;
                axis.offsets[system] = difference(place, axis.machine);
            }
            axis.settle(self.active, by);
            if system == self.active {
                axis.zero = zero;
            }
        }
        true
    }

    /// Carries out `G92`: the pen is at `to`, while it is at `at` in the drawing.
    pub fn set(&mut self, to: [Option<f64>; 2], at: [Option<f64>; 2], by: &Command) {
        for ((axis, to), at) in self.axes.iter_mut().zip(to).zip(at) {
            if to.is_some() {
                let zero = difference(at, to);
                axis.added = difference(zero, axis.places[self.active]);
                axis.kept = axis.added;
                axis.settle(self.active, by);
                axis.zero = zero;
            }
        }
    }

    /// Carries out the end of G92, for good (`G92.1`) or until `G92.3` restores it (`G92.2`).
    pub fn unset(&mut self, forgets: bool, by: &Command) {
        for axis in &mut self.axes {
            axis.added = Some(0.0);
            if forgets {
                axis.kept = axis.added;
            }
            axis.settle(self.active, by);
        }
    }

    /// Carries out `G92.3`: what G92 has added last is in force again.
    pub fn restore(&mut self, by: &Command) {
        for axis in &mut self.axes {
            axis.added = axis.kept;
            axis.settle(self.active, by);
        }
    }

    /// Where a coordinate of x (0) or y (1), in mm, lies in the drawing.
    pub fn place(&self, axis: usize, coordinate: f64) -> Result<f64, RefusalText> {
        let Some(axis) = self.axes.get(axis) else { return Ok(coordinate) };
        let (name, line) = &axis.lost_by;
        axis.zero.map(|zero| zero + coordinate).ok_or_else(|| {
            format!(
                "{name} in line {line} chose coordinates whose place this file does not tell: set \
                 all systems by G10 L2 at its beginning, or let the program write the drawing in \
                 one system"
            )
        })
    }
}

impl Interpreter {
    /// The X and Y of a line in mm, and the place of the pen where it is known.
    fn pen(&self, value: &impl Fn(char) -> Option<f64>) -> [[Option<f64>; 2]; 2] {
        let given = ['X', 'Y'].map(|letter| value(letter).map(|value| value * self.unit));
        // Before the first move, this is where the drawing begins.
        let is_known = |axis: usize| self.unplaced[axis].is_none() || self.moves.len() == 0;
        let at = self.moves.at();
        let place = |axis: usize| match is_known(axis) {
            true => Some(at[axis]),
            false => self.home[axis].filter(|_| self.is_at_home[axis]),
        };
        [given, [0, 1].map(place)]
    }

    /// Begins the drawing here along the axes of which a coordinate is given.
    fn place_begin(&mut self, given: [Option<f64>; 2]) {
        if self.moves.len() != 0 {
            return;
        }
        let at = self.moves.at();
        for axis in 0..given.len() {
            if given[axis].is_some() {
                self.unplaced[axis] = None;
                self.home[axis] = self.is_at_home[axis].then_some(at[axis]);
            }
        }
    }

    /// Carries out G92.
    pub(super) fn set_origin(&mut self, value: &impl Fn(char) -> Option<f64>, number: usize) {
        let [to, at] = self.pen(value);
        self.systems.set(to, at, &("G92".to_owned(), number));
        if let Some(value) = value('Z') {
            self.lift = self.height - value * self.unit;
            self.kept_lift = self.lift;
        }
        self.place_begin(to);
    }

    /// Carries out G10, which sets a system of coordinates, or a tool.
    pub(super) fn set_system(
        &mut self,
        value: &impl Fn(char) -> Option<f64>,
        number: usize,
    ) -> Result<(), RefusalText> {
        let (Some(kind), [to, at]) = (value('L'), self.pen(value)) else { return Ok(()) };
        let (by, is_before) = ((format!("G10 L{kind}"), number), self.moves.len() == 0);
        if kind == 2.0 && value('R').is_some_and(|angle| angle != 0.0) {
            return Err("R turns the coordinates, which is not read: let the program that wrote \
                        this file turn the drawing itself"
                .to_owned());
        }
        let is_obeyed = match kind {
            2.0 => self.systems.put(value('P'), to, is_before, &by),
            20.0 => self.systems.put_here(value('P'), to, at, is_before, &by),
            _ => false,
        };
        match is_obeyed {
            true if kind == 20.0 => self.place_begin(to),
            true => {}
            false => self.skip(by.0, number),
        }
        Ok(())
    }
}
