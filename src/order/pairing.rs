//! Pairs the odd stations, by the method that was chosen, and chooses where the path begins.

use super::network::Network;
use super::odd::OddPoints;
use super::work_budget::WorkBudget;
use super::{EXACT_POINTS, Method, Options, OrderError, Report, Shape, greedy, matching};
use crate::array::MapEach;
use crate::index::Index;
use crate::stage::Scratch;

/// Pairs the odd stations, which `mate` marks by their own numbers, and writes each one's partner
/// to `mate`. Returns the station where an open path begins.
pub(super) fn pair_odd<I: Index>(
    network: Network<'_, I>,
    options: Options,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
    report: &mut Report,
) -> Result<Option<I>, OrderError> {
    let odd_stations = || I::all().zip(mate.iter()).filter(|&(station, &mark)| station == mark);
    let stations: &mut [I] = scratch.take(odd_stations().count())?;
    for (slot, (station, _)) in stations.iter_mut().zip(odd_stations()) {
        *slot = station;
    }
    work_budget.sort(stations, |&station| (network.position(station).x, station))?;
    let odd = OddPoints::new(network, stations, options.shape == Shape::OpenPath);
    report.odd_points += odd.real_count().into();
    let partners: &mut [I] = scratch.take(odd.count().get())?;
    report.bound += pair_points(&odd, options.method, scratch, work_budget, partners)?;
    for (&station, &partner) in stations.iter().zip(partners.iter()) {
        // The station is an index of `mate`, where its mark was found.
        mate[station.get()] = odd.station(partner).unwrap_or(I::NONE);
    }
    if !odd.has_free_ends() {
        return Ok(None);
    }
    if let Some(anchor) = network.anchor() {
        return Ok(free_for_anchor(network, anchor, stations, mate));
    }
    // There are free ends, and they are the last two of `odd.count()`, the length of `partners`.
    // That count fits in 16 bits: 2^16 - 2 odd points would take more memory than a board has.
    let ends = odd.free_ends().map_each(|end| partners[end.get()]);
    let ends = ends.into_iter().filter_map(|end| odd.station(end));
    Ok(ends.min_by_key(|&station| (network.position(station).x, station)))
}

/// Pairs the two ends of the path with each other, and frees that move in their place whose loss
/// saves most if the path begins at one end of it and the pen comes from `anchor`. Returns that
/// end. The ends of the path are the stations among `odd` whose mate is [`Index::NONE`].
#[inline(always)] // Without the feature `early-ink`, this is left out.
fn free_for_anchor<I: Index>(
    network: Network<'_, I>,
    anchor: I,
    odd: &[I],
    mate: &mut [I],
) -> Option<I> {
    let is_free = |station: &&I| mate.get(station.get()) == Some(&I::NONE);
    let mut free = odd.iter().filter(is_free);
    let (&start, &end) = (free.next()?, free.next()?);
    let mut set = |station: I, to: I| {
        if let Some(mate) = mate.get_mut(station.get()) {
            *mate = to;
        }
    };
    set(start, end);
    set(end, start);
    let saved = |&from: &I| {
        let to = mate.get(from.get()).copied().unwrap_or(from);
        let [lost, added] = [to, anchor].map(|to| i64::from(network.distance(from, to)));
        lost - added
    };
    let start = odd.iter().copied().max_by_key(saved)?;
    let end = mate.get(start.get()).copied()?;
    for station in [start, end] {
        if let Some(mate) = mate.get_mut(station.get()) {
            *mate = I::NONE;
        }
    }
    Some(start)
}

/// Pairs the odd points. Returns a lower bound of the total length of their moves in 1/256 steps,
/// or 0 if none is known.
// Not inlined, so that its stack frame is gone before the tour is improved and its cycles can be
// counted.
#[inline(never)]
fn pair_points<I: Index>(
    odd: &OddPoints<'_, I>,
    method: Method,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    partners: &mut [I],
) -> Result<u64, OrderError> {
    let exact = match method {
        Method::Greedy => false,
        Method::Exact => true,
        Method::Auto => {
            let fits = matching::scratch_bytes::<I>(partners.len()) <= scratch.available_bytes();
            fits && odd.real_count().into() <= EXACT_POINTS
        }
    };
    if exact {
        return matching::pair(odd, scratch, work_budget, partners);
    }
    greedy::pair(odd, &mut scratch, work_budget, partners)?;
    Ok(0)
}
