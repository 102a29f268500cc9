//! The map from image coordinates to plotter steps, by which a drawing is placed on the page.

use super::page::{foot_steps, side_steps};
use super::window::Window;
use super::{PAGE_LIMIT, Page, PageError, PagePoint, StepsPerMillimetre};
use crate::array::MapEach;
use crate::fixed::{divide, divide_rounding, half, product, shift_left, shift_right};
use crate::geometry::{Projection, Vertex};
use crate::visibility::EdgeParameter;

/// A bounding box of the image: the least and the greatest x/w and y/w.
///
/// The values are in units of 2^-[`Bounds::FRACTION_BITS`], with |value| < 2^46.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    /// The least x/w and the least y/w.
    low: [i64; 2],
    /// The greatest x/w and the greatest y/w.
    high: [i64; 2],
}

impl Bounds {
    /// The number of fraction bits of the bounds of an image: their unit is 2^-24.
    pub const FRACTION_BITS: u32 = 24;

    /// The bounds of nothing, which contain no point.
    pub const NOTHING: Self = Self { low: [i64::MAX; 2], high: [i64::MIN; 2] };

    /// Extends the bounds to the image of a vertex, which must have w > 0.
    pub fn add(&mut self, vertex: Vertex, projection: Projection) {
        let w = match projection {
            Projection::Perspective => i64::from(vertex.z.max(1)),
            Projection::Parallel => 1,
        };
        // The divisor is at least 1.
        let ratio = |c: i32| (i64::from(c) << Self::FRACTION_BITS).checked_div(w).unwrap_or(0);
        self.add_point([ratio(vertex.x), ratio(vertex.y)]);
    }

    /// Extends the bounds to a position of a plan, in units of 2^-`fraction_bits` mm.
    ///
    /// These bounds are in the same unit, for [`PageMap::true_size`] and [`PageMap::fit_plan`].
    pub fn add_position(&mut self, x: i32, y: i32) {
        self.add_point([i64::from(x), i64::from(y)]);
    }

    /// Extends the bounds to a point in their own unit.
    fn add_point(&mut self, point: [i64; 2]) {
        for ((low, high), at) in self.low.iter_mut().zip(&mut self.high).zip(point) {
            *low = at.min(*low);
            *high = at.max(*high);
        }
    }

    /// Returns the bounds, or `None` if they contain nothing.
    pub fn known(self) -> Option<Self> {
        (self.low[0] <= self.high[0]).then_some(self)
    }

    /// Returns the width and the height.
    fn size(&self) -> [i64; 2] {
        [0, 1].map_each(|axis: usize| self.high[axis] - self.low[axis])
    }
}

/// The map from homogeneous image coordinates to steps: (a x + b w) / (w 2^k), rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageMap {
    /// The scale along x and along y, in steps for each unit of the image, with `k` fraction bits.
    a: [i64; 2],
    /// The offset along x and along y, in steps, with `k` fraction bits.
    b: [i128; 2],
    /// The number of fraction bits of `a` and `b`: the result is divided by 2^`k`.
    k: u32,
    /// The part of the page to which lines are clipped, if the image may reach beyond the page.
    window: Option<Window>,
}

/// The number of bits to which the map's scale is kept.
const SCALE_BITS: u32 = 41;
/// The map's unit is never finer than 2^-`FINEST`, so that its products fit in 127 bits.
const FINEST: u32 = 44;

impl PageMap {
    /// Makes the map that scales what is within `bounds` to the free part of the page and centres
    /// it.
    ///
    /// # Errors
    /// [`PageError::NoRoom`], [`PageError::TooManySteps`].
    // Not inlined, so that its variables take no stack while the rest of a job is computed.
    #[inline(never)]
    pub fn fit(bounds: &Bounds, page: &Page, steps: StepsPerMillimetre) -> Result<Self, PageError> {
        Self::fit_unit(bounds, Bounds::FRACTION_BITS, page, steps)
    }

