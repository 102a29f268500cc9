//! Toothed wheels with involute teeth, solid or with spokes.

use super::mesh::{Loop, Mesh, Point, circle, polar};
use std::f64::consts::{PI, TAU};

/// The pitch diameter of a wheel for each of its teeth: the same for all wheels that mesh.
pub const MODULE: f64 = 1.0;
/// The angle at which the teeth press on each other.
const PRESSURE_ANGLE: f64 = PI / 9.0;
/// How far teeth reach beyond the pitch circle, and the gaps below it.
const ADDENDUM: f64 = 0.95 * MODULE;
const DEDENDUM: f64 = 1.2 * MODULE;
/// What is taken from the width of a tooth at the pitch circle, so that teeth do not touch.
const BACKLASH: f64 = 0.16 * MODULE;
/// Vertices of a wheel's outline for each tooth.
const OUTLINE: usize = 7;

/// A toothed wheel on a vertical axis.
#[derive(Debug, Clone, Copy)]
pub struct Wheel {
    /// The place of the axis.
    pub centre: Point,
    /// The number of teeth.
    pub teeth: usize,
    /// The direction of the middle of a gap between two teeth, in radians.
    pub gap: f64,
    /// The heights of its underside and of the top of its teeth.
    pub heights: [f64; 2],
}

/// The disc within the teeth, with spokes.
#[derive(Debug, Clone, Copy)]
pub struct Spokes {
    /// How many there are. Twice their number divides that of the teeth.
    pub count: usize,
    /// Half the width of a spoke at the hub and at the rim.
    pub half_widths: [f64; 2],
    /// The radii between which the windows lie.
    pub radii: [f64; 2],
    /// The inner radius of the rim, which rises above the spokes.
    pub rim: f64,
    /// The height of the top of the spokes.
    pub height: f64,
    /// The radius of the corners of the windows.
    pub corner: f64,
}

impl Wheel {
    /// The radius of the pitch circle.
    pub fn pitch_radius(&self) -> f64 {
        MODULE * self.teeth as f64 / 2.0
    }

    /// A wheel at the same heights that meshes with this one, in the direction `angle` from it.
    pub fn meshing(&self, teeth: usize, angle: f64) -> Self {
        let other = Self { teeth, ..*self };
        let centre = polar(self.centre, self.pitch_radius() + other.pitch_radius(), angle);
        // A tooth of the one lies in a gap of the other. As many teeth as the line of the centres
        // is from a gap of this one, it is from a tooth of the other, the other way round.
        let pitches = (angle - self.gap) * self.teeth as f64 / TAU;
        let gap = angle + PI + (pitches + 0.5) * TAU / teeth as f64;
        Self { centre, gap, ..other }
    }

    /// Half the angle that a tooth takes at `radius`.
    fn half_tooth(&self, radius: f64) -> f64 {
        let involute = |angle: f64| angle.tan() - angle;
        let base = self.pitch_radius() * PRESSURE_ANGLE.cos();
        let width = PI * MODULE / 2.0 - BACKLASH;
        width / 2.0 / self.pitch_radius() + involute(PRESSURE_ANGLE)
            - involute((base / radius.max(base)).acos())
    }

    /// The outline of the teeth: for each tooth the middle of the gap before it, its two flanks.
    fn outline(&self) -> Vec<Point> {
        let (root, tip) = (self.pitch_radius() - DEDENDUM, self.pitch_radius() + ADDENDUM);
        let pitch = TAU / self.teeth as f64;
        let flank = [0.0, 0.5, 1.0].map(|part| root + part * (tip - root));
        let mut points = Vec::new();
        for tooth in 0..self.teeth {
            let gap = self.gap + pitch * tooth as f64;
            let middle = gap + pitch / 2.0;
            points.push(polar(self.centre, root, gap));
            points.extend(flank.map(|r| polar(self.centre, r, middle - self.half_tooth(r))));
            let down = flank.into_iter().rev();
            points.extend(down.map(|r| polar(self.centre, r, middle + self.half_tooth(r))));
        }
        points
    }

    /// Adds a face for each tooth, between the outline and a circle within it.
    fn toothed_ring(&self, mesh: &mut Mesh, outline: &[usize], circle: &[usize]) {
        let each = circle.len() / self.teeth;
        for tooth in 0..self.teeth {
            let around = (0..=OUTLINE).map(|n| outline[(tooth * OUTLINE + n) % outline.len()]);
            let back = (0..=each).rev().map(|n| circle[(tooth * each + n) % circle.len()]);
            mesh.face(around.chain(back));
        }
    }

    /// Adds a wheel without spokes. On it a turned solid of `profile` stands. It has no underside:
    /// nobody sees that.
    pub fn add_solid(&self, mesh: &mut Mesh, circle_points: usize, profile: &[(f64, f64)]) {
        let [(radius, _), above @ ..] = profile else { return };
        let outline = self.outline();
        let around = circle(self.centre, *radius, circle_points, self.gap);
        let [lower, upper] = self.heights.map(|z| mesh.level(&outline, z));
        mesh.wall(&lower, &upper);
        let within = mesh.level(&around, self.heights[1]);
        self.toothed_ring(mesh, &upper, &within);
        mesh.turned(self.centre, &within, above, self.gap);
    }

