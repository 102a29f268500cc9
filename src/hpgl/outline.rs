//! Arcs, circles, rectangles, wedges and ticks.

use super::coordinates::{Frame, Point, UNIT};
use super::interpreter::{Interpreter, Step};
use super::polygon::PolygonBuffer;
use crate::fixed::sin_cos_degrees;

/// A whole turn, in units of 2^-16 degrees.
const TURN: i64 = 360 * UNIT;

/// What a sender asks of the chords of an arc, in units of 2^-16.
#[derive(Debug, Clone, Copy)]
pub(super) enum Chord {
    /// Each turns by at most so many degrees.
    Angle(i64),
    /// Each is at most so many plotter units off the arc.
    Off(i64),
}

/// An arc as straight chords. Where x and y have different scales, it is one of an ellipse. Many
/// may wait in the queue, so what the frame tells is not kept in each.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArcStep {
    center: Point,
    /// From the centre to the beginning.
    radius: Point,
    /// The angle by which the arc turns counterclockwise, in units of 2^-16 degrees.
    sweep: i64,
    /// The number of chords, at least 1.
    chords: u32,
}

impl ArcStep {
    /// The arc with this beginning. If nothing is asked of the chords, they are at most an eighth
    /// of a plotter unit off the arc.
    fn new(center: Point, [radius, across]: [Point; 2], sweep: i64, chord: Option<Chord>) -> Self {
        // A second turn draws the same again.
        let sweep = if sweep.abs() > TURN { sweep % TURN + TURN * sweep.signum() } else { sweep };
        let longest = radius.length().max(across.length()).unsigned_abs();
        let chords = match chord {
            Some(Chord::Angle(angle)) => {
                (sweep.unsigned_abs()).div_ceil(angle.unsigned_abs().max(1))
            }
            // A chord of an angle a is at most r·a²/8 off the arc. A radian has 57.3 degrees.
            Some(Chord::Off(distance)) => {
                let ratio = (longest << 16) / distance.unsigned_abs().saturating_mul(8).max(1);
                // The root is in units of 2^-8.
                (sweep.unsigned_abs() * ratio.isqrt()).div_ceil((57 << 8) << 16)
            }
            // So a is one divided by the root of r in plotter units.
            None => {
                let root = (longest >> 12).isqrt(); // in units of 2^-2
                (sweep.unsigned_abs() * root).div_ceil((57 * 4) << 16)
            }
        };
        Self { center, radius, sweep, chords: chords.clamp(1, 1 << 20) as u32 }
    }

    /// The end of the chord with this index, from 0, in the frame in which the arc was made; `None`
    /// behind the last.
    pub(super) fn chord(&self, index: u32, frame: &Frame) -> Option<Point> {
        if index >= self.chords {
            return None;
        }
        // The product is below 2^53, so the conversion is exact.
        let turned = self.sweep * i64::from(index + 1);
        let degrees = turned as f64 / (65536.0 * f64::from(self.chords));
        let across = frame.across(self.radius)?;
        self.radius.towards(across, sine_and_cosine(degrees)).plus(self.center)
    }
}

/// The sine and the cosine in units of 2^-30.
pub(super) fn sine_and_cosine(degrees: f64) -> [i64; 2] {
    let (sine, cosine) = sin_cos_degrees(degrees);
    let scaled = |number: f64| libm::round(number * f64::from(1 << 30)) as i64;
    [scaled(sine), scaled(cosine)]
}

impl<B: PolygonBuffer> Interpreter<B> {
    /// The arc about a centre that begins at the end of this radius, whatever the scales of x and y
    /// are. `None` beyond the range of coordinates.
    pub(super) fn arc_about(
        &self,
        center: Point,
        radius: Point,
        sweep: i64,
        chord: Option<Chord>,
    ) -> Option<ArcStep> {
        Some(ArcStep::new(center, [radius, self.frame.across(radius)?], sweep, chord))
    }

    /// `AA` and `AR`: an arc about a centre.
    pub(super) fn arc(&mut self, center: Point, sweep: i64, chord: Option<Chord>) {
        let radius = self.at.minus(center);
        if radius == Point::default() {
            return;
        }
        let Some(arc) = self.arc_about(center, radius, sweep, chord) else {
            return self.overflow();
        };
        if self.is_down {
            self.add(Step::Arc(arc));
        } else if let Some(end) = arc.chord(arc.chords - 1, &self.frame) {
            self.add(Step::Travel(end));
        }
    }

    /// `CI`: a circle about the pen, which then returns.
    pub(super) fn circle(&mut self, radius: Point, chord: Option<Chord>) {
        if radius == Point::default() {
            return;
        }
        let center = self.at;
        let arc = self.arc_about(center, radius, TURN, chord);
        let (Some(begin), Some(arc)) = (center.plus(radius), arc) else { return self.overflow() };
        self.add(Step::Place(begin));
        self.add(Step::Arc(arc));
        self.add(Step::Place(center));
    }

    /// `EW`: the outline of a wedge about the pen.
    pub(super) fn wedge(&mut self, radius: Point, sweep: i64, chord: Option<Chord>) {
        let center = self.at;
        let arc = self.arc_about(center, radius, sweep, chord);
        let (Some(begin), Some(arc)) = (center.plus(radius), arc) else { return self.overflow() };
        self.add(Step::Line(begin));
        self.add(Step::Arc(arc));
        self.add(Step::Line(center));
    }

    /// `EA` and `ER`: the outline of a rectangle from the pen to the opposite corner.
    pub(super) fn rectangle(&mut self, corner: Point) {
        let at = self.at;
        for point in [Point { x: corner.x, y: at.y }, corner, Point { x: at.x, y: corner.y }, at] {
            self.add(Step::Line(point));
        }
    }

    /// `XT` and `YT`: a tick across the axis of x or of y.
    pub(super) fn tick(&mut self, across_x: bool) {
        let [forth, back] = self.ticks;
        let at = self.at;
        let [end, begin] = [forth, -back].map(|percent| {
            let percents = if across_x { [0, percent] } else { [percent, 0] };
            at.plus(self.frame.turned(self.frame.percents(percents)))
        });
        let (Some(begin), Some(end)) = (begin, end) else { return self.overflow() };
        self.add(Step::Place(begin));
        self.add(Step::Line(end));
        self.add(Step::Place(at));
    }
}
