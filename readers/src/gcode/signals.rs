//! Decides which signal of a program lifts the pen, and during which moves it is down.
//!
//! In this order: the angle of a servo (`M280`, `M300`, `M340`, `SET_SERVO`); the height Z; the
//! power S, where the spindle is on from the first move that draws to the last; the spindle or
//! laser (`M3`, `M4`, `M5`), which with the power 0 does not draw, nor before the first power if
//! the program says one, unless the program shows that the pen is up while it is on; the fan
//! (`M106`, `M107`) or the coolant (`M7` to `M9`), on whose pin some have a laser or a pen, if
//! nothing moves by G0 while it is on; or, if none of these changes between moves, G1 to G3 draw
//! and G0 does not.
//! A height that only sets the focus of a laser is down also while the laser is off: then the laser
//! must be on, too, for a move to draw. A laser that stays on over G0 does not burn there. But if
//! any move extrudes, as on a 3D printer, those that do draw, and no others.
//!
//! The pen may also go down and up between two moves. It draws a dot there if the signal is at a
//! level that draws, at least as deep as that of some line. A program without lines draws dots
//! wherever its signal leaves the level of all moves.
//!
//! A signal has levels at which the pen is up and others at which it is down. They are divided
//! such that G0 moves at the ones and G1 to G3 at the others, as far as possible: a program may
//! travel at several heights. Without moves by G0, they are divided where the signal goes to and
//! fro most often, and the pen is up on the side where the program begins and ends. If it shows no
//! such side, the higher Z is taken to be up, and for a servo the first level, which is told. Where
//! Z is only moved by distances that do not cancel out, whether it has grown or fallen last says
//! where the pen is.

use super::moves::{Move, Moves, Signals};

/// Levels that differ by less are the same.
const SAME: f64 = 1e-6;

/// The levels of a signal at which the pen is up.
struct Division {
    /// The level that divides those at which the pen is up from the others.
    middle: f64,
    high_is_up: bool,
}

impl Division {
    fn is_up(&self, level: f64) -> bool {
        (level > self.middle) == self.high_is_up
    }
}

/// A signal that has levels.
struct Signal {
    name: &'static str,
    /// Whether the pen is taken to be up at the high levels; `None` if at the first level.
    high_is_up: Option<bool>,
}

const SERVO: Signal = Signal { name: "level of the servo", high_is_up: None };
const HEIGHT: Signal = Signal { name: "Z", high_is_up: Some(true) };
const POWER: Signal = Signal { name: "S", high_is_up: None };

/// Which moves draw.
#[derive(Default)]
pub(super) struct Inked {
    /// For each move whether it draws.
    pub draws: Vec<bool>,
    /// For each touch whether the pen is put down there.
    pub dots: Vec<bool>,
    /// What was taken, if the program does not show when the pen is up.
    pub note: Option<String>,
}

impl From<Vec<bool>> for Inked {
    fn from(draws: Vec<bool>) -> Self {
        Self { draws, ..Self::default() }
    }
}

/// Decides for each move whether it draws. `end` has the signals at the end of the program, and
/// `has_absolute_heights` says whether a Z was given as a height.
pub(super) fn inked(moves: &Moves, end: &Signals, has_absolute_heights: bool) -> Inked {
    let height: Level = |signals| signals.height.filter(|_| !signals.is_parked);
    let by_height = || match !has_absolute_heights && drift(moves) {
        true => by_level(moves, |signals| signals.growth, end.growth, HEIGHT),
        false => by_level(moves, height, height(end), HEIGHT),
    };
    if moves.iter().any(|it| it.signals.extrudes) {
        return moves.iter().map(|it| it.signals.extrudes).collect::<Vec<bool>>().into();
    }
    let mut inked = by_level(moves, |signals| signals.servo, end.servo, SERVO)
        .or_else(|| by_height().map(|inked| while_on(moves, inked)))
        .or_else(|| by_power(moves, end))
        .or_else(|| dots_alone(moves, end))
        .or_else(|| by_spindle(moves, end))
        .unwrap_or_else(|| by_outputs(moves));
    for (draws, it) in inked.draws.iter_mut().zip(moves.iter()) {
        *draws &= !it.signals.is_parked;
    }
    for (draws, (_, it)) in inked.dots.iter_mut().zip(moves.touches()) {
        *draws &= !it.signals.is_parked;
    }
    inked
}

