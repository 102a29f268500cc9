//! Plotter units and user units, the rotation of the page, and the windows that clip lines.
//!
//! A coordinate is in units of 2^-16 plotter units, below 2^40. Positions are kept on the page:
//! after the scale and the rotation.

use crate::array::MapEach;
use crate::fixed::{divide_rounding, product};

/// One plotter unit, 0.025 mm, in the units of coordinates.
pub const UNIT: i64 = 1 << 16;

/// The number of plotter units in a millimetre.
pub const UNITS_PER_MM: i64 = 40;

/// The greatest coordinate: 2^23 plotter units.
pub const FARTHEST: i64 = 1 << 39;

/// The corners P1 and P2 of the HP 7475A with a sheet of A4.
const CORNERS: [Point; 2] =
    [Point { x: 603 * UNIT, y: 521 * UNIT }, Point { x: 10603 * UNIT, y: 7721 * UNIT }];

/// A position or a distance, in units of 2^-16 plotter units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Point {
    /// To the right.
    pub x: i64,
    /// Upward.
    pub y: i64,
}

impl Point {
    /// The origin.
    pub(super) const ZERO: Self = Self { x: 0, y: 0 };

    /// The sum of both, or `None` beyond the range of coordinates.
    pub(super) fn plus(self, other: Self) -> Option<Self> {
        let Self { x, y } = Self { x: self.x + other.x, y: self.y + other.y };
        (x.abs().max(y.abs()) <= FARTHEST).then_some(Self { x, y })
    }

    /// The distance from `other`.
    pub(super) fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }

    /// The distance of this point from the origin.
    pub(super) fn length(self) -> i64 {
        let square = |length: i64| u128::from(length.unsigned_abs()).pow(2);
        // Each square is below 2^82, so the root fits.
        (square(self.x) + square(self.y)).isqrt() as i64
    }

    /// The point turned counterclockwise by this many quarter turns.
    pub(super) fn turned(self, quarters: u8) -> Self {
        match quarters & 3 {
            0 => self,
            1 => Self { x: -self.y, y: self.x },
            2 => Self { x: -self.x, y: -self.y },
            _ => Self { x: self.y, y: -self.x },
        }
    }

    /// Times a sine and a cosine, in units of 2^-30: turned by that angle.
    pub(super) fn rotated(self, angle: [i64; 2]) -> Self {
        self.towards(Self { x: -self.y, y: self.x }, angle)
    }

    /// Times a cosine, plus `across` times a sine, in units of 2^-30: turned by that angle on the
    /// ellipse on which `across` is a quarter of a turn ahead.
    pub(super) fn towards(self, across: Self, [sine, cosine]: [i64; 2]) -> Self {
        let sum = |a: i64, b: i64| {
            // Each product is below 2^72.
            ((product(a, cosine) + product(b, sine) + (1 << 29)) >> 30) as i64
        };
        Self { x: sum(self.x, across.x), y: sum(self.y, across.y) }
    }
}

/// A rectangle with sides along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rectangle {
    /// The lower left corner.
    pub least: Point,
    /// The upper right corner.
    pub most: Point,
}

impl Rectangle {
    /// The rectangle with these opposite corners.
    pub(super) fn between(a: Point, b: Point) -> Self {
        Self {
            least: Point { x: a.x.min(b.x), y: a.y.min(b.y) },
            most: Point { x: a.x.max(b.x), y: a.y.max(b.y) },
        }
    }

    /// Whether the point lies within the rectangle.
    pub(super) fn contains(&self, Point { x, y }: Point) -> bool {
        (self.least.x..=self.most.x).contains(&x) && (self.least.y..=self.most.y).contains(&y)
    }

    /// Returns the point of the rectangle that is nearest to this one.
    pub(super) fn nearest(&self, Point { x, y }: Point) -> Point {
        let Self { least, most } = *self;
        Point { x: x.min(most.x).max(least.x), y: y.min(most.y).max(least.y) }
    }

