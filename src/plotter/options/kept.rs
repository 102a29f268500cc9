//! The options of a drawing in a form that flash keeps. Numbers have all of their bits, so that the
//! same drawing is computed again.

use super::PlotOptions;
use super::values::{HiddenLines, ProjectionChoice, VisibilityMode};
use crate::drawing::{LineType, Page, TitleText};
use crate::fixed::{Decimal, Millimetres};
use crate::order::{Method, Shape};
use crate::protocol::PENS;
use crate::view::Lens;
use bytemuck::{Pod, Zeroable};

/// The options as they are kept, of a drawing that `$see=faces` shows.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(in crate::plotter) struct KeptOptions {
    /// Eye, the point looked at, up and angles; 0 for those that are not set.
    directions: [[f64; 3]; 4],
    /// The two numbers of an oblique or axonometric projection.
    projection: [f64; 2],
    /// The angle of the creases in degrees.
    crease: f64,
    /// The digits of the precision, if it is set.
    precision: i64,
    /// The power of ten by which they are multiplied.
    exponent: i32,
    /// The effort, if it is set.
    effort: u32,
    /// Width, height and margin of the page, the size of the title, and what a lift is worth.
    lengths: [i32; 5],
    /// One bit for each value that is set: the four directions, precision and effort.
    set: u32,
    /// The projection, hidden lines and their pen or type, the method and the shape of the order,
    /// and the number of bytes of the title.
    codes: [u8; 6],
    /// What is on or off: clipping, seams, merged blocks, one pen, and fit.
    switches: [u8; 5],
    /// The title, in pieces of a length of which `bytemuck` knows the layout.
    title: [[u8; TITLE_PIECE]; TitleText::LIMIT / TITLE_PIECE],
    /// Fills the last word.
    rest: [u8; 5],
}

/// The length of a piece of [`KeptOptions::title`] in bytes.
const TITLE_PIECE: usize = 16;
/// The number of bits of [`KeptOptions::set`] before those of the precision and the effort.
const DIRECTIONS: usize = 4;
/// The greatest number that a user can set, in absolute value.
const GREATEST: f64 = 1e15;
/// The precisions that a user can set, in units of the model.
const PRECISIONS: core::ops::RangeInclusive<f64> = 0.0..=1e6;

impl From<&PlotOptions> for KeptOptions {
    fn from(options: &PlotOptions) -> Self {
        let PlotOptions {
            eye,
            at,
            up,
            angles,
            projection,
            clip_behind,
            see: _,
            hidden,
            seams,
            merged_blocks,
            crease,
            precision,
            one_pen,
            page: Page { width, height, margin, foot: _ },
            title,
            title_size,
            fit,
            method,
            shape,
            effort,
            lift_cost,
        } = *options;
        let directions = [eye, at, up, angles];
        let is_set = directions.map(|it| it.is_some());
        let set = is_set.into_iter().chain([precision.is_some(), effort.is_some()]);
        let (projection_code, projection) = match projection {
            ProjectionChoice::Lens(Lens::Perspective) => (0, [0.0; 2]),
            ProjectionChoice::Lens(Lens::Orthographic) => (1, [0.0; 2]),
            ProjectionChoice::Lens(Lens::Oblique { angle, ratio }) => (2, [angle, ratio]),
            ProjectionChoice::Axonometric { azimuth, elevation } => (3, [azimuth, elevation]),
        };
        let [hidden_code, hidden] = match hidden {
            HiddenLines::Erased => [0, 0],
            HiddenLines::Drawn(line_type) => [1, line_type.code()],
            HiddenLines::Pen(pen) => [2, pen],
        };
        let (mantissa, exponent) = precision.unwrap_or_default().parts();
        let mut kept = Self {
            directions: directions.map(Option::unwrap_or_default),
            projection,
            crease,
            precision: mantissa,
            exponent: exponent.into(),
            effort: effort.unwrap_or(0),
            lengths: [width, height, margin, title_size, lift_cost].map(Millimetres::to_bits),
            set: set.enumerate().map(|(bit, is_set)| u32::from(is_set) << bit).sum(),
            codes: [projection_code, hidden_code, hidden, method as u8, shape as u8, 0],
            switches: [clip_behind, seams, merged_blocks, one_pen, fit].map(u8::from),
            title: [[0; TITLE_PIECE]; TitleText::LIMIT / TITLE_PIECE],
            rest: [0; 5],
        };
        let text = title.as_str().as_bytes();
        for (byte, letter) in kept.title.as_flattened_mut().iter_mut().zip(text) {
            *byte = *letter;
        }
        let [.., length] = &mut kept.codes;
        *length = text.len() as u8;
        kept
    }
}