/// Whether the pen is put down at the touches: at the levels for which `is_down` holds. The level
/// that a program sets first, before any move, puts no pen down, because it may be there already.
fn dots(
    moves: &Moves,
    level: &dyn Fn(&Signals) -> Option<f64>,
    is_down: &dyn Fn(f64) -> bool,
) -> Vec<bool> {
    let mut before = None;
    let touches = moves.touches().map(|(after, it)| {
        let level = level(it.signals);
        let is_set = after > 0 || before.is_some();
        before = level.or(before);
        is_set && level.is_some_and(is_down)
    });
    touches.collect()
}

/// The level of a signal, if the program has said one.
type Level = fn(&Signals) -> Option<f64>;

/// A program that draws dots alone. It travels by G0 alone or by G1 alone, and at one level of a
/// signal, which has another one only between two moves.
fn dots_alone(moves: &Moves, end: &Signals) -> Option<Inked> {
    let mut long = moves.iter().filter(|it| it.length() > SAME);
    let is_rapid = long.clone().next()?.is_rapid;
    if long.any(|it| it.is_rapid != is_rapid) {
        return None;
    }
    // Whether the pen may be down below the level of the moves, and whether above it.
    let signals: [(Level, [bool; 2]); 4] = [
        (|it| it.servo, [true, true]),
        (|it| it.height, [true, false]),
        (|it| it.power.filter(|_| is_on(it)), [true, true]),
        (|it| it.spindle.map(|_| f64::from(u8::from(is_on(it)))), [false, true]),
    ];
    signals.into_iter().find_map(|(level, [below, above])| {
        let up = level(end)?;
        if moves.iter().any(|it| level(it.signals).is_some_and(|it| (it - up).abs() > SAME)) {
            return None;
        }
        let is_down = |it: f64| below && it < up - SAME || above && it > up + SAME;
        let dots = dots(moves, &level, &is_down);
        let is_after_a_move = moves.touches().zip(&dots).any(|((after, _), it)| *it && after > 0);
        let draws = vec![false; moves.len()];
        is_after_a_move.then_some(Inked { draws, dots, note: None })
    })
}

/// The line of the first move by G1 to G3 of which it is not known whether the pen is down, and the
/// line that has changed the height. What extrudes needs no height.
pub(super) fn unknown_height(moves: &Moves) -> Option<(usize, u32)> {
    if moves.iter().any(|it| it.signals.extrudes) {
        return None;
    }
    let mut feeds = moves.iter().filter(|it| !it.is_rapid);
    feeds.find_map(|it| Some((it.line as usize, it.signals.unknown_height?)))
}

/// Whether the moves are at more than two heights.
fn drift(moves: &Moves) -> bool {
    let mut heights: Vec<f64> = moves.iter().filter_map(|it| it.signals.height).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|one, other| (*one - *other).abs() < SAME);
    heights.len() > 2
}

/// Whether the spindle is on, with a power above 0.
fn is_on(signals: &Signals) -> bool {
    signals.spindle == Some(true) && signals.power != Some(0.0)
}

/// Of the moves that draw, those with the spindle on, if it is on during some of those by G1 to G3
/// and off during some. Otherwise all of them.
fn while_on(moves: &Moves, mut inked: Inked) -> Inked {
    let drawn = moves.iter().zip(&inked.draws).filter(|(_, draws)| **draws).map(|(it, _)| it);
    let mut told = drawn.filter(|it| it.signals.spindle.is_some() && it.length() > SAME);
    if told.clone().any(|it| is_on(it.signals) && !it.is_rapid) && told.any(|it| !is_on(it.signals))
    {
        for (draws, it) in inked.draws.iter_mut().zip(moves.iter()) {
            *draws &= is_on(it.signals);
        }
        for (draws, (_, it)) in inked.dots.iter_mut().zip(moves.touches()) {
            *draws &= is_on(it.signals);
        }
    }
    inked
}