    /// Adds a wheel with spokes. In its middle a turned solid of `profile` stands on the spokes.
    /// What nobody sees is left out: the underside.
    pub fn add_spoked(
        &self,
        mesh: &mut Mesh,
        spokes: &Spokes,
        circle_points: usize,
        profile: &[(f64, f64)],
    ) {
        let [(radius, _), above @ ..] = profile else { return };
        let ring = |radius: f64, count| circle(self.centre, radius, count, self.gap);
        let [low, high] = self.heights;
        let outline = self.outline();
        let (lower, upper) = (mesh.level(&outline, low), mesh.level(&outline, high));
        mesh.wall(&lower, &upper);
        let rim_top = mesh.level(&ring(spokes.rim, 2 * self.teeth), high);
        let rim_low = mesh.level(&ring(spokes.rim, 2 * self.teeth), spokes.height);
        self.toothed_ring(mesh, &upper, &rim_top);
        // The wall of the rim is seen from the axis.
        mesh.wall(&rim_top, &rim_low);
        let hub = mesh.level(&ring(*radius, circle_points), spokes.height);
        let windows = self.windows(spokes);
        let tops: Vec<Loop> = windows.iter().map(|w| mesh.level(w, spokes.height)).collect();
        self.web(mesh, &rim_low, &hub, &tops);
        let bottoms: Vec<Loop> = windows.iter().map(|w| mesh.level(w, low)).collect();
        for (bottom, top) in bottoms.iter().zip(&tops) {
            mesh.wall(top, bottom);
        }
        mesh.turned(self.centre, &hub, above, self.gap);
    }

    /// The windows between the spokes. Each begins in the middle of its inner side and goes round
    /// it; the middle of its outer side is half way round.
    fn windows(&self, spokes: &Spokes) -> Vec<Vec<Point>> {
        let [inner, outer] = spokes.radii;
        let half = PI / spokes.count as f64;
        // The half of a window that lies clockwise from its middle, as radius and angle.
        let angle = |radius: f64, width: f64| half - (width / radius).asin();
        let (near, far) =
            (angle(inner, spokes.half_widths[0]), angle(outer, spokes.half_widths[1]));
        let (near_cut, far_cut) = (spokes.corner / inner, spokes.corner / outer);
        let mut side = vec![(inner, 0.0)];
        side.extend(rounded((inner, near), [near_cut, spokes.corner], (inner, outer, near, far)));
        let mut outer_corner =
            rounded((outer, far), [far_cut, spokes.corner], (outer, inner, far, near));
        outer_corner.reverse();
        side.extend(outer_corner);
        side.push((outer, far * 0.35));
        let mut windows = Vec::new();
        for spoke in 0..spokes.count {
            let middle = self.gap + half * (2 * spoke + 1) as f64;
            let at = |&(radius, angle): &(f64, f64), sign: f64| {
                polar(self.centre, radius, middle + sign * angle)
            };
            let mut window: Vec<Point> = side.iter().map(|point| at(point, -1.0)).collect();
            window.push(at(&(outer, 0.0), 0.0));
            window.extend(side.iter().skip(1).rev().map(|point| at(point, 1.0)));
            windows.push(window);
        }
        windows
    }

    /// Adds the faces of a disc with windows: two for each window, which meet in its middle and in
    /// the middle of the spokes.
    fn web(&self, mesh: &mut Mesh, rim: &[usize], hub: &[usize], windows: &[Loop]) {
        for (n, window) in windows.iter().enumerate() {
            let middle = window.len() / 2;
            let arc = |ring: &[usize], part: usize| -> Vec<usize> {
                let each = ring.len() / windows.len() / 2;
                (0..=each).map(|k| ring[((2 * n + part) * each + k) % ring.len()]).collect()
            };
            for part in 0..2 {
                let mut corners = arc(rim, part);
                let mut back = arc(hub, part);
                back.reverse();
                if part == 0 {
                    // The rim as far as the middle of the window, the window's clockwise half from
                    // outside inwards, and the hub back to the middle of the spoke.
                    corners.extend(window[..=middle].iter().rev());
                    corners.extend(back);
                } else {
                    corners.extend(back);
                    corners.push(window[0]);
                    corners.extend(window[middle..].iter().rev());
                }
                mesh.face(corners);
            }
        }
    }
}

/// A corner of a window, rounded: five points from the arc to the side of the spoke, as radius and
/// angle. `cut` says how far from the corner the rounding begins on the arc (an angle) and along
/// the spoke (a length). The spoke runs from the first to the second radius of `spoke`, and from
/// the third to the fourth angle.
fn rounded(corner: (f64, f64), cut: [f64; 2], spoke: (f64, f64, f64, f64)) -> Vec<(f64, f64)> {
    let (from, to, angle_from, angle_to) = spoke;
    let part = cut[1] / (to - from).abs();
    let begin = (corner.0, corner.1 - cut[0]);
    let end = (from + part * (to - from), angle_from + part * (angle_to - angle_from));
    let blend = |t: f64| {
        let weights = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        let mix = |a: f64, b: f64, c: f64| weights[0] * a + weights[1] * b + weights[2] * c;
        (mix(begin.0, corner.0, end.0), mix(begin.1, corner.1, end.1))
    };
    [0.0, 0.25, 0.5, 0.75, 1.0].map(blend).to_vec()
}
