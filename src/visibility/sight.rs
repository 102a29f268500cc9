//! One edge against one face: which stretch of it the face hides, exactly.
//!
//! A triangle hides an edge where the edge lies behind the triangle's plane and, on the page, within
//! the triangle. "Within" is asked twice, for the points of the page just to the left and just to
//! the right of the edge: a corner on the line of the edge counts as lying to the right in the first
//! question and to the left in the second. So every degenerate case falls to one side or the other.

use super::edges::{ChosenSides, Outlines, sides};
use super::faces::Face;
use super::outlook::{Outlook, Place, coarse_side};
use super::profile::{Profile, mark};
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
    place_p: Place,
    place_q: Place,
}

/// A side of a triangle, from corner to corner.
type Side = (u16, u16);

/// Where the edge enters and leaves a triangle on the page: at a side, or not between its ends.
struct Passage {
    entry: Option<Side>,
    exit: Option<Side>,
}

impl Sight {
    pub fn new(outlook: &Outlook<'_>, side: usize, p: u16, q: u16) -> Self {
        let (z_p, z_q) = (outlook.vertex(p).z, outlook.vertex(q).z);
        Self {
            side,
            p,
            q,
            near: z_p.min(z_q),
            far: z_p.max(z_q),
            place_p: outlook.place(p),
            place_q: outlook.place(q),
        }
    }

    /// Marks what `face` does to this edge.
    pub fn look_at(&self, around: &Surroundings<'_>, face: Face, profile: &mut Profile<'_>) {
        let outlook = &around.outlook;
        let corners = around.outlines.element(face.first);
        if self.passes_by(outlook, corners) {
            return;
        }
        if face.is_fan {
            let apex = corners[0].vertex();
            for pair in corners[1..].windows(2) {
                self.pass_triangle(outlook, [apex, pair[0].vertex(), pair[1].vertex()], profile);
            }
        } else if face.has_ears {
            for &triangle in around.ears.of(face.first) {
                self.pass_triangle(outlook, triangle, profile);
            }
        }
        for (number, a, b) in sides(corners) {
            if outlook.side(self.p, self.q, a) == 0 && outlook.side(self.p, self.q, b) == 0 {
                self.pass_side(around, face.first + number, (a, b), profile);
            }
        }
    }

    /// Whether the face surely lies apart from the edge on the page.
    fn passes_by(&self, outlook: &Outlook<'_>, corners: &[Corner]) -> bool {
        let (p, q) = (self.place_p, self.place_q);
        let (mut left, mut right) = (true, true);
        let (mut x0, mut y0, mut x1, mut y1) = (u16::MAX, u16::MAX, 0, 0);
        for corner in corners {
            let place = outlook.place(corner.vertex());
            (x0, y0) = (x0.min(place.x), y0.min(place.y));
            (x1, y1) = (x1.max(place.x), y1.max(place.y));
            let side = coarse_side(p, q, place);
            left &= side > 0;
            right &= side < 0;
        }
        left || right
            || x0 > p.x.max(q.x)
            || x1 < p.x.min(q.x)
            || y0 > p.y.max(q.y)
            || y1 < p.y.min(q.y)
    }

    fn pass_triangle(&self, outlook: &Outlook<'_>, triangle: [u16; 3], profile: &mut Profile<'_>) {
        let [a, b, c] = triangle;
        let holds = |number: u16| number == a || number == b || number == c;
        let (holds_p, holds_q) = (holds(self.p), holds(self.q));
        if holds_p && holds_q {
            return;
        }
        let sides = triangle.map(|corner| outlook.side(self.p, self.q, corner));
        let as_left = sides.map(|side| side > 0);
        let as_right = sides.map(|side| side >= 0);
        let crosses = |pattern: [bool; 3]| pattern[0] != pattern[1] || pattern[1] != pattern[2];
        if !crosses(as_left) && !crosses(as_right) {
            return;
        }
        let depths = triangle.map(|corner| outlook.vertex(corner).z);
        if depths[0].min(depths[1]).min(depths[2]) >= self.far {
            return;
        }
        let facing = outlook.side(a, b, c);
        if facing == 0 {
            return;
        }
        let mut behind = (Along::START, Along::END);
        if depths[0].max(depths[1]).max(depths[2]) >= self.near {
            let [va, vb, vc] = triangle.map(|corner| outlook.vertex(corner));
            let height = |held: bool, number: u16| {
                if held {
                    0
                } else {
                    plane_side(va, vb, vc, outlook.vertex(number)) * i64::from(facing)
                }
            };
            match behind_between(height(holds_p, self.p), height(holds_q, self.q)) {
                Some(part) => behind = part,
                None => return,
            }
        }
        let mut cover = |pattern: [bool; 3], marks: u64| {
            if let Some(passage) = self.passage(outlook, triangle, pattern, facing) {
                let place = |side: Option<Side>, end: Along| {
                    side.map_or(end, |(a, b)| outlook.crossing(a, b, self.p, self.q))
                };
                let from = place(passage.entry, Along::START).max(behind.0);
                let to = place(passage.exit, Along::END).min(behind.1);
                profile.mark(from, to, marks);
            }
        };
        if as_left == as_right {
            cover(as_left, mark::HIDDEN);
        } else {
            cover(as_left, mark::LEFT);
            cover(as_right, mark::RIGHT);
        }
    }

    /// Where the edge passes the triangle, each corner taken to the left or not of the edge.
    fn passage(
        &self,
        outlook: &Outlook<'_>,
        triangle: [u16; 3],
        pattern: [bool; 3],
        facing: i32,
    ) -> Option<Passage> {
        let mut passage = Passage { entry: None, exit: None };
        let mut crossed = false;
        for n in 0..3 {
            let next = (n + 1) % 3;
            if pattern[n] == pattern[next] {
                continue;
            }
            crossed = true;
            let side = (triangle[n], triangle[next]);
            let p_inside = outlook.side(side.0, side.1, self.p) * facing;
            let q_inside = outlook.side(side.0, side.1, self.q) * facing;
            if p_inside <= 0 && q_inside <= 0 {
                return None;
            }
            if p_inside < 0 {
                passage.entry = Some(side);
            } else if q_inside < 0 {
                passage.exit = Some(side);
            }
        }
        crossed.then_some(passage)
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
        if side == self.side || !around.chosen.contains(side) {
            return;
        }
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
            (side < self.side).then_some((Along::START, Along::END))
        } else {
            behind_between(heights.0, heights.1)
        };
        if let Some(behind) = behind {
            let (at_a, at_b) = (place(va), place(vb));
            let from = at_a.min(at_b).max(behind.0);
            let to = at_a.max(at_b).min(behind.1);
            profile.mark(from, to, mark::STOOD_IN);
        }
    }
}

/// The part of an edge that lies behind something flat, from how far behind it p and q lie.
fn behind_between(at_p: i64, at_q: i64) -> Option<(Along, Along)> {
    if at_p <= 0 && at_q <= 0 {
        None
    } else if at_p >= 0 && at_q >= 0 {
        Some((Along::START, Along::END))
    } else if at_p < 0 {
        Some((Along::zero_between(at_p, at_q), Along::END))
    } else {
        Some((Along::START, Along::zero_between(at_p, at_q)))
    }
}
