//! One edge against one face: which stretch of it the face hides, exactly.
//!
//! A triangle hides an edge where the edge lies behind the triangle's plane and, on the page, within
//! the triangle. "Within" is asked twice, for the points of the page just to the left and just to
//! the right of the edge: a corner on the line of the edge counts as lying to the right in the first
//! question and to the left in the second. So every degenerate case falls to one side or the other.

use super::edges::{ChosenSides, Outlines, sides};
use super::faces::Face;
use super::outlook::{CoarseLine, Outlook, Place};
use super::profile::{Part, Profile, mark};
use super::triangles::Ears;
use crate::geometry::{Along, line_side, page_offset, plane_side};
use crate::model::Corner;

/// What the search knows of the scene.
pub struct Surroundings<'a> {
    pub outlook: Outlook<'a>,
    pub outlines: Outlines<'a>,
    pub ears: Ears<'a>,
    pub chosen: ChosenSides<'a>,
}

/// An edge that is being looked at.
#[derive(Debug, Clone, Copy)]
pub struct Sight {
    /// The side that stands for it.
    pub side: usize,
    pub p: u16,
    pub q: u16,
    /// Depth of its nearer end.
    pub near: i32,
    /// Depth of its farther end.
    pub far: i32,
    low: Place,
    high: Place,
    line: CoarseLine,
}

/// A side of a face, from corner to corner.
type Side = (u16, u16);

/// A face, or a triangle of one, as the edge meets it.
///
/// For the points just to the left of the edge a corner on its line lies to the right, and the other
/// way round; so each corner is left of the line or not, twice.
#[derive(Clone, Copy)]
struct Piece<'c> {
    corners: &'c [u16],
    /// One bit for each corner: whether it lies to the left.
    left: u32,
    /// The same, with those on the line.
    left_or_on: u32,
}

impl<'c> Piece<'c> {
    /// From the corners, at most [`FEW_CORNERS`], and the side of the line on which each lies.
    fn new(corners: &'c [u16], sides: &[i32]) -> Self {
        let (mut left, mut left_or_on) = (0, 0);
        for (n, &side) in sides.iter().enumerate().take(corners.len()) {
            left |= u32::from(side > 0) << n;
            left_or_on |= u32::from(side >= 0) << n;
        }
        Self {
            corners,
            left,
            left_or_on,
        }
    }

    /// The mask of the corners, each put where the next one is.
    fn shifted(&self, mask: u32) -> u32 {
        let count = self.corners.len();
        (mask << 1 | mask >> (count - 1)) & ((1 << count) - 1)
    }

    /// One bit for each side that crosses the line, at the corner where the side ends.
    fn crossings(&self, left: u32) -> u32 {
        left ^ self.shifted(left)
    }

    /// One bit for each side that lies on the line, at the corner where the side ends.
    fn sides_on_line(&self) -> u32 {
        let on = self.left ^ self.left_or_on;
        on & self.shifted(on)
    }

    /// The side that ends at a corner.
    fn side(&self, end: usize) -> Side {
        let begin = end.checked_sub(1).unwrap_or(self.corners.len() - 1);
        (self.corners[begin], self.corners[end])
    }
}

/// Whether more than two bits are set.
fn is_many(mask: u32) -> bool {
    let without_one = mask & mask.wrapping_sub(1);
    without_one & without_one.wrapping_sub(1) != 0
}

/// Faces with more corners are looked at triangle by triangle.
const FEW_CORNERS: usize = 8;

/// The sides at which the edge enters and leaves a piece of a face, if it does so between its ends.
#[derive(Clone, Copy, Default, PartialEq)]
struct Passage {
    entry: Option<Side>,
    exit: Option<Side>,
}

/// What a face does to an edge.
enum Depth {
    /// The edge does not lie behind it.
    Before,
    /// This part of the edge lies behind it.
    Behind(Part),
    /// That differs from triangle to triangle.
    Mixed,
}

impl Sight {
    pub fn new(outlook: &Outlook<'_>, side: usize, p: u16, q: u16) -> Self {
        let (z_p, z_q) = (outlook.vertex(p).z, outlook.vertex(q).z);
        let (place_p, place_q) = (outlook.place(p), outlook.place(q));
        Self {
            side,
            p,
            q,
            near: z_p.min(z_q),
            far: z_p.max(z_q),
            low: place_p.low(place_q),
            high: place_p.high(place_q),
            line: CoarseLine::new(place_p, place_q),
        }
    }

