//! Which motors run the wrong way, by what the user sees.

use super::answers::say;
use super::{End, Machine, Setup, jog};
use crate::sender::Sender;
use penup::machine::Setting;

/// The length of the moves that show a direction, in mm.
const SHORT: f64 = 10.0;

/// The direction in which the user saw the pen go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SeenDirection {
    Right,
    Left,
    Up,
    Down,
}

impl SeenDirection {
    /// The words for the directions. Their first letters are enough.
    const WORDS: [(&'static str, Self); 4] =
        [("right", Self::Right), ("left", Self::Left), ("up", Self::Up), ("down", Self::Down)];

    fn vector(self) -> [i8; 2] {
        match self {
            Self::Right => [1, 0],
            Self::Left => [-1, 0],
            Self::Up => [0, 1],
            Self::Down => [0, -1],
        }
    }
}

/// The bits of the setting that inverts directions which must change, if the pen went these ways
/// when it should have gone right, and up. `None` if the motors are exchanged.
///
/// On a CoreXY the motors a and b turn by x + y and x - y. On a polargraph, the way to the right
/// makes the left belt longer and the right one shorter, and the way up makes both shorter; that is
/// enough to tell what the pen does mostly, wherever it hangs between the motors.
fn inverted([x, y]: [SeenDirection; 2], machine: Machine) -> Option<u8> {
    let seen = [x.vector(), y.vector()];
    (0..4).find(|bits| {
        let sign = |bit: u8| if bits & bit == 0 { 1 } else { -1 };
        let moved = |[dx, dy]: [i8; 2]| match machine {
            Machine::Cartesian => [sign(1) * dx, sign(2) * dy],
            Machine::CoreXy => {
                let (a, b) = (sign(1) * (dx + dy), sign(2) * (dx - dy));
                [(a + b) / 2, (a - b) / 2]
            }
            Machine::Polargraph => {
                let (left, right) = (sign(1) * (dx - dy), sign(2) * (-dx - dy));
                [(left - right) / 2, -(left + right) / 2]
            }
        };
        [moved([1, 0]), moved([0, 1])] == seen
    })
}

impl Setup<'_> {
    /// Moves the pen to the right and up until both ways are right. `inverting` is the present
    /// setting.
    pub(super) fn find_directions(
        &mut self,
        sender: &mut Sender<'_>,
        machine: Machine,
        mut inverting: u8,
    ) -> Result<(), End> {
        loop {
            let right = self.observe(sender, [SHORT, 0.0])?;
            let up = self.observe(sender, [0.0, SHORT])?;
            match inverted([right, up], machine) {
                Some(0) => return Ok(()),
                Some(bits) => {
                    inverting ^= bits;
                    self.set(sender, Setting::InvertDirections, f64::from(inverting))?;
                    say("The directions are changed. Once more:");
                }
                None => {
                    say("The motors are exchanged. Switch off, swap the plugs of the two motors, \
                         and run `penup setup` again.");
                    return Err(End::BrokenOff);
                }
            }
        }
    }

    /// Moves the pen, asks which way it went, and moves it back.
    fn observe(&mut self, sender: &mut Sender<'_>, by: [f64; 2]) -> Result<SeenDirection, End> {
        loop {
            jog(sender, by)?;
            let mut words: Vec<(&str, Option<SeenDirection>)> = SeenDirection::WORDS
                .iter()
                .map(|(word, direction)| (*word, Some(*direction)))
                .collect();
            words.push(("not at all", None));
            let question =
                "Which way did the pen go? (right, left, up: away from you, down, not at all)";
            let direction = self.answers.choose(question, &words);
            jog(sender, by.map(|part| -part))?;
            match direction? {
                Some(direction) => return Ok(direction),
                None => {
                    say(
                        "Is the motor supply on? If a motor hums or trembles, its coils are mixed \
                         up or its current is too low.",
                    );
                    if !self.answers.is_yes("Try again?")? {
                        return Err(End::BrokenOff);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SeenDirection::{Down, Left, Right, Up};

    #[test]
    fn directions_are_inverted_as_the_pen_was_seen_to_go() {
        for (seen, straight, core, hanging) in [
            ([Right, Up], Some(0), Some(0), Some(0)),
            ([Left, Up], Some(1), None, None),
            ([Right, Down], Some(2), None, None),
            ([Left, Down], Some(3), Some(3), Some(3)),
            // An inverted motor of a CoreXY or of a polargraph exchanges the axes.
            ([Down, Left], None, Some(1), Some(2)),
            ([Up, Right], None, Some(2), Some(1)),
            ([Up, Up], None, None, None),
        ] {
            let found = [Machine::Cartesian, Machine::CoreXy, Machine::Polargraph]
                .map(|machine| inverted(seen, machine));
            assert_eq!(found, [straight, core, hanging], "{seen:?}");
        }
    }
}
