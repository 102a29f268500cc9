//! The strokes of one pen as a graph: *stations*, where the pen may stop or turn, are joined by
//! *chains* of segments that the pen draws without stopping.
//!
//! A point where two segments meet is usually inside a chain. The exception is a part without any
//! odd point (a circle, a square): it may be entered anywhere, so all its points are stations. A
//! polyline of a hundred segments is thus one chain, and the work of the later stages depends on
//! the number of strokes, not of segments. Where polylines are short and there is memory, every
//! point is a station. The pen may then leave a corner for something near it and come back. Fails
//! if there is not enough memory.

use super::metric::{least_length, length, square};
use super::partition::Partition;
use super::{Leg, NONE};
use crate::array::MapEach;
use crate::drawing::{Drawing, PagePoint, Segment};
use crate::stage::{OutOfScratch, Scratch};

/// A flag in the degree of the lowest point of a part: the part has an odd point.
const HAS_ODD: u16 = 1 << 15;

/// Every point becomes a station if the number of chains then grows at most by this factor, and if
/// [`BYTES_A_STOP`] allows it.
const MOST_STOPS: usize = 3;
/// Every point becomes a station only if this many bytes are available for each: enough for all
/// later stages.
const BYTES_A_STOP: usize = 64;

/// Selects which of the points where two segments meet become stations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stops {
    /// Only those of parts that have no odd point.
    Few,
    /// All of them.
    All,
}

/// The stations and chains of one pen. A chain is numbered like a segment: a [`Leg`] of a chain
/// holds the number of the chain and the direction in which it is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Network<'a> {
    points: &'a [PagePoint],
    segments: &'a [Segment],
    /// The number of the point at which each station lies.
    at: &'a [u16],
    /// The stations at which each chain begins and ends.
    ends: &'a [[u16; 2]],
    /// The first and the last segment of each chain, both as legs in the direction of the chain.
    outer: &'a [[Leg; 2]],
}

impl<'a> Network<'a> {
    /// Makes the network of the segments that `pen` draws.
    pub fn new(
        drawing: Drawing<'a>,
        pen: u8,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        let (mut stations, mut chains, mut stops) = (0, 0, Stops::Few);
        for wanted in [Stops::Few, Stops::All] {
            let available = scratch.available_bytes();
            let mut lent = scratch.reborrow();
            let survey = Survey::new(drawing, pen, wanted, &mut lent)?;
            let degrees = || survey.stations().map(|point| survey.degree(point));
            let (points, ends) = (degrees().count(), degrees().sum::<usize>());
            let is_worth_it = ends / 2 <= MOST_STOPS * chains && points * BYTES_A_STOP <= available;
            if wanted == Stops::Few || is_worth_it {
                (stations, chains, stops) = (points, ends / 2, wanted);
            }
        }
        let at = scratch.take(stations)?;
        let ends = scratch.take(chains)?;
        let outer = scratch.take(chains)?;
        let mut lent = scratch.reborrow();
        Survey::new(drawing, pen, stops, &mut lent)?.lay_chains(&mut lent, at, ends, outer)?;
        Ok(Self { points: drawing.points, segments: drawing.segments, at, ends, outer })
    }

    /// Returns the number of stations.
    pub fn stations(&self) -> u16 {
        self.at.len() as u16
    }

    /// Returns the number of chains.
    pub fn chains(&self) -> u16 {
        self.ends.len() as u16
    }

    /// Returns the page position of a station.
    pub fn position(&self, station: u16) -> PagePoint {
        self.points[usize::from(self.at[usize::from(station)])]
    }

    /// Returns the distance between two stations in 1/256 steps.
    pub fn distance(&self, from: u16, to: u16) -> u32 {
        length(self.position(from), self.position(to))
    }

    /// Returns a lower bound of that distance in 1/256 steps, without a square root.
    pub fn least_distance(&self, from: u16, to: u16) -> u32 {
        least_length(self.position(from), self.position(to))
    }

    /// Returns the square of the distance between two stations, in square steps.
    pub fn square(&self, from: u16, to: u16) -> u64 {
        square(self.position(from), self.position(to))
    }

    /// Returns the stations at the start and at the end of a chain.
    pub fn ends(&self, chain: u16) -> [u16; 2] {
        self.ends[usize::from(chain)]
    }

    /// Returns the station at which the leg of a chain begins.
    pub fn start(&self, leg: Leg) -> u16 {
        self.ends[leg.segment()][usize::from(leg.reversed())]
    }

    /// Returns the station at which the leg of a chain ends.
    pub fn end(&self, leg: Leg) -> u16 {
        self.start(leg.flipped())
    }

    /// Returns, for each station, the lowest station of its connected part.
    pub fn parts<'s>(&self, scratch: &mut Scratch<'s>) -> Result<&'s mut [u16], OutOfScratch> {
        let lowest = scratch.take(usize::from(self.stations()))?;
        let mut parts = Partition::singletons(lowest);
        for &[start, end] in self.ends {
            parts.unite(start, end);
        }
        parts.flatten();
        Ok(lowest)
    }

    /// Writes the segments of the chains of `route`, in this order, to `tour`.
    pub fn expand(
        &self,
        route: &[Leg],
        tour: &mut [Leg],
        pen: u8,
        scratch: &mut Scratch<'_>,
    ) -> Result<(), OutOfScratch> {
        let across: &mut [u16] = scratch.take(self.points.len())?;
        for (number, segment) in pen_segments(self.segments, pen) {
            across[usize::from(segment.from)] ^= number;
            across[usize::from(segment.to)] ^= number;
        }
        let mut tour = tour.iter_mut();
        for &chain in route {
            let [first, last] = self.outer[chain.segment()];
            let (mut leg, last) =
                if chain.reversed() { (last.flipped(), first.flipped()) } else { (first, last) };
            loop {
                if let Some(slot) = tour.next() {
                    *slot = leg;
                }
                if leg == last {
                    break;
                }
                leg = next_leg(self.segments, across, leg);
            }
        }
        Ok(())
    }
}

