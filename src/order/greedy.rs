//! Pen-up moves by greed with regret (Harrison 5.10.1), then by the exchange of pairs.
//!
//! The point whose second choice is so much worse than its first is given its first choice; so to
//! the end. Then any two moves give up their ends for each other's while that shortens them.
//! Nothing is proved of the result.

use super::odd::OddPoints;
use super::pace::Pace;
use super::{NONE, OrderError};
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};

/// What an unmatched point would choose.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Choice {
    /// How much farther the second choice is.
    regret: u32,
    first: u16,
    second: u16,
}

/// Pairs all of `odd`: `mate[i]` is the partner of odd point `i`.
pub(super) fn pair(
    odd: &OddPoints<'_>,
    scratch: &mut Scratch<'_>,
    pace: &mut Pace<'_>,
    mate: &mut [u16],
) -> Result<(), OrderError> {
    mate.fill(NONE);
    with_regret(odd, scratch, pace, mate)?;
    if odd.has_free_ends() {
        free_the_longest(odd, mate);
    }
    while exchange(odd, pace, mate)? {}
    Ok(())
}

fn choose(
    odd: &OddPoints<'_>,
    mate: &[u16],
    chooser: u16,
    pace: &mut Pace<'_>,
) -> Result<Choice, OrderError> {
    let mut choice = Choice { regret: u32::MAX, first: NONE, second: NONE };
    let [mut first_distance, mut second_distance] = [u32::MAX; 2];
    for other in 0..odd.real_count() {
        if other == chooser || mate[usize::from(other)] != NONE {
            continue;
        }
        pace.work(1)?;
        let distance = odd.distance(chooser, other);
        if distance < first_distance {
            second_distance = first_distance;
            choice.second = choice.first;
            first_distance = distance;
            choice.first = other;
        } else if distance < second_distance {
            second_distance = distance;
            choice.second = other;
        }
    }
    choice.regret = second_distance - first_distance;
    Ok(choice)
}

fn with_regret(
    odd: &OddPoints<'_>,
    scratch: &mut Scratch<'_>,
    pace: &mut Pace<'_>,
    mate: &mut [u16],
) -> Result<(), OrderError> {
    let count = odd.real_count();
    let choices: &mut [Choice] = scratch.take(usize::from(count))?;
    for (chooser, choice) in (0..).zip(choices.iter_mut()) {
        *choice = choose(odd, mate, chooser, pace)?;
    }
    for _ in 0..count / 2 {
        let unmatched = |&point: &u16| mate[usize::from(point)] == NONE;
        // The lowest number among equals.
        let Some(chooser) = (0..count)
            .rev()
            .filter(unmatched)
            .max_by_key(|&point| choices[usize::from(point)].regret)
        else {
            break;
        };
        let chosen = choices[usize::from(chooser)].first;
        mate[usize::from(chooser)] = chosen;
        mate[usize::from(chosen)] = chooser;
        pace.work(u32::from(count) / 32)?;
        for point in 0..count {
            let Choice { first, second, .. } = choices[usize::from(point)];
            let lost = |choice| choice == chooser || choice == chosen;
            if mate[usize::from(point)] == NONE && (lost(first) || lost(second)) {
                choices[usize::from(point)] = choose(odd, mate, point, pace)?;
            }
        }
    }
    Ok(())
}

/// Gives the ends of the longest move to the two free ends of the path.
fn free_the_longest(odd: &OddPoints<'_>, mate: &mut [u16]) {
    let [start, end] = odd.free_ends();
    let longest = (0..odd.real_count()).max_by_key(|&point| {
        let partner = mate[usize::from(point)];
        odd.distance(point, partner)
    });
    if let Some(point) = longest {
        let partner = mate[usize::from(point)];
        join(mate, point, start);
        join(mate, partner, end);
    }
}

fn join(mate: &mut [u16], a: u16, b: u16) {
    mate[usize::from(a)] = b;
    mate[usize::from(b)] = a;
}

/// One round of exchanges over all pairs of moves; says whether it shortened anything.
fn exchange(
    odd: &OddPoints<'_>,
    pace: &mut Pace<'_>,
    mate: &mut [u16],
) -> Result<bool, OrderError> {
    let count = odd.count();
    let mut improved = false;
    for a in 0..count {
        for c in a + 1..count {
            let (b, d) = (mate[usize::from(a)], mate[usize::from(c)]);
            if b == c || b < a || d < c {
                continue;
            }
            pace.work(4)?;
            let now = odd.distance(a, b) + odd.distance(c, d);
            let parallel = odd.distance(a, c).saturating_add(odd.distance(b, d));
            let crossed = odd.distance(a, d).saturating_add(odd.distance(b, c));
            if parallel < now && parallel <= crossed {
                join(mate, a, c);
                join(mate, b, d);
                improved = true;
            } else if crossed < now {
                join(mate, a, d);
                join(mate, b, c);
                improved = true;
            }
        }
    }
    Ok(improved)
}

impl From<crate::stage::Aborted> for OrderError {
    fn from(_: crate::stage::Aborted) -> Self {
        Self::Aborted
    }
}

impl From<OutOfScratch> for OrderError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}