    /// Returns the part of the line within the rectangle; `None` if there is none.
    fn clip(&self, mut line: [Point; 2]) -> Option<[Point; 2]> {
        for side in 0..4 {
            let inside = |point: Point| match side {
                0 => point.x - self.least.x,
                1 => self.most.x - point.x,
                2 => point.y - self.least.y,
                _ => self.most.y - point.y,
            };
            let [from, to] = line;
            let [begin, end] = [inside(from), inside(to)];
            if begin < 0 && end < 0 {
                return None;
            }
            if begin >= 0 && end >= 0 {
                continue;
            }
            let (part, whole) = (begin.abs(), begin.abs() + end.abs());
            let at = |from: i64, to: i64| {
                from + divide_rounding(product(to - from, part), whole.into()) as i64
            };
            let crossing = match side {
                0 => Point { x: self.least.x, y: at(from.y, to.y) },
                1 => Point { x: self.most.x, y: at(from.y, to.y) },
                2 => Point { x: at(from.x, to.x), y: self.least.y },
                _ => Point { x: at(from.x, to.x), y: self.most.y },
            };
            line = if begin < 0 { [crossing, to] } else { [from, crossing] };
        }
        Some(line)
    }
}

/// The map from coordinates to positions on the page, and the area of the page on which the pen
/// draws.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Frame {
    /// P1 and P2, in plotter units before the rotation.
    pub(super) corners: [Point; 2],
    /// The user units at P1 and P2: x and x, y and y.
    scale: Option<[i64; 4]>,
    /// The numbers of `SC` and how many there are, because some scales follow P1 and P2.
    asked: ([i64; 7], usize),
    /// How many quarters of a turn the page is turned.
    pub(super) quarters: u8,
    /// The hard clip limits on the page.
    pub(super) limits: Rectangle,
    /// The window that `IW` has chosen, on the page.
    window: Option<Rectangle>,
}

impl Frame {
    /// A value that consists of zero bits. It is not valid before initialization.
    pub(super) const ZERO: Self = Self {
        corners: [Point::ZERO; 2],
        scale: None,
        asked: ([0; 7], 0),
        quarters: 0,
        limits: Rectangle { least: Point::ZERO, most: Point::ZERO },
        window: None,
    };

    /// The state after `IN`, with these hard clip limits.
    pub(super) fn new(limits: Rectangle) -> Self {
        Self { corners: CORNERS, limits, ..Self::default() }
    }

    /// The state after `DF`.
    pub(super) fn set_default(&mut self) {
        (self.scale, self.window) = (None, None);
    }

    /// The position on the page of coordinates in the current units. `None` beyond the range.
    pub(super) fn position(&self, point: Point) -> Option<Point> {
        self.in_plotter_units(point).map(|point| self.on_page(point))
    }

    /// Converts a distance from the current units to the page. `None` beyond the range.
    pub(super) fn distance(&self, distance: Point) -> Option<Point> {
        self.length(distance).map(|distance| distance.turned(self.quarters))
    }

    /// A distance in the current units in plotter units, before the rotation.
    pub(super) fn length(&self, distance: Point) -> Option<Point> {
        let Some([x1, x2, y1, y2]) = self.scale else { return Some(distance) };
        let [p1, p2] = self.corners;
        let x = ratio(distance.x, p2.x - p1.x, x2 - x1)?;
        let y = ratio(distance.y, p2.y - p1.y, y2 - y1)?;
        Some(Point { x, y })
    }

    /// A radius on the page turned by a quarter in the current units, counterclockwise as their
    /// axes are. `None` beyond the range.
    pub(super) fn across(&self, radius: Point) -> Option<Point> {
        let Point { x, y } = radius.turned(4 - self.quarters);
        let [wide, high] = match self.scale {
            None => [1; 2],
            Some([x1, x2, y1, y2]) => {
                let [p1, p2] = self.corners;
                [product(p2.x - p1.x, y2 - y1), product(p2.y - p1.y, x2 - x1)]
            }
        };
        // A length is below 2^41, and the products are below 2^82.
        let scaled = |length: i64, numerator: i128, denominator: i128| {
            if denominator == 0 {
                return None;
            }
            let numerator = i128::from(length) * numerator * denominator.signum();
            let result = divide_rounding(numerator, denominator.abs());
            i64::try_from(result).ok().filter(|result| result.abs() <= FARTHEST)
        };
        let across = Point { x: scaled(-y, wide, high)?, y: scaled(x, high, wide)? };
        Some(across.turned(self.quarters))
    }

    /// Converts a distance from plotter units to the page.
    pub(super) fn turned(&self, distance: Point) -> Point {
        distance.turned(self.quarters)
    }

    fn in_plotter_units(&self, point: Point) -> Option<Point> {
        let Some([x, _, y, _]) = self.scale else { return Some(point) };
        self.length(point.minus(Point { x, y }))?.plus(self.corners[0])
    }