/// Returns the segments of `pen` with their numbers.
pub(super) fn pen_segments(segments: &[Segment], pen: u8) -> impl Iterator<Item = (u16, &Segment)> {
    (0..=u16::MAX).zip(segments).filter(move |(_, segment)| segment.pen == pen)
}

/// Returns the point at which the leg of a segment begins.
pub(super) fn start_point(segments: &[Segment], leg: Leg) -> u16 {
    let segment = &segments[leg.segment()];
    if leg.reversed() { segment.to } else { segment.from }
}

/// Returns the leg that begins where `leg` ends, at a point where exactly two segments meet.
/// `across` holds, for each point, the exclusive or of the numbers of its segments, so that one of
/// two segments gives the other.
fn next_leg(segments: &[Segment], across: &[u16], leg: Leg) -> Leg {
    let point = start_point(segments, leg.flipped());
    let number = across[usize::from(point)] ^ leg.segment() as u16;
    Leg::new(number, segments[usize::from(number)].from != point)
}

/// The facts about each point that are needed to build the chains.
struct Survey<'s, 'a> {
    segments: &'a [Segment],
    pen: u8,
    stops: Stops,
    /// For each point the number of its segments, with the flag [`HAS_ODD`].
    degree: &'s mut [u16],
    /// For each point the exclusive or of the numbers of its segments.
    across: &'s mut [u16],
    /// For each point, the lowest point of its connected part.
    part: &'s mut [u16],
}

impl<'s, 'a> Survey<'s, 'a> {
    fn new(
        drawing: Drawing<'a>,
        pen: u8,
        stops: Stops,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let count = drawing.points.len();
        let degree: &mut [u16] = scratch.take(count)?;
        let across: &mut [u16] = scratch.take(count)?;
        let part: &mut [u16] = scratch.take(count)?;
        let mut parts = Partition::singletons(part);
        for (number, segment) in pen_segments(drawing.segments, pen) {
            for point in [segment.from, segment.to] {
                degree[usize::from(point)] += 1;
                across[usize::from(point)] ^= number;
            }
            parts.unite(segment.from, segment.to);
        }
        parts.flatten();
        for (point, &lowest) in part.iter().enumerate() {
            if degree[point] % 2 == 1 {
                degree[usize::from(lowest)] |= HAS_ODD;
            }
        }
        Ok(Self { segments: drawing.segments, pen, stops, degree, across, part })
    }

    /// Returns how many segments meet at the point.
    fn degree(&self, point: u16) -> usize {
        usize::from(self.degree[usize::from(point)] & !HAS_ODD)
    }

    /// Whether a point is a station.
    fn is_station(&self, point: u16) -> bool {
        let lowest = self.part[usize::from(point)];
        match self.degree(point) {
            0 => false,
            2 => self.stops == Stops::All || self.degree[usize::from(lowest)] & HAS_ODD == 0,
            _ => true,
        }
    }

    fn stations(&self) -> impl Iterator<Item = u16> {
        (0..self.degree.len() as u16).filter(|&point| self.is_station(point))
    }

    /// Builds the chains: fills `at` with the points of the stations, and `ends` and `outer` with
    /// the stations and the outermost segments of each chain.
    fn lay_chains(
        self,
        scratch: &mut Scratch<'_>,
        at: &mut [u16],
        ends: &mut [[u16; 2]],
        outer: &mut [[Leg; 2]],
    ) -> Result<(), OutOfScratch> {
        for (at, station) in at.iter_mut().zip(self.stations()) {
            *at = station;
        }
        let station_of = self.part;
        station_of.fill(NONE);
        for (station, &point) in (0..).zip(at.iter()) {
            station_of[usize::from(point)] = station;
        }
        let laid: &mut [u8] = scratch.take(self.segments.len())?;
        let mut slots = ends.iter_mut().zip(outer);
        for (number, segment) in pen_segments(self.segments, self.pen) {
            let first =
                match [segment.from, segment.to].map_each(|point| station_of[usize::from(point)]) {
                    [NONE, NONE] => continue,
                    [NONE, _] => Leg::new(number, true),
                    _ => Leg::new(number, false),
                };
            if laid[usize::from(number)] != 0 {
                continue;
            }
            let mut last = first;
            let end = loop {
                laid[last.segment()] = 1;
                let station = station_of[usize::from(start_point(self.segments, last.flipped()))];
                if station != NONE {
                    break station;
                }
                last = next_leg(self.segments, self.across, last);
            };
            if let Some((ends, outer)) = slots.next() {
                let start = station_of[usize::from(start_point(self.segments, first))];
                *ends = [start, end];
                *outer = [first, last];
            }
        }
        Ok(())
    }
}
