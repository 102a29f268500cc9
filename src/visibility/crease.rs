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
    /// How an oblique view slants the normals of faces. With slants of \[s, t\] and a stretch of
    /// (d, w), the normal (x, y, z) in the view is (w x, w y, d z + (s x + t y) / 256) in the
    /// model. Both are zero if the lines of sight are at right angles to the page, or meet in the
    /// eye.
    pub slants: [i32; 2],
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
            || self.is_sharp(self.in_model(one), self.in_model(other));
        let is_folded = || dot(one, other) <= 0;
        is_drawn && (is_folded() || !are_one_plane())
    }

    /// Returns the normal of a face as it is in the model, given the one in the view, whose depth
    /// is stretched and slanted. Only its direction is kept; its components are below 2^20.
    fn in_model(&self, [x, y, z]: [i64; 3]) -> [i64; 3] {
        let ((depth, across), [s, t]) = (self.depth_stretch, self.slants);
        // A part is below 2^57 (see `areas`), and each of its factors below 2^32.
        let by = |part, factor: u32| product(part, i64::from(factor) << 8);
        let slanted = product(x, s.into()) + product(y, t.into());
        let exact = [by(x, across), by(y, across), by(z, depth) + slanted];
        // It has as many bits as the largest part.
        let all = exact.iter().fold(0, |all, part| all | part.unsigned_abs());
        let excess = (128 - all.leading_zeros()).saturating_sub(20);
        exact.map_each(|part| shift_right(part, excess) as i64)
    }

    /// Whether the angle between two normals with components below 2^20 exceeds the limit.
    fn is_sharp(&self, one: [i64; 3], other: [i64; 3]) -> bool {
        // A normal has the components 0, 1 and 2.
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
    use crate::geometry::{Precision, page_side};
    use crate::model::{Position, Positions};
    use crate::view::{Camera, Lens, Pose, View};

    const AT: Vertex = Vertex::new(0, 0, 1000);

    /// Whether a crease keeps the edge along y that two triangles share; they rise by `left` and
    /// `right` over 1000 units across.
    fn draws(cosine: i32, depth_stretch: (u32, u32), left: i32, right: i32) -> bool {
        let crease = Crease { cosine, depth_stretch, slants: [0; 2] };
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
        let crease = Crease { cosine: 1 << 20, depth_stretch: (1, 1), slants: [0; 2] };
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
        let crease = Crease { cosine: -(1 << 20), depth_stretch: (1, 1), slants: [0; 2] };
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

    /// The largest coordinate of the models of [`Bend`].
    const LARGEST: f64 = 67_108_864.0;

    /// Two triangles of a model: the ends of their common edge, and the third corner of each.
    struct Bend([[i32; 3]; 4]);

    impl Bend {
        /// The angle between the normals of the two triangles, in degrees. `None` if one of them is
        /// narrower than `least`, so that the rounding of the view turns it.
        fn degrees(&self, least: f64) -> Option<f64> {
            let [from, to, one, other] = self.0.map(|at| at.map(f64::from));
            let difference = |to: [f64; 3], a: [f64; 3]| [0, 1, 2].map(|n| to[n] - a[n]);
            let cross = |u: [f64; 3], v: [f64; 3]| {
                [[1, 2], [2, 0], [0, 1]].map(|[m, n]: [usize; 2]| u[m] * v[n] - u[n] * v[m])
            };
            let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
            let [along, one, other] = [to, one, other].map(|end| difference(end, from));
            let [one, other] = [cross(along, one), cross(other, along)];
            let is_wide = |normal| dot(normal, normal) > dot(along, along) * least.powi(2);
            let cosine = dot(one, other) / (dot(one, one) * dot(other, other)).sqrt();
            (is_wide(one) && is_wide(other) && dot(along, along) > least.powi(2))
                .then(|| cosine.acos().to_degrees())
        }
    }

    impl Positions for Bend {
        fn fraction_bits(&self) -> u32 {
            0
        }

        fn bounds(&self) -> Option<(Position, Position)> {
            let limit = |choose: fn(i32, i32) -> i32| {
                let [x, y, z] =
                    [0, 1, 2].map(|n| self.0.iter().map(|at| at[n]).reduce(choose).unwrap());
                Position { x, y, z }
            };
            Some((limit(i32::min), limit(i32::max)))
        }

        fn positions(&self) -> impl Iterator<Item = Position> {
            self.0.into_iter().map(|[x, y, z]| Position { x, y, z })
        }

        fn precision(&self) -> Precision {
            Precision::default()
        }
    }

    /// Random bends in random parallel views: straight ones, oblique ones, and those of an eye very
    /// far away that looks aside. Some of the models are flat and seen from their front.
    #[test]
    fn the_angle_in_the_model_decides_in_every_parallel_view() {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
        };
        let mut counts = [[0; 2]; 4];
        for n in 0..40_000 {
            let kind = n % 4;
            let flatness = if kind == 3 { 128.0 } else { 1.0 };
            let mut point = |limit: f64| [(); 3].map(|()| limit * random());
            let mut corners = [(); 4].map(|()| point(LARGEST));
            if kind == 3 {
                // One face is nearly parallel to the page, the other a wall from its edge on.
                corners.iter_mut().for_each(|corner| corner[1] /= flatness);
                let beside = point(LARGEST / flatness);
                corners[3] =
                    [0, 1, 2].map(|n| f64::midpoint(corners[0][n], corners[1][n]) + beside[n]);
            }
            let bend = Bend(corners.map(|corner| corner.map(|part| part as i32)));
            let (eye, at, up) = match kind {
                2 => (point(1e13), point(1e13), point(1.0)),
                3 => ([0.0, -1.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]),
                _ => (point(1.0), [0.0; 3], point(1.0)),
            };
            let lens = match kind {
                0 => Lens::Orthographic,
                2 => Lens::Perspective,
                _ => Lens::Oblique { angle: 180.0 * random(), ratio: 1.0 + random() },
            };
            let pose = Pose::Towards { eye, at, up: Some(up) };
            let Ok(view) = View::new(&Camera { pose, lens }, &bend) else { continue };
            let (limit, margin) = (90.0 + 90.0 * random(), if kind == 3 { 0.2 } else { 0.05 });
            let Some(degrees) = bend.degrees(LARGEST / 16.0 / flatness) else { continue };
            if (degrees - limit).abs() < margin {
                continue;
            }
            if view.projection() == Projection::Perspective {
                continue;
            }
            let [from, to, one, other] = bend.0.map(|[x, y, z]| view.vertex(Position { x, y, z }));
            let crease = Crease {
                cosine: (limit.to_radians().cos() * 1_048_576.0).round() as i32,
                depth_stretch: view.depth_stretch(),
                slants: view.slants(),
            };
            let faces: [&mut dyn Iterator<Item = Vertex>; 2] =
                [&mut [from, to, one].into_iter(), &mut [to, from, other].into_iter()];
            let found = crease.draws(Projection::Parallel, to, faces, false, &|| false);
            let side = |tip: Vertex| page_side(Projection::Parallel, from, to, tip).signum();
            let is_outline = side(one) * side(other) >= 0;
            assert_eq!(found, is_outline || degrees > limit, "{n}: {degrees} {limit} {view:?}");
            if !is_outline {
                counts[kind][usize::from(found)] += 1;
            }
        }
        assert!(counts.iter().flatten().all(|&count| count > 300), "{counts:?}");
    }
}
