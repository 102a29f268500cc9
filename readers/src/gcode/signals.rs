//! Decides which signal of a program lifts the pen, and during which moves it is down.
//!
//! In this order: the angle of a servo (`M280`, `M300`, `M340`, `SET_SERVO`); the height Z; the
//! power S, where the spindle is on from the first move that draws to the last; the spindle or
//! laser (`M3`, `M4`, `M5`), which with the power 0 does not draw, nor before the first power if
//! the program says one; or, if none of these changes between moves, G1 to G3 draw and G0 does not.
//! A height that only sets the focus of a laser is down during G0 with the laser off: then the
//! laser must be on, too, for a move to draw. A laser that stays on over G0 does not burn there.
//! But if any move extrudes, as on a 3D printer, those that do draw, and no others.
//!
//! A signal has levels at which the pen is up and others at which it is down. They are divided
//! such that G0 moves at the ones and G1 to G3 at the others, as far as possible: a program may
//! travel at several heights. Without moves by G0, the two levels that come most often are divided;
//! the higher Z is up then, and for a servo the level of the first move. Where Z is only moved by
//! distances that do not cancel out, whether it has grown or fallen last says where the pen is.

use super::moves::{Move, Moves, Signals};

/// Levels that differ by less are the same.
const SAME: f64 = 1e-6;

/// The levels of a signal at which the pen is up.
struct Division {
    /// The level that divides those at which the pen is up from the others.
    middle: f64,
    high_is_up: bool,
}

/// Decides for each move whether it draws. `has_absolute_heights` says whether a Z was given as a
/// height.
pub(super) fn inked(moves: &Moves, has_absolute_heights: bool) -> Vec<bool> {
    let servo = || by_level(moves, |signals| signals.servo, None);
    let height =
        || by_level(moves, |signals| signals.height.filter(|_| !signals.is_parked), Some(true));
    let growth = || by_level(moves, |signals| signals.growth, Some(true));
    let drifts = !has_absolute_heights && drift(moves);
    if moves.iter().any(|it| it.signals.extrudes) {
        return moves.iter().map(|it| it.signals.extrudes).collect();
    }
    let draws = servo()
        .or_else(|| if drifts { growth() } else { height() }.map(|draws| while_on(moves, draws)))
        .or_else(|| by_power(moves))
        .or_else(|| by_spindle(moves))
        .unwrap_or_else(|| moves.iter().map(|it| !it.is_rapid).collect());
    draws.into_iter().zip(moves.iter()).map(|(draws, it)| draws && !it.signals.is_parked).collect()
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

/// Whether the spindle is on during a move, with a power above 0.
fn is_on(it: &Move) -> bool {
    it.signals.spindle == Some(true) && it.signals.power != Some(0.0)
}

/// Of moves that `draws` says to draw, those with the spindle on, if it is off during some of those
/// by G0 and on during some by G1 to G3. Otherwise all of them.
fn while_on(moves: &Moves, mut draws: Vec<bool>) -> Vec<bool> {
    let has = |is_rapid: bool, on: bool| {
        let mut drawn = moves.iter().zip(&draws).filter(|(it, draws)| {
            **draws && it.is_rapid == is_rapid && it.signals.spindle.is_some()
        });
        drawn.any(|(it, _)| is_on(&it) == on && it.length() > SAME)
    };
    if has(true, false) && has(false, true) {
        for (draws, it) in draws.iter_mut().zip(moves.iter()) {
            *draws &= is_on(&it);
        }
    }
    draws
}

/// Of a program with G1 to G3 while the spindle is on, G0 does not draw: it is a laser, or a pen
/// that is up then anyway.
fn by_spindle(moves: &Moves) -> Option<Vec<bool>> {
    let has_powers = moves.iter().any(|it| it.signals.power.is_some());
    let is_on = |it: &Move| is_on(it) && (it.signals.power.is_some() || !has_powers);
    let feeds = moves.iter().any(|it| is_on(&it) && !it.is_rapid);
    let draws = moves.iter().map(|it| is_on(&it) && !(feeds && it.is_rapid));
    let draws: Vec<bool> = draws.collect();
    // A spindle that only runs before the first move lifts no pen.
    (draws.contains(&true) && draws.contains(&false)).then_some(draws)
}

/// By the power of a spindle that is not switched off between moves, as servos are set.
fn by_power(moves: &Moves) -> Option<Vec<bool>> {
    let first = moves.iter().position(|it| is_on(&it))?;
    let last = moves.iter().rposition(|it| is_on(&it))?;
    let between = moves.iter().take(last + 1).skip(first);
    if !between.clone().all(|it| is_on(&it)) {
        return None;
    }
    let power = |signals: &Signals| signals.power.filter(|_| signals.spindle == Some(true));
    let draws = by_level(moves, power, None)?;
    // During G0 a laser does not burn, and during G1 to G3 it does, whatever its power. A pen is up
    // during the one and down during the others, unless it travels by G1 alone.
    let travels = between.clone().any(|it| it.is_rapid);
    let mut divided = between.zip(draws.get(first..=last)?);
    let is_laser =
        travels && divided.any(|(it, draws)| it.is_rapid == *draws && it.length() > SAME);
    (!is_laser).then_some(draws)
}

/// Decides by the levels of a signal; `None` if it does not change.
fn by_level(
    moves: &Moves,
    level: impl Fn(&Signals) -> Option<f64>,
    high_is_up: Option<bool>,
) -> Option<Vec<bool>> {
    let levels: Vec<Option<f64>> = moves.iter().map(|it| level(it.signals)).collect();
    let first = levels.iter().copied().flatten().next()?;
    let has = |is_rapid: bool| {
        moves.iter().zip(&levels).any(|(it, level)| it.is_rapid == is_rapid && level.is_some())
    };
    // A program may draw by G0, and need no other word.
    let division = match has(true) && has(false) {
        true => by_rapids(moves, &levels)?,
        false => {
            let middle = between_most_visited(&levels)?;
            Division { middle, high_is_up: high_is_up.unwrap_or(first > middle) }
        }
    };
    // Before the first level the pen is up.
    let draws = |level: f64| (level > division.middle) != division.high_is_up;
    Some(levels.iter().map(|level| level.is_some_and(draws)).collect())
}

/// The division with the longest way by G0 at the levels that are up, and by G1 to G3 at the
/// others.
fn by_rapids(moves: &Moves, levels: &[Option<f64>]) -> Option<Division> {
    let mut lengths: Vec<(f64, [f64; 2])> = Vec::new();
    for (it, level) in moves.iter().zip(levels) {
        let length = if it.is_rapid { [it.length(), 0.0] } else { [0.0, it.length()] };
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

/// Returns the middle between the two levels to which a signal is set most often; `None` if there
/// are not two.
fn between_most_visited(levels: &[Option<f64>]) -> Option<f64> {
    let mut visited: Vec<f64> = Vec::new();
    for level in levels.iter().copied().flatten() {
        if visited.last().is_none_or(|last| (level - last).abs() >= SAME) {
            visited.push(level);
        }
    }
    visited.sort_by(f64::total_cmp);
    let groups = visited.chunk_by(|one, other| (one - other).abs() < SAME);
    let mut counts: Vec<(usize, f64)> =
        groups.filter_map(|group| Some((group.len(), *group.first()?))).collect();
    counts.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    match counts.as_slice() {
        [(_, one), (_, other), ..] => Some(f64::midpoint(*one, *other)),
        _ => None,
    }
}