impl KeptOptions {
    /// The options that are kept; `None` if a user could not have set them.
    pub(in crate::plotter) fn options(&self) -> Option<PlotOptions> {
        let is_set = |bit: usize| self.set >> bit & 1 != 0;
        let mut numbers = self.directions.as_flattened().iter().chain(&self.projection);
        if !numbers.all(|number| libm::fabs(*number) <= GREATEST)
            || !(0.0..=180.0).contains(&self.crease)
        {
            return None;
        }
        let [projection, hidden, of_hidden, method, shape, title] = self.codes;
        let [first, second] = self.projection;
        let is_turned = |limit: f64| libm::fabs(first) <= 360.0 && libm::fabs(second) <= limit;
        let projection = match projection {
            0 => ProjectionChoice::Lens(Lens::Perspective),
            1 => ProjectionChoice::Lens(Lens::Orthographic),
            2 if is_turned(2.0) && second >= 0.0 => {
                ProjectionChoice::Lens(Lens::Oblique { angle: first, ratio: second })
            }
            3 if is_turned(90.0) => {
                ProjectionChoice::Axonometric { azimuth: first, elevation: second }
            }
            _ => return None,
        };
        let hidden = match hidden {
            0 => HiddenLines::Erased,
            1 => HiddenLines::Drawn(LineType::from_code(of_hidden)),
            2 if i32::from(of_hidden) < PENS => HiddenLines::Pen(of_hidden),
            _ => return None,
        };
        let [clip_behind, seams, merged_blocks, one_pen, fit] = self.switches.map(|it| it != 0);
        let precision = Decimal::from_parts(self.precision, self.exponent)
            .filter(|precision| PRECISIONS.contains(&precision.to_f64()))?;
        let title = core::str::from_utf8(self.title.as_flattened().get(..title.into())?).ok()?;
        let [width, height, margin, title_size, lift_cost] =
            self.lengths.map(Millimetres::from_bits);
        let is_size = |length| length > Millimetres::ZERO;
        let is_length = |length| length >= Millimetres::ZERO;
        if ![width, height, title_size].into_iter().all(is_size)
            || ![margin, lift_cost].into_iter().all(is_length)
            || title_size > 100
            || lift_cost > 1000
        {
            return None;
        }
        let mut directions = self.directions.into_iter().enumerate();
        let mut direction =
            || directions.next().and_then(|(bit, direction)| is_set(bit).then_some(direction));
        let options = PlotOptions {
            eye: direction(),
            at: direction(),
            up: direction(),
            angles: direction(),
            projection,
            clip_behind,
            see: VisibilityMode::Faces,
            hidden,
            seams,
            merged_blocks,
            crease: self.crease,
            precision: is_set(DIRECTIONS).then_some(precision),
            one_pen,
            page: Page { width, height, margin, foot: Millimetres::ZERO },
            title: TitleText::new(title.chars())?,
            title_size,
            fit,
            method: [Method::Auto, Method::Greedy, Method::Exact]
                .get(usize::from(method))
                .copied()?,
            shape: [Shape::OpenPath, Shape::ClosedCycle].get(usize::from(shape)).copied()?,
            effort: is_set(DIRECTIONS + 1).then_some(self.effort),
            lift_cost,
        };
        Some(options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString as _;

    /// Options of which each differs from its default, with numbers that have many digits.
    fn changed() -> PlotOptions {
        let mut options = PlotOptions::default();
        for (name, value) in [
            ("eye", "1.23456789012345,-9.87654321e-7,1e15"),
            ("at", "0.1,0.2,0.3"),
            ("up", "1e-9,0,1"),
            ("angles", "30.000000001,60,-90"),
            ("projection", "oblique,12.3456789,0.333333333333"),
            ("behind", "refuse"),
            ("hidden", "pen,32"),
            ("seams", "off"),
            ("blocks", "merged"),
            ("crease", "12.3456789"),
            ("precision", "5.0000001e-4"),
            ("pens", "one"),
            ("page", "123.456x78.9"),
            ("margin", "3.21"),
            ("title", "Größe 3"),
            ("title-size", "7.7"),
            ("fit", "on"),
            ("order", "exact"),
            ("cycle", "on"),
            ("effort", "12345"),
            ("lift", "4.5"),
        ] {
            assert_eq!(options.set(name, value), Ok(true), "{name}");
        }
        options
    }

    #[test]
    fn all_options_come_back_as_they_were() {
        let (usual, changed) = (PlotOptions::default(), changed());
        for (line, other) in usual.lines().zip(changed.lines()) {
            let (line, other) = (line.to_string(), other.to_string());
            assert!(line != other || line.starts_with("$see="), "{line} is not changed");
        }
        for options in [usual, changed] {
            assert_eq!(KeptOptions::from(&options).options(), Some(options));
        }
        for projection in ["perspective", "orthographic", "cabinet", "isometric", "dimetric"] {
            for hidden in ["erased", "dotted", "dashed", "shown", "pen"] {
                let mut options = changed;
                assert_eq!(options.set("projection", projection), Ok(true));
                assert_eq!(options.set("hidden", hidden), Ok(true));
                assert_eq!(options.set("order", "greedy"), Ok(true));
                assert_eq!(KeptOptions::from(&options).options(), Some(options));
            }
        }
    }

    #[test]
    fn what_no_user_could_have_set_is_refused() {
        let kept = KeptOptions::from(&changed());
        let changes: [fn(&mut KeptOptions); 12] = [
            |kept| kept.directions[2][1] = f64::NAN,
            |kept| kept.directions[0][0] = 2e15,
            |kept| kept.projection[1] = -0.1,
            |kept| kept.projection[0] = 361.0,
            |kept| kept.crease = f64::INFINITY,
            |kept| kept.precision = i64::MAX,
            |kept| kept.exponent = 40_000,
            |kept| kept.precision = -1,
            |kept| kept.lengths[0] = 0,
            |kept| kept.lengths[4] = -1,
            |kept| kept.codes = [4; 6],
            |kept| kept.title[0] = [0xFF; TITLE_PIECE],
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut kept = kept;
            change(&mut kept);
            assert_eq!(kept.options(), None, "change {number}");
        }
    }
}
