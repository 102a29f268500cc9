//! Decides which edges between two faces are drawn: silhouettes, and creases that are sharper than
//! a given angle.

use super::triangles::areas;
use crate::array::MapEach;
use crate::fixed::{product, shift_right};
use crate::geometry::{Projection, Vertex, dot};

/// The sharpness that an edge between two faces must have to be drawn.
///
/// Some edges are drawn in any case: bars, edges of one face only, edges of more than two faces,
/// and edges between a face that the eye sees from its front and one that it sees from its back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Crease {
    /// The cosine of the limit angle, in units of 2^-20, within ±2^20. An edge is drawn if the
    /// angle between the normals of its two faces exceeds the limit.
    ///
    /// A value of 2^20 draws every edge that is not flat; 0 draws those that are sharper than a
    /// right angle.
    pub cosine: i32,
    /// The factor by which the view stretches depth relative to width and height, as a ratio. It is
    /// (7, 2) if what is 2 units long across the view is 7 units long in depth. Each number is from
    /// 1 to 2^20.
    pub depth_stretch: (u32, u32),
}

impl Crease {
    /// Whether the edge that ends at `end`, between two faces given by their corners, is drawn.
    ///
    /// `turned` says that both faces run along the edge in the same direction, so that the eye sees
    /// one from its back when it sees the other from its front. `are_one_plane` tells whether the
    /// faces lie in one plane in the model. If they do and one face continues the other across the
    /// edge, the edge is not drawn, however much rounding has bent them.
    #[inline(never)] // Its 128-bit arithmetic is long.
    pub fn draws(
        &self,
        projection: Projection,
        end: Vertex,
        faces: [&mut dyn Iterator<Item = Vertex>; 2],
        turned: bool,
        are_one_plane: &dyn Fn() -> bool,
    ) -> bool {
        let [one, other] = faces.map(areas);
        let other = if turned { other.map(|area| -area) } else { other };
        let facing = |normal: [i64; 3]| match projection {
            Projection::Perspective => {
                dot([end.x, end.y, end.z].map_each(i64::from), normal).signum() as i64
            }
            Projection::Parallel => normal[2].signum(),
        };
        let is_drawn = facing(one) * facing(other) <= 0
            || self.is_sharp(self.unstretched(one), self.unstretched(other));
        let is_folded = || dot(one, other) <= 0;
        is_drawn && (is_folded() || !are_one_plane())
    }

    /// Returns the normal of a face as it is in the model, given the one in the view, whose depth
    /// is stretched. Only its direction is kept; its components are below 2^20.
    fn unstretched(&self, normal: [i64; 3]) -> [i64; 3] {
        let by = [self.depth_stretch.1, self.depth_stretch.1, self.depth_stretch.0];
        let exact = [0, 1, 2].map_each(|n| product(normal[n], i64::from(by[n])));
        // It has as many bits as the largest part.
        let all = exact.iter().fold(0, |all, part| all | part.unsigned_abs());
        let excess = (128 - all.leading_zeros()).saturating_sub(20);
        exact.map_each(|part| shift_right(part, excess) as i64)
    }

    /// Whether the angle between two normals with components below 2^20 exceeds the limit.
    fn is_sharp(&self, one: [i64; 3], other: [i64; 3]) -> bool {
        let dot = |a: [i64; 3], b: [i64; 3]| (0..3).map(|n| a[n] * b[n]).sum::<i64>(); // below 2^42
        // Compares the cosine of the angle between the normals with the limit. Both are squared and
        // keep their signs; they stay below 2^124.
        let cosine = dot(one, other) << 20;
        let limit = i64::from(self.cosine);
        product(cosine, cosine.abs())
            < product(dot(one, one), dot(other, other)) * i128::from(limit * limit.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Vertex = Vertex::new(0, 0, 1000);

    /// Whether a crease keeps the edge along y that two triangles share; they rise by `left` and
    /// `right` over 1000 units across.
    fn draws(cosine: i32, depth_stretch: (u32, u32), left: i32, right: i32) -> bool {
        let crease = Crease { cosine, depth_stretch };
        let far = Vertex::new(0, 500, 1000);
        let one = [AT, far, Vertex::new(-1000, 0, 1000 - left)];
        let other = [far, AT, Vertex::new(1000, 0, 1000 - right)];
        let faces: [&mut dyn Iterator<Item = Vertex>; 2] =
            [&mut one.into_iter(), &mut other.into_iter()];
        crease.draws(Projection::Parallel, AT, faces, false, &|| false)
    }

    #[test]
    fn the_angle_between_the_faces_decides() {
        // cos 45 degrees = 741455 / 2^20.
        for (left, right, is_drawn) in
            [(0, 0, false), (0, 999, false), (0, 1001, true), (-500, -500, true)]
        {
            assert_eq!(draws(741_455, (1, 1), left, right), is_drawn, "{left} {right}");
        }
        // A right angle, approached from both sides; obtuse limits work as well.
        assert!(!draws(0, (1, 1), -999, -999) && draws(0, (1, 1), -1001, -1001));
        assert!(
            !draws(-(1 << 19), (1, 1), -1700, -1700) && draws(-(1 << 19), (1, 1), -1800, -1800)
        );
    }

    #[test]
    fn one_plane_has_no_crease_unless_it_is_folded() {
        let crease = Crease { cosine: 1 << 20, depth_stretch: (1, 1) };
        let far = Vertex::new(0, 500, 1000);
        for (across, is_one_plane, is_drawn) in
            [(1000, true, false), (1000, false, true), (-1000, true, true)]
        {
            let one = [AT, far, Vertex::new(-1000, 0, 1000)];
            let other = [far, AT, Vertex::new(across, 0, 1001)];
            let mut both = (one.into_iter(), other.into_iter());
            let faces: [&mut dyn Iterator<Item = Vertex>; 2] = [&mut both.0, &mut both.1];
            let found = crease.draws(Projection::Parallel, AT, faces, false, &|| is_one_plane);
            assert_eq!(found, is_drawn, "{across} {is_one_plane}");
        }
    }

    #[test]
    fn the_stretch_of_depth_is_undone() {
        assert!(!draws(741_455, (7, 2), 0, 3499) && draws(741_455, (7, 2), 0, 3501));
    }

    #[test]
    fn a_silhouette_is_drawn_however_blunt() {
        let crease = Crease { cosine: -(1 << 20), depth_stretch: (1, 1) };
        let far = Vertex::new(0, 500, 1000);
        let one = [AT, far, Vertex::new(-1000, 0, 0)];
        for (tip, is_drawn) in [(-1, true), (0, true), (1, false)] {
            let other = [far, AT, Vertex::new(tip, 0, -5000)];
            let mut both = (one.into_iter(), other.into_iter());
            let kept =
                crease
                    .draws(Projection::Parallel, AT, [&mut both.0, &mut both.1], false, &|| false);
            assert_eq!(kept, is_drawn, "{tip}");
            // The same with the second face the other way round.
            let other = [AT, far, Vertex::new(tip, 0, -5000)];
            let mut both = (one.into_iter(), other.into_iter());
            let kept =
                crease.draws(Projection::Parallel, AT, [&mut both.0, &mut both.1], true, &|| false);
            assert_eq!(kept, is_drawn, "{tip}");
        }
    }
}