    /// The position on the page of a point in plotter units.
    fn on_page(&self, point: Point) -> Point {
        let Point { x, y } = point.turned(self.quarters);
        let Rectangle { least, most } = self.limits;
        let (width, height) = (least.x + most.x, least.y + most.y);
        let [right, up] = [matches!(self.quarters, 1 | 2), matches!(self.quarters, 2 | 3)];
        Point { x: x + if right { width } else { 0 }, y: y + if up { height } else { 0 } }
    }

    /// A position on the page in plotter units.
    pub(super) fn plotter_units(&self, position: Point) -> Point {
        let origin = self.on_page(Point::default());
        position.minus(origin).turned(4 - self.quarters)
    }

    /// A position on the page in the current units.
    pub(super) fn user_units(&self, position: Point) -> Point {
        let point = self.plotter_units(position);
        let Some([x1, x2, y1, y2]) = self.scale else { return point };
        let [p1, p2] = self.corners;
        let Point { x, y } = point.minus(p1);
        Point {
            x: x1 + ratio(x, x2 - x1, p2.x - p1.x).unwrap_or_default(),
            y: y1 + ratio(y, y2 - y1, p2.y - p1.y).unwrap_or_default(),
        }
    }

    /// Whether coordinates are in user units.
    pub(super) fn is_scaled(&self) -> bool {
        self.scale.is_some()
    }

    /// Whether all that can be drawn on contains the position.
    pub(super) fn contains(&self, position: Point) -> bool {
        self.limits.contains(position) && self.window.is_none_or(|window| window.contains(position))
    }

    /// The part of a line on the page that is drawn.
    pub(super) fn clip(&self, line: [Point; 2]) -> Option<[Point; 2]> {
        let line = self.limits.clip(line)?;
        match self.window {
            Some(window) => window.clip(line),
            None => Some(line),
        }
    }

    /// A rectangle of the page in the current units.
    pub(super) fn seen(&self, Rectangle { least, most }: Rectangle, user: bool) -> Rectangle {
        let [a, b] = [least, most].map_each(|corner| {
            if user { self.user_units(corner) } else { self.plotter_units(corner) }
        });
        Rectangle::between(a, b)
    }

    /// The area on which the pen draws.
    pub(super) fn visible(&self) -> Rectangle {
        let Some(Rectangle { least, most }) = self.window else { return self.limits };
        Rectangle { least: self.limits.nearest(least), most: self.limits.nearest(most) }
    }

    /// The length of a part of a hundred of the distance from P1 to P2, in units of 2^-16 percent.
    pub(super) fn percent(&self, percent: i64) -> i64 {
        let [p1, p2] = self.corners;
        hundredths(p2.minus(p1).length(), percent)
    }

    /// Parts of a hundred of the width and the height between P1 and P2.
    pub(super) fn percents(&self, [x, y]: [i64; 2]) -> Point {
        let [p1, p2] = self.corners;
        Point { x: hundredths(p2.x - p1.x, x), y: hundredths(p2.y - p1.y, y) }
    }

    /// `IP`: sets P1 and P2. Returns `false` for a wrong number of numbers. Without numbers these
    /// are the default corners of the page as it is turned. A later `RO` does not change them.
    pub(super) fn set_corners(&mut self, numbers: &[i64]) -> bool {
        self.corners = match *numbers {
            [] if self.quarters & 1 == 1 => CORNERS.map_each(|Point { x, y }| Point { x: y, y: x }),
            [] => CORNERS,
            [x, y] => {
                let [p1, p2] = self.corners;
                let first = Point { x, y };
                [first, p2.minus(p1).plus(first).unwrap_or(p2)]
            }
            [x1, y1, x2, y2] => [Point { x: x1, y: y1 }, Point { x: x2, y: y2 }],
            _ => return false,
        };
        let (asked, count) = self.asked;
        // A scale that is impossible with these corners stays as it was.
        if self.scale.is_some()
            && let Some(numbers) = asked.get(..count)
            && let Some(scale) = self.scale_by(numbers)
        {
            self.scale = Some(scale);
        }
        true
    }

    /// `SC`: sets the user units. Returns `false` for units of no length.
    pub(super) fn set_scale(&mut self, numbers: &[i64]) -> bool {
        self.scale = self.scale_by(numbers);
        for (slot, number) in self.asked.0.iter_mut().zip(numbers) {
            *slot = *number;
        }
        self.asked.1 = numbers.len();
        self.scale.is_some() || numbers.is_empty()
    }

