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
use super::{Leg, even_part};
use crate::array::MapEach;
use crate::drawing::{Drawing, PagePoint, Segment};
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};

/// A flag in the degree of the lowest point of a part: the part has an odd point.
fn has_odd<I: Index>() -> I {
    I::ONE << (I::BITS - 1)
}

/// Every point becomes a station if the number of chains then grows at most by this factor, and if
/// [`bytes_a_stop`] allows it.
const MOST_STOPS: usize = 3;
/// Every point becomes a station only if this many bytes are available for each: enough for all
/// later stages.
const fn bytes_a_stop<I>() -> usize {
    32 * size_of::<I>()
}

/// Selects which of the points where two segments meet become stations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stops {
    /// Only the points of those parts that have no odd point, which may be entered anywhere.
    Few,
    /// Those, and the points where a stroke ends if the segments are drawn one after another, each
    /// from its `from` end.
    #[cfg(feature = "early-ink")]
    StrokeEnds,
    /// All points where two segments meet.
    All,
}

// Why no index in this file can fail:
// * The ends of a segment are below `points.len()`: `check` refuses other segments before they are
//   ordered, and those that are chosen as the first come from `build_graph`, which numbers the
//   points. `degree`, `across`, `part`, `station_of` and the points themselves are equally many.
// * `lay_chains` writes numbers of points to `at`, and indices of `at` to `ends`.
// * A leg of the network has a number below `chains`, the length of `ends` and of `outer`: those
//   who have legs made them by counting to `chains`. The gap of an open path has the next number,
//   but `Exchanges::end` keeps it from the network.
// * `next_leg` is called only where exactly two segments of the pen meet, because a chain ends at
//   any other point. There the exclusive or of both numbers and one of them is the other.

/// The stations and chains of one pen. A chain is numbered like a segment: a [`Leg`] of a chain
/// holds the number of the chain and the direction in which it is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Network<'a, I> {
    /// The points of the drawing.
    points: &'a [PagePoint],
    /// The segments of the drawing, those of other pens included.
    segments: &'a [Segment<I>],
    /// The number of the point at which each station lies.
    at: &'a [I],
    /// The stations at which each chain (a run of segments without a choice) begins and ends.
    ends: &'a [[I; 2]],
    /// The first and the last segment of each chain, each with the direction in which the chain
    /// draws it.
    outer: &'a [[Leg<I>; 2]],
    /// Where the pen is when it begins, if that matters.
    anchor: Anchor,
}

/// Where the pen is when a path begins that follows strokes drawn before. The move from there
/// counts, and so the path begins where that is short. Without the feature `early-ink` there are no
/// such strokes, and this takes no memory.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Anchor {
    /// The place; `None` if the pen may begin anywhere.
    #[cfg(feature = "early-ink")]
    place: Option<PagePoint>,
}

impl Anchor {
    /// The path begins at `place`.
    #[cfg(feature = "early-ink")]
    pub const fn new(place: PagePoint) -> Self {
        Self { place: Some(place) }
    }

    /// The place; `None` if the pen may begin anywhere.
    #[inline(always)] // Without the feature, what depends on it is left out.
    pub const fn place(self) -> Option<PagePoint> {
        #[cfg(feature = "early-ink")]
        return self.place;
        #[cfg(not(feature = "early-ink"))]
        None
    }
}

impl<'a, I: Index> Network<'a, I> {
    /// Makes the network of the segments that `pen` draws, with as many stations as is useful. The
    /// pen comes from `anchor`.
    pub fn new(
        drawing: Drawing<'a, I>,
        pen: u8,
        anchor: Anchor,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        Self::with_stops(drawing, pen, Stops::Few, anchor, scratch)
    }

    /// Makes the network of segments that `pen` draws one after another, each from its `from` end.
    /// Every stroke then is a run of chains, which have the numbers 0, 1, 2 and so on in the order
    /// in which they are drawn.
    #[cfg(feature = "early-ink")]
    pub fn of_strokes(
        drawing: Drawing<'a, I>,
        pen: u8,
        anchor: Anchor,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        Self::with_stops(drawing, pen, Stops::StrokeEnds, anchor, scratch)
    }

    /// Makes the network with at least the stations of `least`.
    fn with_stops(
        drawing: Drawing<'a, I>,
        pen: u8,
        least: Stops,
        anchor: Anchor,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        let (mut stations, mut chains, mut stops) = (0, 0, least);
        for wanted in [least, Stops::All] {
            let available = scratch.available_bytes();
            let mut lent = scratch.reborrow();
            let survey = Survey::new(drawing, pen, wanted, &mut lent)?;
            let degrees = || survey.stations().map(|point| survey.degree(point));
            let (points, ends) = (degrees().count(), degrees().sum::<usize>());
            let is_worth_it =
                ends / 2 <= MOST_STOPS * chains && points * bytes_a_stop::<I>() <= available;
            if wanted == least || is_worth_it {
                (stations, chains, stops) = (points, ends / 2, wanted);
            }
        }
        let at = scratch.take(stations)?;
        let ends = scratch.take(chains)?;
        let outer = scratch.take(chains)?;
        let mut lent = scratch.reborrow();
        Survey::new(drawing, pen, stops, &mut lent)?.lay_chains(&mut lent, at, ends, outer)?;
        Ok(Self { points: drawing.points, segments: drawing.segments, at, ends, outer, anchor })
    }