    /// Makes the map that scales an image to the page like [`PageMap::fit`], but what is farther
    /// than `field` from the middle of the image may fall off the page. `field` is in units of
    /// 2^-[`Bounds::FRACTION_BITS`]. In a perspective view the image of a point nearly beside the
    /// eye is nearly infinitely far away.
    ///
    /// # Errors
    /// [`PageError::NoRoom`], [`PageError::TooManySteps`].
    pub fn fit_field(
        bounds: &Bounds,
        field: i64,
        page: &Page,
        steps: StepsPerMillimetre,
    ) -> Result<Self, PageError> {
        // The limits of `clamp` are in order, because `field` is not negative: `View::field`, from
        // which it comes, returns the quotient of positive numbers.
        let limited = Bounds {
            low: bounds.low.map(|low| low.clamp(-field, field)),
            high: bounds.high.map(|high| high.clamp(-field, field)),
        };
        let mut map = Self::fit(&limited, page, steps)?;
        if limited != *bounds {
            map.window = Some(Window::new(page, steps));
        }
        Ok(map)
    }

    /// Makes the map that scales a plan to the page like [`PageMap::fit`]. `bounds` is in units of
    /// 2^-`fraction_bits` mm.
    ///
    /// # Errors
    /// [`PageError::NoRoom`], [`PageError::TooManySteps`].
    pub fn fit_plan(
        bounds: &Bounds,
        fraction_bits: u32,
        page: &Page,
        steps: StepsPerMillimetre,
    ) -> Result<Self, PageError> {
        let mut map = Self::fit_unit(bounds, fraction_bits, page, steps)?;
        // The image coordinates of a plan are its positions, with w = 1, so the unit becomes part
        // of the map.
        map.coarsen(fraction_bits);
        Ok(map)
    }

    /// Makes the map of [`PageMap::fit`] from `bounds` in units of 2^-`unit_bits`.
    fn fit_unit(
        bounds: &Bounds,
        unit_bits: u32,
        page: &Page,
        steps: StepsPerMillimetre,
    ) -> Result<Self, PageError> {
        let free = page.free()?;
        page.check_steps(steps)?;
        let size = bounds.size();
        // The tighter axis decides the scale, in millimetres for each unit of the image: free /
        // size.
        let (length, extent) = match size {
            [0, 0] => (1, 1),
            [width, 0] => (free[0], width),
            [0, height] => (free[1], height),
            [width, height] if product(free[0], height) <= product(free[1], width) => {
                (free[0], width)
            }
            [_, height] => (free[1], height),
        };
        // Lengths on the page are below 2^31, as are the steps.
        let numerator = steps.map_each(|steps| length * i64::from(steps.to_bits()));
        // a = numerator / extent 2^-32 2^unit_bits 2^k, with k as great as SCALE_BITS allow.
        let largest = numerator[0].max(numerator[1]).max(1);
        let bits = |value: i64| (64 - value.leading_zeros()) as i32;
        let shift = SCALE_BITS as i32 + bits(extent) - bits(largest);
        let k = (shift + 32 - unit_bits as i32).clamp(0, FINEST as i32);
        let shift = k - 32 + unit_bits as i32;
        let k = k as u32;
        let (up, down) = (shift.max(0) as u32, (-shift).max(0) as u32);
        let divisor = shift_left(extent.into(), down) as u128;
        // The quotient is below 2^42 by the choice of k.
        let a =
            numerator.map_each(|part| divide(shift_left(part.into(), up) as u128, divisor) as i64);
        let b = [0, 1].map_each(|axis: usize| {
            // The drawing and the foot below it are centred together.
            let side = side_steps(page, steps, axis) + foot_steps(page, steps, axis);
            let middle = bounds.low[axis] + bounds.high[axis];
            half(shift_left(side.into(), k)) - shift_right(product(a[axis], middle), unit_bits + 1)
        });
        Ok(Self { a, b, k, window: None })
    }

    /// Returns the binary logarithm of the scale, rounded down, plus one. Of two maps of one image
    /// whose values differ by 3 or more, one has more than four times the scale of the other.
    pub fn magnitude(&self) -> i32 {
        64 - (self.a[0].leading_zeros() + self.k) as i32
    }

    /// Makes the map take coordinates that are greater by a factor of 2^`bits`.
    fn coarsen(&mut self, bits: u32) {
        // (a p 2^-bits + b) / 2^k = (a p + b 2^bits) / 2^(k + bits)
        self.b = self.b.map_each(|b| shift_left(b, bits));
        self.k += bits;
    }