/// Of a program with G1 to G3 while the spindle is on, G0 does not draw: it is a laser, or a pen
/// that is up then anyway. Some plotters lift the pen while it is on, which is told.
fn by_spindle(moves: &Moves, end: &Signals) -> Option<Inked> {
    let has_powers = moves.iter().any(|it| it.signals.power.is_some());
    let is_on = |signals: &Signals| is_on(signals) && (signals.power.is_some() || !has_powers);
    let draws: Vec<bool> = if lifts(moves, end, is_on) {
        let is_off = |it: Move<'_>| it.signals.spindle.is_some() && !is_on(it.signals);
        moves.iter().map(|it| is_off(it) && !it.is_rapid).collect()
    } else {
        let feeds = moves.iter().any(|it| is_on(it.signals) && !it.is_rapid);
        moves.iter().map(|it| is_on(it.signals) && !(feeds && it.is_rapid)).collect()
    };
    // A spindle that only runs before the first move lifts no pen.
    if !(draws.contains(&true) && draws.contains(&false)) {
        return None;
    }
    let mut long = moves.iter().zip(&draws).filter(|(it, _)| it.length() > SAME);
    let is_inverted = long.clone().any(|(it, draws)| *draws && !is_on(it.signals));
    let by_rapids = long.clone().all(|(it, draws)| !draws || it.is_rapid);
    let note = if is_inverted {
        Some(
            "the pen is taken to be down while the spindle is off (M5 or S0), because the program \
             travels while it is on: if it is down while it is on, let the program draw by G1 and \
             travel by G0, or begin and end with M5",
        )
    } else if by_rapids && long.clone().any(|(it, draws)| !draws && !it.is_rapid) {
        Some(
            "the pen is taken to be down while the spindle is on, although the program moves by G0 \
             then, and by G1 to G3 while it is off",
        )
    } else {
        None
    };
    // Where the spindle is on during travels, too, a laser does not burn.
    let is_obeyed = is_inverted || long.all(|(it, draws)| *draws || !is_on(it.signals));
    let level = |it: &Signals| it.spindle.map(|_| f64::from(u8::from(is_on(it) != is_inverted)));
    let dots = dots(moves, &level, &|level| is_obeyed && level > 0.0);
    Some(Inked { draws, dots, note: note.map(str::to_owned) })
}

/// Whether the pen is up while the spindle is on. Then G0 moves while it is on, and G1 to G3 while
/// it is off, without what follows the last of these, which may be the way home. Without G0, it is
/// on at the beginning and at the end, always with the same power.
fn lifts(moves: &Moves, end: &Signals, is_on: impl Fn(&Signals) -> bool) -> bool {
    let told = moves.iter().filter(|it| it.signals.spindle.is_some() && it.length() > SAME);
    let told: Vec<Move<'_>> = told.collect();
    let is_drawn = |it: &Move<'_>| !is_on(it.signals) && !it.is_rapid;
    let Some(last) = told.iter().rposition(is_drawn) else { return false };
    let (ways, drawn): (Vec<&Move<'_>>, Vec<&Move<'_>>) =
        told.iter().take(last + 1).partition(|it| is_on(it.signals));
    if told.iter().all(|it| !it.is_rapid) {
        let has_own_power = |it: &Move<'_>| is_on(it.signals) && it.signals.power != end.power;
        let begins = told.first().is_some_and(|it| is_on(it.signals));
        begins && is_on(end) && !told.iter().any(has_own_power)
    } else {
        !ways.is_empty() && ways.iter().all(|it| it.is_rapid) && drawn.into_iter().all(is_drawn)
    }
}

/// Whether a fan or the coolant is on, if the program has said.
type Output = fn(&Signals) -> Option<bool>;