    /// Marks what `face` does to this edge.
    pub fn look_at(&self, around: &Surroundings<'_>, face: Face, profile: &mut Profile<'_>) {
        let outlook = &around.outlook;
        let corners = around.outlines.element(face.first);
        let mut numbers = [0; FEW_CORNERS];
        let mut sides = [0; FEW_CORNERS];
        let (mut left, mut right) = (true, true);
        let (mut low, mut high) = (Place::HIGHEST, Place::LOWEST);
        for (n, corner) in corners.iter().enumerate() {
            let number = corner.vertex();
            let place = outlook.place(number);
            (low, high) = (low.low(place), high.high(place));
            let mut side = 0;
            if number != self.p && number != self.q {
                side = self.line.side(place);
                left &= side > 0;
                right &= side < 0;
            }
            if n < FEW_CORNERS {
                numbers[n] = number;
                sides[n] = side;
            }
        }
        // With all other corners on one side, a face that holds p or q meets the edge nowhere else,
        // and where it holds both, it is not nearer.
        if left || right || high.is_before(self.low) || self.high.is_before(low) {
            return;
        }
        let count = corners.len();
        if count <= FEW_CORNERS {
            for (side, &number) in sides.iter_mut().zip(&numbers).take(count) {
                if *side == 0 {
                    *side = outlook.exact_side(self.p, self.q, number);
                }
            }
            let piece = Piece::new(&numbers[..count], &sides);
            if !face.is_fan || !self.pass(outlook, piece, profile) {
                self.pass_triangles(around, face, corners, profile);
            }
            if piece.sides_on_line() == 0 {
                return;
            }
        } else {
            self.pass_triangles(around, face, corners, profile);
        }
        self.pass_sides(around, face.first, corners, profile);
    }

    fn pass_triangles(
        &self,
        around: &Surroundings<'_>,
        face: Face,
        corners: &[Corner],
        profile: &mut Profile<'_>,
    ) {
        let outlook = &around.outlook;
        if face.has_ears {
            for triangle in around.ears.of(face.first) {
                self.pass_triangle(outlook, triangle, profile);
            }
        } else if face.is_fan {
            let apex = corners[0].vertex();
            for pair in corners[1..].windows(2) {
                let triangle = [apex, pair[0].vertex(), pair[1].vertex()];
                self.pass_triangle(outlook, &triangle, profile);
            }
        }
    }

    fn pass_triangle(&self, outlook: &Outlook<'_>, triangle: &[u16; 3], profile: &mut Profile<'_>) {
        let sides = triangle.map(|corner| outlook.side(self.p, self.q, corner));
        self.pass(outlook, Piece::new(triangle, &sides), profile);
    }

    /// Marks what a piece of a face does to this edge. False, and nothing marked, if its triangles
    /// must be asked one by one; a triangle never must.
    fn pass(&self, outlook: &Outlook<'_>, piece: Piece<'_>, profile: &mut Profile<'_>) -> bool {
        let corners = piece.corners;
        let left = piece.crossings(piece.left);
        let right = piece.crossings(piece.left_or_on);
        if left | right == 0 {
            return true;
        }
        if is_many(left) || is_many(right) {
            return false;
        }
        let depth = |number: &u16| outlook.vertex(*number).z;
        let (mut near, mut far) = (i32::MAX, i32::MIN);
        for z in corners.iter().map(depth) {
            (near, far) = (near.min(z), far.max(z));
        }
        if near >= self.far {
            return true;
        }
        let mut facing = 0;
        for pair in corners[1..].windows(2) {
            let turn = outlook.side(corners[0], pair[0], pair[1]);
            if facing * turn < 0 {
                return false;
            }
            facing |= turn;
        }
        if facing == 0 {
            return true;
        }
        let passages = [
            self.passage(outlook, piece, left, facing),
            self.passage(outlook, piece, right, facing),
        ];
        if passages == [None; 2] {
            return true;
        }
        let behind = if far < self.near {
            Part::WHOLE
        } else {
            match self.depth_behind(outlook, corners, facing) {
                Depth::Before => return true,
                Depth::Behind(part) => part,
                Depth::Mixed => return false,
            }
        };
        let mut cover = |passage: Option<Passage>, marks: u64| {
            if let Some(Passage { entry, exit }) = passage {
                let place = |(a, b): Side| outlook.crossing(a, b, self.p, self.q);
                let inside = Part {
                    from: entry.map(place),
                    to: exit.map(place),
                };
                profile.mark(inside.and(behind), marks);
            }
        };
        if left == right {
            cover(passages[0], mark::HIDDEN);
        } else {
            cover(passages[0], mark::LEFT);
            cover(passages[1], mark::RIGHT);
        }
        true
    }