    /// Makes the map that draws a plan at true size. The plan keeps its position if that is on the
    /// page, otherwise it is moved just inside.
    ///
    /// `bounds` is in units of 2^-`fraction_bits` mm.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn true_size(
        bounds: &Bounds,
        fraction_bits: u32,
        page: &Page,
        steps: StepsPerMillimetre,
    ) -> Result<Self, PageError> {
        let free = page.free()?;
        page.check_steps(steps)?;
        // Positions of a plan have 32 bits.
        let to_page = |value: i64| (value << 16) >> fraction_bits;
        let size = bounds.size().map_each(to_page);
        if size[0] > free[0] || size[1] > free[1] {
            // Converts a size in units of 2^-16 mm to 0.1 mm, rounded.
            let tenths = |size: i64| u32::try_from((10 * size + (1 << 15)) >> 16);
            let [width, height] = size.map_each(|size| tenths(size).unwrap_or(u32::MAX));
            return Err(PageError::DoesNotFit { width, height, foot: page.foot });
        }
        let a = steps.map_each(|steps| i64::from(steps.to_bits()));
        let b = [0, 1].map_each(|axis: usize| {
            let (low, high) = (to_page(bounds.low[axis]), to_page(bounds.high[axis]));
            let first = page.first(axis);
            let last = first + free[axis];
            let moved = if low < first { first - low } else { (last - high).min(0) };
            shift_left(product(moved, a[axis]), fraction_bits) >> 16
        });
        Ok(Self { a, b, k: 16 + fraction_bits, window: None })
    }

    /// Returns a coordinate of the image point that c/w is along `axis`, in 2^-`k` steps, times w.
    /// |c| and w must be below 2^52, so that it is below 2^42 2^52 + 2^(44 + 21) 2^52 < 2^118.
    #[inline(never)] // Its 128-bit arithmetic is long.
    fn times_w(&self, axis: usize, c: i64, w: i64) -> i128 {
        // The callers have an axis for x and one for y, 0 and 1, so the indexing cannot fail.
        product(self.a[axis], c) + self.b[axis] * i128::from(w)
    }

    /// Returns the image point (x/w, y/w) in steps. |x| and |y| must be below 2^52, and 0 < w <
    /// 2^52.
    pub fn point(&self, x: i64, y: i64, w: i64) -> PagePoint {
        let divisor = shift_left(w.into(), self.k);
        let [x, y] = [(0, x), (1, y)].map_each(|(axis, c)| {
            let steps = divide_rounding(self.times_w(axis, c, w), divisor);
            steps.clamp(-i128::from(PAGE_LIMIT), i128::from(PAGE_LIMIT)) as i32
        });
        PagePoint { x, y }
    }

    /// Returns the least and the greatest coordinates of what lies within `bounds` and on the page,
    /// in steps, or a step beyond them.
    #[cfg(feature = "tiles")]
    pub fn extent(
        &self,
        bounds: &Bounds,
        page: &Page,
        steps: StepsPerMillimetre,
    ) -> [PagePoint; 2] {
        let corner = |[x, y]: [i64; 2], beyond: i32| {
            let PagePoint { x, y } = self.point(x, y, 1 << Bounds::FRACTION_BITS);
            let [x, y] = [(x, 0), (y, 1)].map(|(c, axis): (i32, usize)| {
                // A page has fewer steps than the limit.
                let side = side_steps(page, steps, axis).clamp(0, PAGE_LIMIT.into()) as i32;
                (c + beyond).clamp(0, side)
            });
            PagePoint { x, y }
        };
        [corner(bounds.low, -1), corner(bounds.high, 1)]
    }

    /// Returns the image point (x/w, y/w) in 1/256 steps, for [`crate::curve::Spline::chords`]. As
    /// [`PageMap::point`], but not limited to the page.
    pub fn fine(&self, x: i64, y: i64, w: i64) -> crate::curve::Fine {
        let divisor = shift_left(w.into(), self.k);
        // The case of a parallel view: a shift is many times faster than a division.
        let power = (w & (w - 1) == 0).then(|| w.trailing_zeros() + self.k);
        [(0, x), (1, y)].map_each(|(axis, c)| {
            let scaled = self.times_w(axis, c, w) << 8; // below 2^126
            let fine = match power {
                Some(power) => (shift_right(scaled << 1, power) + 1) >> 1,
                None => divide_rounding(scaled, divisor),
            };
            const LIMIT: i128 = 1 << 40;
            fine.clamp(-LIMIT, LIMIT) as i64
        })
    }

    /// Returns the part of the edge from `p` to `q` between two parameters, in steps, or `None` if
    /// no part of it is on the page.
    pub fn stretch(
        &self,
        (p, q): (Vertex, Vertex),
        [from, to]: [EdgeParameter; 2],
        projection: Projection,
    ) -> Option<[PagePoint; 2]> {
        let [from, to] = [from, to].map(|end| between(p, q, end, projection));
        match &self.window {
            None => Some([from, to].map(|[x, y, w]| self.point(x, y, w))),
            Some(window) => window.clip([from, to].map(|[x, y, w]| self.fine(x, y, w))),
        }
    }

    /// Returns the point at parameter `along` of the edge from `p` to `q`, in steps.
    pub fn along(
        &self,
        p: Vertex,
        q: Vertex,
        along: EdgeParameter,
        projection: Projection,
    ) -> PagePoint {
        let [x, y, w] = between(p, q, along, projection);
        self.point(x, y, w)
    }
}