/// By the fan or the coolant, or else, if neither lifts the pen, G1 to G3 draw and G0 does not.
/// Says what is taken, unless that makes no difference.
fn by_outputs(moves: &Moves) -> Inked {
    let by_motion: Vec<bool> = moves.iter().map(|it| !it.is_rapid).collect();
    let outputs: [(&str, Output); 2] =
        [("M106 and M107", |it| it.fan), ("M7 to M9", |it| it.coolant)];
    let mut note = None;
    for (name, output) in outputs {
        let is_on = |it: &Move<'_>| output(it.signals) == Some(true);
        let mut long = moves.iter().filter(|it| it.length() > SAME);
        let is_switched = long.clone().any(|it| is_on(&it)) && long.clone().any(|it| !is_on(&it));
        if !is_switched {
            continue;
        }
        let draws: Vec<bool> = moves.iter().map(|it| is_on(&it)).collect();
        let level = |it: &Signals| output(it).map(|is_on| f64::from(u8::from(is_on)));
        let dots = dots(moves, &level, &|level| level > 0.0);
        let differs = long.clone().any(|it| is_on(&it) == it.is_rapid);
        if !differs {
            return Inked { draws, dots, note: None };
        }
        if !long.clone().any(|it| is_on(&it) && it.is_rapid) || long.all(|it| it.is_rapid) {
            let note = format!("{name} are taken to lift the pen, because nothing else does");
            return Inked { draws, dots, note: Some(note) };
        }
        if moves.iter().any(|it| !is_on(&it) && !it.is_rapid && it.length() > SAME) {
            note.get_or_insert(format!(
                "{name} are not obeyed: the program moves by G0 while they are on, so they are \
                 taken to lift no pen"
            ));
        }
    }
    Inked { draws: by_motion, dots: Vec::new(), note }
}

/// By the power of a spindle that is not switched off between moves, as servos are set.
fn by_power(moves: &Moves, end: &Signals) -> Option<Inked> {
    let first = moves.iter().position(|it| is_on(it.signals))?;
    let last = moves.iter().rposition(|it| is_on(it.signals))?;
    let between = moves.iter().take(last + 1).skip(first);
    if !between.clone().all(|it| is_on(it.signals)) {
        return None;
    }
    let power: Level = |signals| signals.power.filter(|_| is_on(signals));
    let inked = by_level(moves, power, end.power, POWER)?;
    // During G0 a laser does not burn, and during G1 to G3 it does, whatever its power. A pen is up
    // during the one and down during the others, unless it travels by G1 alone.
    let travels = between.clone().any(|it| it.is_rapid);
    let mut divided = between.zip(inked.draws.get(first..=last)?);
    let is_laser =
        travels && divided.any(|(it, draws)| it.is_rapid == *draws && it.length() > SAME);
    (!is_laser).then_some(inked)
}

/// Decides by the levels of a signal, of which `end` is that at the end of the program; `None` if
/// it does not change.
fn by_level(moves: &Moves, level: Level, end: Option<f64>, signal: Signal) -> Option<Inked> {
    let levels: Vec<Option<f64>> = moves.iter().map(|it| level(it.signals)).collect();
    let has = |is_rapid: bool| {
        moves.iter().zip(&levels).any(|(it, level)| it.is_rapid == is_rapid && level.is_some())
    };
    // A program may draw by G0, and need no other word.
    let (division, note) = match has(true) && has(false) {
        true => (by_rapids(moves, &levels)?, None),
        false => by_ends(moves, &levels, end, signal)?,
    };
    // Before the first level the pen is up.
    let is_down = |level: &Option<f64>| level.is_some_and(|level| !division.is_up(level));
    let draws: Vec<bool> = levels.iter().map(is_down).collect();
    // A dot is as deep as something that is drawn: on its way, the pen may stop above the paper.
    let sign = if division.high_is_up { 1.0 } else { -1.0 };
    let drawn = levels.iter().zip(&draws).filter(|(_, draws)| **draws);
    let depth = drawn.filter_map(|(level, _)| *level).map(|it| it * sign).reduce(f64::max);
    let dots = dots(moves, &level, &|it| depth.is_some_and(|depth| it * sign <= depth + SAME));
    Some(Inked { draws, dots, note })
}