    /// The user units at P1 and P2 that these numbers of `SC` mean; `None` for plotter units and
    /// for numbers that mean nothing.
    fn scale_by(&self, numbers: &[i64]) -> Option<[i64; 4]> {
        let [p1, p2] = self.corners;
        let (width, height) = (p2.x - p1.x, p2.y - p1.y);
        match *numbers {
            [x1, x2, y1, y2] | [x1, x2, y1, y2, 0] if x1 != x2 && y1 != y2 => {
                Some([x1, x2, y1, y2])
            }
            // HP-GL/2 knows two more kinds of scaling: units of the same length on both axes, and a
            // given number of plotter units for each user unit.
            [x1, x2, y1, y2, kind, ref rest @ ..] if kind == UNIT && x1 != x2 && y1 != y2 => {
                let free = match *rest {
                    [] => [50 * UNIT; 2],
                    [left, bottom] => [left, bottom],
                    _ => return None,
                };
                if free.iter().any(|share| !(0..=100 * UNIT).contains(share)) {
                    return None;
                }
                isotropic([x1, x2, y1, y2], [width, height], free)
            }
            [x1, x_unit, y1, y_unit, kind] if kind == 2 * UNIT && x_unit != 0 && y_unit != 0 => {
                let ends = ratio(width, UNIT, x_unit).zip(ratio(height, UNIT, y_unit));
                ends.map(|(wide, high)| [x1, x1 + wide, y1, y1 + high])
                    .filter(|[x1, x2, y1, y2]| x1 != x2 && y1 != y2)
            }
            _ => None,
        }
    }

    /// `IW`: sets the window; `None` removes it.
    pub(super) fn set_window(&mut self, corners: Option<[Point; 2]>) -> Option<()> {
        self.window = match corners {
            None => None,
            Some([a, b]) => Some(Rectangle::between(self.position(a)?, self.position(b)?)),
        };
        Some(())
    }

    /// `RO`: turns the page, and the window with it.
    pub(super) fn rotate(&mut self, quarters: u8) {
        let window = self.window.map(|Rectangle { least, most }| {
            [least, most].map_each(|corner| self.plotter_units(corner))
        });
        self.quarters = quarters & 3;
        self.window = window.map(|[a, b]| Rectangle::between(self.on_page(a), self.on_page(b)));
    }
}

/// The user units at P1 and P2 if both axes have the same unit. Of the room that is left over in
/// one direction, `free` percent (in units of the interpreter) lie to the left of the given range,
/// or below it.
fn isotropic(
    [x1, x2, y1, y2]: [i64; 4],
    [width, height]: [i64; 2],
    free: [i64; 2],
) -> Option<[i64; 4]> {
    let (wide, high) = ((x2 - x1).abs(), (y2 - y1).abs());
    // The unit is width / wide or height / high, whichever is less.
    let x_is_less = product(width.abs(), high) <= product(height.abs(), wide);
    let (unit, of) = if x_is_less { (width.abs(), wide) } else { (height.abs(), high) };
    let widened = |from: i64, to: i64, length: i64, share: i64| {
        let extra = ratio(length.abs(), of, unit)? - (to - from).abs();
        let before = ratio(extra, share, 100 * UNIT)?;
        let sign = (to - from).signum();
        Some([from - before * sign, to + (extra - before) * sign])
    };
    let [left, bottom] = free;
    let ([x1, x2], [y1, y2]) = (widened(x1, x2, width, left)?, widened(y1, y2, height, bottom)?);
    (x1 != x2 && y1 != y2).then_some([x1, x2, y1, y2])
}

/// `value` times `numerator` over `denominator`; `None` beyond the range or without denominator.
fn ratio(value: i64, numerator: i64, denominator: i64) -> Option<i64> {
    if denominator == 0 {
        return None;
    }
    let numerator = if denominator < 0 { -numerator } else { numerator };
    let result = divide_rounding(product(value, numerator), denominator.abs().into());
    i64::try_from(result).ok().filter(|result| result.abs() <= FARTHEST)
}

/// So many hundredths of a length, in units of 2^-16 percent; at most the farthest coordinate.
fn hundredths(length: i64, percent: i64) -> i64 {
    ratio(length, percent, 100 * UNIT).unwrap_or(FARTHEST)
}