/// Returns the point at parameter `along` of the edge from `p` to `q`, in homogeneous image
/// coordinates.
fn between(p: Vertex, q: Vertex, along: EdgeParameter, projection: Projection) -> [i64; 3] {
    // The ratio is kept in 31 bits, which are exact to 2^-10 steps on the longest edge that a page
    // can hold.
    let shift = (64 - along.denominator.leading_zeros()).saturating_sub(31);
    let denominator = (along.denominator >> shift).max(1) as i64;
    let numerator = ((along.numerator >> shift) as i64).min(denominator);
    let between =
        |p: i32, q: i32| i64::from(p) * (denominator - numerator) + i64::from(q) * numerator;
    let w = match projection {
        Projection::Perspective => between(p.z, q.z).max(1),
        Projection::Parallel => denominator,
    };
    [between(p.x, q.x), between(p.y, q.y), w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Millimetres;
    use crate::model::Position;

    fn page(width: i32, height: i32, margin: i32) -> Page {
        let [width, height, margin] = [width, height, margin].map(Millimetres::from_num);
        Page { width, height, margin, foot: Millimetres::ZERO }
    }

    fn steps(x: i32, y: i32) -> StepsPerMillimetre {
        [x, y].map(Millimetres::from_num)
    }

    const A4: [i32; 3] = [210, 297, 10];

    fn a4() -> Page {
        page(A4[0], A4[1], A4[2])
    }

    fn vertex(x: i32, y: i32, z: i32) -> Vertex {
        Vertex { x, y, z }
    }

    fn around<const N: usize>(vertices: [Vertex; N], projection: Projection) -> Bounds {
        let mut bounds = Bounds::NOTHING;
        vertices.iter().for_each(|vertex| bounds.add(*vertex, projection));
        bounds.known().unwrap()
    }

    fn around_plan<const N: usize>(positions: [Position; N]) -> Bounds {
        let mut bounds = Bounds::NOTHING;
        positions.iter().for_each(|position| bounds.add_position(position.x, position.y));
        bounds.known().unwrap()
    }

    #[test]
    fn what_is_wide_fills_the_width_and_is_centred() {
        let corners = [vertex(-400_000, -100_000, 9), vertex(200_000, 100_000, 7)];
        let bounds = around(corners, Projection::Parallel);
        let map = PageMap::fit(&bounds, &a4(), steps(80, 80)).unwrap();
        let [low, high] = corners.map(|v| map.point(v.x.into(), v.y.into(), 1));
        assert_eq!((low.x, high.x), (800, 16000));
        // 63.333 mm high about the middle of 148.5 mm
        assert_eq!((low.y, high.y), (11880 - 2533, 11880 + 2533));
    }

    #[test]
    fn perspective_divides_by_the_depth() {
        let corners = [vertex(-100, -100, 100), vertex(300, 300, 300), vertex(50, 50, 100)];
        let bounds = around(corners, Projection::Perspective);
        let map = PageMap::fit(&bounds, &page(100, 100, 0), steps(10, 20)).unwrap();
        assert_eq!(map.point(-100, -100, 100), PagePoint { x: 0, y: 0 });
        assert_eq!(map.point(300, 300, 300), PagePoint { x: 1000, y: 2000 });
        assert_eq!(map.point(0, 0, 5), PagePoint { x: 500, y: 1000 });
        assert_eq!(map.fine(0, 0, 5), [500 * 256, 1000 * 256]);
        assert_eq!(map.fine(1, -1, 512), [500 * 256 + 250, 1000 * 256 - 500]);
        // The middle of the edge in space, from z 100 to z 300, is at three quarters of its image.
        let half = EdgeParameter { numerator: 1 << 60, denominator: 1 << 61 };
        let (p, q) = (corners[0], corners[1]);
        assert_eq!(map.along(p, q, half, Projection::Perspective), PagePoint { x: 750, y: 1500 });
        assert_eq!(
            map.along(
                p,
                q,
                EdgeParameter { numerator: 0, denominator: 1 },
                Projection::Perspective
            ),
            map.point(-1, -1, 1)
        );
        assert_eq!(
            map.along(
                p,
                q,
                EdgeParameter { numerator: 3, denominator: 3 },
                Projection::Perspective
            ),
            map.point(1, 1, 1)
        );
    }

    #[test]
    fn points_and_lines_have_a_place_too() {
        for (corners, low, high) in [
            ([vertex(7, 7, 7), vertex(7, 7, 7)], (8400, 11880), (8400, 11880)),
            ([vertex(-5, 0, 7), vertex(5, 0, 7)], (800, 11880), (16000, 11880)),
            ([vertex(0, -5, 7), vertex(0, 5, 7)], (8400, 800), (8400, 22960)),
        ] {
            let bounds = around(corners, Projection::Parallel);
            let map = PageMap::fit(&bounds, &a4(), steps(80, 80)).unwrap();
            let found = corners.map(|v| map.point(v.x.into(), v.y.into(), 1)).map(|p| (p.x, p.y));
            assert_eq!(found, [low, high]);
        }
        assert_eq!(Bounds::NOTHING.known(), None);
    }

    fn plan(points: [[i32; 2]; 2]) -> [Position; 2] {
        points.map(|[x, y]| Position { x: x << 8, y: y << 8, z: 0 })
    }

    fn true_size(points: [[i32; 2]; 2], page: &Page) -> Result<[(i32, i32); 2], PageError> {
        let positions = plan(points);
        let bounds = around_plan(positions);
        let map = PageMap::true_size(&bounds, 8, page, steps(100, 80))?;
        Ok(positions.map(|p| map.point(p.x.into(), p.y.into(), 1)).map(|p| (p.x, p.y)))
    }

    #[test]
    fn a_plan_on_the_page_stays_where_it_is() {
        assert_eq!(true_size([[10, 20], [200, 30]], &a4()), Ok([(1000, 1600), (20000, 2400)]));
    }

    #[test]
    fn a_plan_off_the_page_is_moved_just_inside() {
        assert_eq!(true_size([[-50, 290], [-40, 400]], &a4()), Ok([(1000, 14160), (2000, 22960)]));
    }

    #[test]
    fn a_plan_too_large_is_refused_with_its_size() {
        assert_eq!(
            true_size([[0, 0], [191, 5]], &a4()),
            Err(PageError::DoesNotFit { width: 1910, height: 50, foot: Millimetres::ZERO })
        );
        let positions = plan([[0, 0], [380, 5]]);
        let bounds = around_plan(positions);
        let map = PageMap::fit_plan(&bounds, 8, &a4(), steps(100, 80)).unwrap();
        let ends = positions.map(|p| map.point(p.x.into(), p.y.into(), 1));
        assert_eq!(ends.map(|p| p.x), [1000, 20000]);
        assert_eq!(ends[1].y - ends[0].y, 200); // 2.5 mm: the same scale on both axes
    }

    #[test]
    fn impossible_pages_are_refused() {
        assert_eq!(true_size([[0, 0], [1, 1]], &page(20, 50, 10)), Err(PageError::NoRoom));
        assert_eq!(true_size([[0, 0], [1, 1]], &page(20000, 50, 10)), Err(PageError::TooManySteps));
    }
}