/// The division where the signal goes to and fro most often. The pen is up on the side of the level
/// of the first move and of that at the end; before the first level it is up, too. Says what is
/// taken if these are on both sides.
fn by_ends(
    moves: &Moves,
    levels: &[Option<f64>],
    end: Option<f64>,
    signal: Signal,
) -> Option<(Division, Option<String>)> {
    let first = levels.iter().copied().flatten().next()?;
    let middle = most_crossed(levels)?;
    let mut travels = moves.iter().zip(levels).filter(|(it, _)| it.length() > SAME);
    let begin = travels.next().and_then(|(_, level)| *level);
    let is_shown = |high_is_up: &bool| {
        let division = Division { middle, high_is_up: *high_is_up };
        begin.map_or(!division.is_up(first), |level| division.is_up(level))
            && end.or(begin).is_some_and(|level| division.is_up(level))
    };
    if let Some(high_is_up) = [true, false].into_iter().find(is_shown) {
        return Some((Division { middle, high_is_up }, None));
    }
    let high_is_up = signal.high_is_up.unwrap_or(first > middle);
    let name = signal.name;
    let [side, other] = if high_is_up { ["higher", "lower"] } else { ["lower", "higher"] };
    let note = format!(
        "the program does not show at which {name} the pen is up, which is taken to be the {side}: \
         if it is the {other}, let the program begin and end with the pen up"
    );
    Some((Division { middle, high_is_up }, Some(note)))
}

/// The division with the longest way by G0 at the levels that are up, and by G1 to G3 at the
/// others. What comes by G1 after the last change of the level may be the way home, and counts for
/// neither.
fn by_rapids(moves: &Moves, levels: &[Option<f64>]) -> Option<Division> {
    let mut lengths: Vec<(f64, [f64; 2])> = Vec::new();
    let last = levels.last().copied()?;
    let home = levels.iter().rposition(|level| *level != last).map_or(0, |index| index + 1);
    for (index, (it, level)) in moves.iter().zip(levels).enumerate() {
        let length = match it.is_rapid {
            true => [it.length(), 0.0],
            false if index >= home => [0.0; 2],
            false => [0.0, it.length()],
        };
        lengths.extend(level.map(|level| (level, length)));
    }
    lengths.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut high =
        [0, 1].map(|kind: usize| lengths.iter().map(|(_, length)| length[kind]).sum::<f64>());
    let mut low = [0.0; 2];
    let mut best: Option<(f64, f64, Division)> = None;
    for pair in lengths.windows(2) {
        let &[(level, length), (next, _)] = pair else { continue };
        for kind in 0..2 {
            low[kind] += length[kind];
            high[kind] -= length[kind];
        }
        let gap = next - level;
        if gap < SAME {
            continue;
        }
        let [as_up, as_down] = [high[0] + low[1], low[0] + high[1]];
        // The pen is up where all of G0 is. Of a program that also draws by G0, all moves count. If
        // nothing decides, it is up at the higher level.
        let draws_by_both = high[0].min(low[0]) >= SAME;
        let high_is_up = if draws_by_both { as_up >= as_down } else { high[0] >= low[0] };
        let agreed = if high_is_up { as_up } else { as_down };
        let is_better = best.as_ref().is_none_or(|(most, widest, _)| {
            agreed > most + SAME || agreed > most - SAME && gap > *widest
        });
        if is_better {
            let middle = f64::midpoint(level, next);
            best = Some((agreed, gap, Division { middle, high_is_up }));
        }
    }
    best.map(|(_, _, division)| division)
}

/// Returns the middle between the two neighbouring levels between which the signal passes most
/// often, and of those the ones that are farthest apart; `None` if there are not two.
fn most_crossed(levels: &[Option<f64>]) -> Option<f64> {
    // At each level, how many passes begin or end as the levels grow.
    let mut turns: Vec<(f64, i32)> = Vec::new();
    let mut before = None;
    for level in levels.iter().copied().flatten() {
        let from = before.replace(level).unwrap_or(level);
        turns.extend([(from.min(level), 1), (from.max(level), -1)]);
    }
    turns.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut passes = 0;
    let mut best: Option<(i32, f64, f64)> = None;
    for pair in turns.windows(2) {
        let &[(level, turn), (next, _)] = pair else { continue };
        passes += turn;
        let gap = next - level;
        let is_better = best.is_none_or(|(most, widest, _)| (passes, gap) > (most, widest + SAME));
        if gap >= SAME && is_better {
            best = Some((passes, gap, f64::midpoint(level, next)));
        }
    }
    best.map(|(_, _, middle)| middle)
}