    /// How the edge lies to the planes of a fan of triangles, all of which turn as `facing` says.
    fn depth_behind(&self, outlook: &Outlook<'_>, corners: &[u16], facing: i32) -> Depth {
        let mut depth = None;
        for pair in corners[1..].windows(2) {
            let triangle = [corners[0], pair[0], pair[1]];
            let [a, b, c] = triangle.map(|corner| outlook.vertex(corner));
            let height = |number: u16| {
                if triangle.contains(&number) {
                    0
                } else {
                    plane_side(a, b, c, outlook.vertex(number)) * i64::from(facing)
                }
            };
            let here = behind_between(height(self.p), height(self.q));
            if corners.len() > 3 {
                let is_all = here == Some(Part::WHOLE);
                if here.is_some() && !is_all || depth.is_some_and(|depth| depth != here) {
                    return Depth::Mixed;
                }
            }
            depth = Some(here);
        }
        match depth.flatten() {
            Some(part) => Depth::Behind(part),
            None => Depth::Before,
        }
    }

    /// How the edge passes a piece of a face on the page, `None` if it does not meet it. `facing` is how
    /// the piece turns.
    fn passage(
        &self,
        outlook: &Outlook<'_>,
        piece: Piece<'_>,
        crossings: u32,
        facing: i32,
    ) -> Option<Passage> {
        if crossings == 0 {
            return None;
        }
        let mut passage = Passage::default();
        for end in 0..piece.corners.len() {
            if crossings >> end & 1 == 0 {
                continue;
            }
            let side = piece.side(end);
            let line = outlook.line(side.0, side.1);
            let p_inside = line.side(self.p) * facing;
            let q_inside = line.side(self.q) * facing;
            if p_inside <= 0 && q_inside <= 0 {
                return None;
            }
            if p_inside < 0 {
                passage.entry = Some(side);
            } else if q_inside < 0 {
                passage.exit = Some(side);
            }
        }
        Some(passage)
    }

    /// Marks what the sides of an element do that lie on the line of this edge.
    #[cold]
    fn pass_sides(
        &self,
        around: &Surroundings<'_>,
        first: usize,
        corners: &[Corner],
        profile: &mut Profile<'_>,
    ) {
        let is_on_line = |corner: u16| around.outlook.side(self.p, self.q, corner) == 0;
        for (number, a, b) in sides(corners) {
            let side = first + number;
            if side != self.side && around.chosen.contains(side) && is_on_line(a) && is_on_line(b) {
                self.pass_side(around, side, (a, b), profile);
            }
        }
    }

    /// Marks where the side (a, b) of a face, on the line of this edge, is drawn in its place: where
    /// it is nearer, or as near and before it in the model.
    fn pass_side(
        &self,
        around: &Surroundings<'_>,
        side: usize,
        (a, b): Side,
        profile: &mut Profile<'_>,
    ) {
        let outlook = &around.outlook;
        let projection = outlook.projection;
        let [va, vb, vp, vq] = [a, b, self.p, self.q].map(|number| outlook.vertex(number));
        let Some((axis, ahead)) = outlook.direction(vp, vq) else {
            return;
        };
        if page_offset(projection, axis, va, vb) == 0 {
            return;
        }
        let place = |vertex| {
            let beyond_p = page_offset(projection, axis, vp, vertex) * ahead;
            let before_q = page_offset(projection, axis, vertex, vq) * ahead;
            if beyond_p <= 0 {
                Along::START
            } else if before_q <= 0 {
                Along::END
            } else {
                Along::zero_between(beyond_p, before_q)
            }
        };
        let height = |vertex| line_side(projection, axis, va, vb, vertex);
        let heights = (height(vp), height(vq));
        let behind = if heights == (0, 0) {
            (side < self.side).then_some(Part::WHOLE)
        } else {
            behind_between(heights.0, heights.1)
        };
        if let Some(behind) = behind {
            let (at_a, at_b) = (place(va), place(vb));
            let beside = Part {
                from: Some(at_a.min(at_b)),
                to: Some(at_a.max(at_b)),
            };
            profile.mark(beside.and(behind), mark::STOOD_IN);
        }
    }
}

/// The part of an edge that lies behind something flat, from how far behind it p and q lie.
fn behind_between(at_p: i64, at_q: i64) -> Option<Part> {
    if at_p <= 0 && at_q <= 0 {
        return None;
    }
    let mut part = Part::WHOLE;
    if at_p < 0 {
        part.from = Some(Along::zero_between(at_p, at_q));
    } else if at_q < 0 {
        part.to = Some(Along::zero_between(at_p, at_q));
    }
    Some(part)
}