    /// Returns a part of this network, whose stations lie at the points `at` and whose chains join
    /// the stations `ends`. The anchor stays. It cannot be [expanded](Self::expand).
    #[cfg(feature = "threads")]
    pub fn part<'p>(&self, at: &'p [I], ends: &'p [[I; 2]]) -> Network<'p, I>
    where
        'a: 'p,
    {
        Network { at, ends, outer: &[], ..*self }
    }

    /// Returns the number of the point at which a station lies.
    #[cfg(feature = "threads")]
    pub fn point(&self, station: I) -> I {
        self.at[station.get()]
    }

    /// Returns the number of stations, the points where the pen may stop or turn.
    pub fn stations(&self) -> I {
        I::new(self.at.len())
    }

    /// Returns the number of chains, the runs of segments that are drawn without stopping.
    pub fn chains(&self) -> I {
        I::new(self.ends.len())
    }

    /// The number of the point from which the pen comes to the path. It serves as a station, but
    /// has no chains and is not counted. `None` if the path may begin anywhere.
    #[inline(always)] // Without the feature `early-ink`, what depends on it is left out.
    pub fn anchor(&self) -> Option<I> {
        self.anchor.place().map(|_| even_part())
    }

    /// Returns where on the page a station lies; the anchor lies where the pen comes from.
    pub fn position(&self, station: I) -> PagePoint {
        // Only the anchor is missing in `at`, and each entry of `at` is the number of a point.
        let point = self.at.get(station.get()).and_then(|point| self.points.get(point.get()));
        match point {
            Some(&point) => point,
            None => self.anchor_place(),
        }
    }

    /// Returns where the anchor lies.
    #[cold]
    #[inline(never)]
    fn anchor_place(&self) -> PagePoint {
        self.anchor.place().unwrap_or_default()
    }

    /// Returns the distance between two stations in 1/256 steps.
    pub fn distance(&self, from: I, to: I) -> u32 {
        length(self.position(from), self.position(to))
    }

    /// Returns a lower bound of that distance in 1/256 steps, without a square root.
    pub fn least_distance(&self, from: I, to: I) -> u32 {
        least_length(self.position(from), self.position(to))
    }

    /// Returns the square of the distance between two stations, in square steps.
    pub fn square(&self, from: I, to: I) -> u64 {
        square(self.position(from), self.position(to))
    }

    /// Returns the stations (points where the pen may stop) at the start and at the end of a chain
    /// of segments.
    pub fn ends(&self, chain: I) -> [I; 2] {
        self.ends[chain.get()]
    }

    /// Returns the station at which a chain begins when it is drawn in the direction of `leg`.
    pub fn start(&self, leg: Leg<I>) -> I {
        self.ends[leg.segment()][usize::from(leg.reversed())]
    }

    /// Returns the station at which a chain ends when it is drawn in the direction of `leg`.
    pub fn end(&self, leg: Leg<I>) -> I {
        self.start(leg.flipped())
    }

    /// Finds the connected parts. Returns, for each station, the lowest station of its part.
    pub fn parts<'s>(&self, scratch: &mut Scratch<'s>) -> Result<&'s mut [I], OutOfScratch> {
        let lowest = scratch.take(self.stations().get())?;
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
        route: &[Leg<I>],
        tour: &mut [Leg<I>],
        pen: u8,
        scratch: &mut Scratch<'_>,
    ) -> Result<(), OutOfScratch> {
        let across: &mut [I] = scratch.take(self.points.len())?;
        for (number, segment) in pen_segments(self.segments, pen) {
            across[segment.from().get()] ^= number;
            across[segment.to().get()] ^= number;
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
pub(super) fn pen_segments<I: Index>(
    segments: &[Segment<I>],
    pen: u8,
) -> impl Iterator<Item = (I, &Segment<I>)> {
    I::all().zip(segments).filter(move |(_, segment)| segment.pen() == pen)
}

/// Returns the point at which a segment begins when it is drawn in the direction of `leg`.
pub(super) fn start_point<I: Index>(segments: &[Segment<I>], leg: Leg<I>) -> I {
    let segment = &segments[leg.segment()];
    if leg.reversed() { segment.to() } else { segment.from() }
}

/// Returns the segment, and its direction, that goes on where `leg` ends, at a point where exactly
/// two segments meet. `across` holds, for each point, the exclusive or of the numbers of its
/// segments, so that one of two segments gives the other.
fn next_leg<I: Index>(segments: &[Segment<I>], across: &[I], leg: Leg<I>) -> Leg<I> {
    let point = start_point(segments, leg.flipped());
    let number = across[point.get()] ^ I::new(leg.segment());
    Leg::new(number, segments[number.get()].from() != point)
}

/// Marks a point as the end of a stroke, in place of what is known of its segments: no chain goes
/// on there. No exclusive or of two numbers is [`Index::NONE`], because segments have numbers below
/// [`Leg::LIMIT`].
#[cfg(feature = "early-ink")]
fn mark_stroke_end<I: Index>(across: &mut [I], point: I) {
    if let Some(across) = across.get_mut(point.get()) {
        *across = I::NONE;
    }
}

/// What is known of each point of the drawing while the chains are built.
struct Survey<'s, 'a, I> {
    /// The segments of the drawing, those of other pens included.
    segments: &'a [Segment<I>],
    /// The pen whose segments are looked at.
    pen: u8,
    /// Which of the points where two segments meet become stations.
    stops: Stops,
    /// For each point the number of its segments, with the flag [`has_odd`].
    degree: &'s mut [I],
    /// For each point the exclusive or of the numbers of its segments, or [`Index::NONE`] if a
    /// stroke ends there.
    across: &'s mut [I],
    /// For each point, the lowest point of its connected part.
    part: &'s mut [I],
}

impl<'s, 'a, I: Index> Survey<'s, 'a, I> {
    /// Counts the segments at each point, and finds the connected parts.
    fn new(
        drawing: Drawing<'a, I>,
        pen: u8,
        stops: Stops,
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let count = drawing.points.len();
        let degree: &mut [I] = scratch.take(count)?;
        let across: &mut [I] = scratch.take(count)?;
        let part: &mut [I] = scratch.take(count)?;
        let mut parts = Partition::singletons(part);
        for (number, segment) in pen_segments(drawing.segments, pen) {
            for point in [segment.from(), segment.to()] {
                degree[point.get()] += I::ONE;
                across[point.get()] ^= number;
            }
            parts.unite(segment.from(), segment.to());
        }
        parts.flatten();
        for (point, &lowest) in part.iter().enumerate() {
            if degree[point] & I::ONE != I::ZERO {
                degree[lowest.get()] = degree[lowest.get()] | has_odd();
            }
        }
        #[cfg(feature = "early-ink")]
        if stops == Stops::StrokeEnds {
            let mut before = I::NONE;
            for (_, segment) in pen_segments(drawing.segments, pen) {
                if before != segment.from() {
                    mark_stroke_end(across, before);
                    mark_stroke_end(across, segment.from());
                }
                before = segment.to();
            }
            mark_stroke_end(across, before);
        }
        Ok(Self { segments: drawing.segments, pen, stops, degree, across, part })
    }

    /// Returns how many segments meet at the point.
    fn degree(&self, point: I) -> usize {
        (self.degree[point.get()] & (has_odd::<I>() - I::ONE)).get()
    }

    /// Whether the pen may stop or turn at a point, so that a chain ends there.
    fn is_station(&self, point: I) -> bool {
        let lowest = self.part[point.get()];
        match self.degree(point) {
            0 => false,
            2 => {
                self.stops == Stops::All
                    || self.degree[lowest.get()] & has_odd() == I::ZERO
                    || self.is_stroke_end(point)
            }
            _ => true,
        }
    }

    /// Whether a point, at which two segments meet, is marked as the end of a stroke.
    #[inline(always)] // Without the feature, what depends on it is left out.
    fn is_stroke_end(&self, point: I) -> bool {
        cfg!(feature = "early-ink") && self.across[point.get()] == I::NONE
    }

    /// Returns the numbers of the points that are stations, the lowest first.
    fn stations(&self) -> impl Iterator<Item = I> {
        I::below(I::new(self.degree.len())).filter(|&point| self.is_station(point))
    }

    /// Builds the chains, each of which is a run of segments from one station to the next: fills
    /// `at` with the points of the stations, and `ends` and `outer` with the stations and the
    /// outermost segments of each chain.
    fn lay_chains(
        self,
        scratch: &mut Scratch<'_>,
        at: &mut [I],
        ends: &mut [[I; 2]],
        outer: &mut [[Leg<I>; 2]],
    ) -> Result<(), OutOfScratch> {
        for (at, station) in at.iter_mut().zip(self.stations()) {
            *at = station;
        }
        let station_of = self.part;
        station_of.fill(I::NONE);
        for (station, &point) in I::all().zip(at.iter()) {
            station_of[point.get()] = station;
        }
        let laid: &mut [u8] = scratch.take(self.segments.len())?;
        let mut slots = ends.iter_mut().zip(outer);
        for (number, segment) in pen_segments(self.segments, self.pen) {
            let is_station = |point: I| station_of[point.get()] != I::NONE;
            let first = match [segment.from(), segment.to()].map_each(is_station) {
                [false, false] => continue,
                [from, _] => Leg::new(number, !from),
            };
            if laid[number.get()] != 0 {
                continue;
            }
            let mut last = first;
            let end = loop {
                laid[last.segment()] = 1;
                let station = station_of[start_point(self.segments, last.flipped()).get()];
                if station != I::NONE {
                    break station;
                }
                last = next_leg(self.segments, self.across, last);
            };
            if let Some((ends, outer)) = slots.next() {
                let start = station_of[start_point(self.segments, first).get()];
                *ends = [start, end];
                *outer = [first, last];
            }
        }
        Ok(())
    }
}
