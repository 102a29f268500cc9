//! Parses the options of a plot, `$name=value`.

use super::CommandError;
use super::values::{PENS, direction, number, on_or_off, positive, values, whole};
use crate::fixed::{Decimal, Millimetres};
use crate::order;
use crate::view::{Direction, Lens};

/// One option of a plot, with its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlotOption {
    /// `$eye=x,y,z`: the position of the eye, in units of the model.
    Eye(Direction),
    /// `$at=x,y,z`: the point looked at, in units of the model.
    At(Direction),
    /// `$up=x,y,z`: the direction that is upward on the page.
    Up(Direction),
    /// `$angles=α,β,γ`: the rotation of the view as in Harrison, in degrees.
    Angles(Direction),
    /// `$view=auto`: forgets eye, at, up and angles.
    AutomaticView,
    /// `$projection=…`: the kind of projection.
    Projection(ProjectionChoice),
    /// `$behind=clip|refuse`: whether parts of the model behind the eye are clipped (`true`) or an
    /// error.
    ClipBehind(bool),
    /// `$see=faces|wire|vertices|edges`: how visibility is determined.
    See(VisibilityMode),
    /// `$hidden=erased|dotted|dashed|shown|pen|pen,NUMBER`: how hidden lines are drawn, if at all.
    Hidden(HiddenLines),
    /// `$seams=on|off`: whether lines are drawn where faces intersect each other.
    Seams(bool),
    /// `$blocks=separate|merged`: whether touching blocks are drawn as one shape (`true`).
    MergedBlocks(bool),
    /// `$crease=DEGREES`: edges whose faces bend by less are not drawn.
    Crease(f64),
    /// `$precision=auto|LENGTH`: the largest error of the coordinates, in units of the model.
    /// `None` derives it from their decimal places.
    Precision(Option<Decimal>),
    /// `$pens=auto|one`: whether one pen draws everything (`true`).
    OnePen(bool),
    /// `$page=WIDTHxHEIGHT`: the size of the sheet, in mm.
    Page {
        /// Size along x, in mm.
        width: Millimetres,
        /// Size along y, in mm.
        height: Millimetres,
    },
    /// `$margin=MM`: the margin on each side of the sheet.
    Margin(Millimetres),
    /// `$title-size=MM`: the height of the title's capital letters.
    TitleSize(Millimetres),
    /// `$fit=on|off`: whether a plan is scaled to the page.
    Fit(bool),
    /// `$order=auto|greedy|exact`: how the order of the strokes is computed.
    Order(order::Method),
    /// `$cycle=on|off`: whether the pen returns to its starting point.
    Cycle(bool),
    /// `$effort=N`: how many distances are tried per pen-up move to improve the order.
    Effort(u32),
    /// `$lift=MM`: extra pen-up travel that is accepted to save one pen lift.
    Lift(Millimetres),
}

/// How the model is projected onto the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProjectionChoice {
    /// A projection from the eye, through a lens.
    Lens(Lens),
    /// A parallel projection along a given direction, in degrees. The options eye and angles are
    /// not used.
    Axonometric {
        /// Angle from the x axis towards the y axis, in degrees. -90 is the view from the front.
        azimuth: f64,
        /// Angle above the xy plane, in degrees.
        elevation: f64,
    },
}

impl Default for ProjectionChoice {
    fn default() -> Self {
        Self::Lens(Lens::Perspective)
    }
}

impl ProjectionChoice {
    const CHOICES: &str = "perspective, orthographic, cavalier, cabinet, oblique,ANGLE,RATIO, isometric, \
                           dimetric, trimetric or axonometric,AZIMUTH,ELEVATION";

    fn parse(value: &str) -> Result<Self, CommandError> {
        let (name, numbers) = match value.split_once(',') {
            Some((name, numbers)) => (name.trim(), Some(numbers)),
            None => (value, None),
        };
        let oblique = |angle, ratio| Self::Lens(Lens::Oblique { angle, ratio });
        let axonometric = |azimuth, elevation| Self::Axonometric { azimuth, elevation };
        Ok(match (name, numbers) {
            ("perspective", None) => Self::Lens(Lens::Perspective),
            ("orthographic", None) => Self::Lens(Lens::Orthographic),
            ("cavalier", None) => oblique(45.0, 1.0),
            ("cabinet", None) => oblique(45.0, 0.5),
            ("oblique", Some(numbers)) => {
                let [angle, ratio] = values(numbers)?;
                if !(0.0..=2.0).contains(&ratio) || libm::fabs(angle) > 360.0 {
                    return Err(CommandError::NumberOutOfRange);
                }
                oblique(angle, ratio)
            }
            // All three axes are foreshortened equally: the elevation is atan(1 / sqrt 2).
            ("isometric", None) => axonometric(-45.0, 35.264_389_682_754_654),
            // The x, y and z axes are foreshortened in the ratio 1 : 1/2 : 1. On the page, x and y
            // lie at some 7 and 41 degrees to the horizontal.
            ("dimetric", None) => axonometric(-69.295_188_945_364_57, 19.471_220_634_490_69),
            ("trimetric", None) => axonometric(-60.0, 25.0),
            ("dimetric" | "trimetric" | "axonometric", Some(numbers)) => {
                let [azimuth, elevation] = values(numbers)?;
                if libm::fabs(azimuth) > 360.0 || libm::fabs(elevation) > 90.0 {
                    return Err(CommandError::NumberOutOfRange);
                }
                axonometric(azimuth, elevation)
            }
            _ => return Err(CommandError::NotAChoice { choices: Self::CHOICES }),
        })
    }
}

/// How visibility is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VisibilityMode {
    /// Faces of any kind hide what is behind them.
    #[default]
    Faces,
    /// Nothing hides anything: the model is drawn as a wire frame.
    Wire,
    /// The vertices are those of one convex solid. Faces and edges are derived from them.
    Vertices,
    /// The vertices and edges are those of one convex solid. Its faces are derived from them.
    Edges,
}

/// How hidden lines are drawn, if at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HiddenLines {
    /// They are not drawn.
    #[default]
    Erased,
    /// They are drawn dotted.
    Dotted,
    /// They are drawn dashed.
    Dashed,
    /// They are drawn like visible ones, which gives a wire frame.
    Shown,
    /// They are drawn with this pen, counted from 0.
    Pen(u8),
}

impl HiddenLines {
    const CHOICES: &str = "erased, dotted, dashed, shown, pen or pen,NUMBER";

    fn parse(value: &str) -> Result<Self, CommandError> {
        Ok(match value {
            "erased" => Self::Erased,
            "dotted" => Self::Dotted,
            "dashed" => Self::Dashed,
            "shown" => Self::Shown,
            // The first pen draws the visible lines, so this is the second.
            "pen" => Self::Pen(1),
            _ => {
                let number = value.strip_prefix("pen,");
                let number = number.ok_or(CommandError::NotAChoice { choices: Self::CHOICES })?;
                match whole(number)? {
                    number @ 1..=PENS => Self::Pen(number as u8 - 1),
                    _ => return Err(CommandError::NumberOutOfRange),
                }
            }
        })
    }
}

impl PlotOption {
    /// Parses the value of the option with this name. `None` if no option has this name.
    pub(super) fn parse(name: &str, value: &str) -> Result<Option<Self>, CommandError> {
        let option = match name {
            "eye" => Self::Eye(direction(value)?),
            "at" => Self::At(direction(value)?),
            "up" => Self::Up(direction(value)?),
            "view" => match value {
                "auto" => Self::AutomaticView,
                _ => return Err(CommandError::NotAChoice { choices: "auto" }),
            },
            "angles" => Self::Angles(direction(value)?),
            "projection" => Self::Projection(ProjectionChoice::parse(value)?),
            "behind" => Self::ClipBehind(match value {
                "clip" => true,
                "refuse" => false,
                _ => return Err(CommandError::NotAChoice { choices: "clip or refuse" }),
            }),
            "see" => Self::See(match value {
                "faces" => VisibilityMode::Faces,
                "wire" => VisibilityMode::Wire,
                "vertices" => VisibilityMode::Vertices,
                "edges" => VisibilityMode::Edges,
                _ => {
                    return Err(CommandError::NotAChoice {
                        choices: "faces, wire, vertices or edges",
                    });
                }
            }),
            "hidden" => Self::Hidden(HiddenLines::parse(value)?),
            "precision" if value == "auto" => Self::Precision(None),
            "precision" => {
                let precision = number(value)?;
                if !(0.0..=1e6).contains(&precision.to_f64()) {
                    return Err(CommandError::NumberOutOfRange);
                }
                Self::Precision(Some(precision))
            }
            "pens" => Self::OnePen(match value {
                "one" => true,
                "auto" => false,
                _ => return Err(CommandError::NotAChoice { choices: "auto or one" }),
            }),
            "page" => {
                let (width, height) = value.split_once(['x', 'X']).ok_or(CommandError::NotAPage)?;
                Self::Page { width: positive(width)?, height: positive(height)? }
            }
            "margin" | "lift" => {
                let length =
                    number(value)?.to_millimetres().map_err(|_| CommandError::NumberOutOfRange)?;
                match name {
                    _ if length < 0 => return Err(CommandError::NumberOutOfRange),
                    "margin" => Self::Margin(length),
                    _ if length > 1000 => return Err(CommandError::NumberOutOfRange),
                    _ => Self::Lift(length),
                }
            }
            "title-size" => {
                let size = positive(value)?;
                if !(1..=100).contains(&size) {
                    return Err(CommandError::NumberOutOfRange);
                }
                Self::TitleSize(size)
            }
            "fit" => Self::Fit(on_or_off(value)?),
            "order" => Self::Order(match value {
                "auto" => order::Method::Auto,
                "greedy" => order::Method::Greedy,
                "exact" => order::Method::Exact,
                _ => return Err(CommandError::NotAChoice { choices: "auto, greedy or exact" }),
            }),
            "cycle" => Self::Cycle(on_or_off(value)?),
            "effort" => Self::Effort(
                u32::try_from(whole(value)?).map_err(|_| CommandError::NumberOutOfRange)?,
            ),
            "seams" => Self::Seams(on_or_off(value)?),
            "blocks" => Self::MergedBlocks(match value {
                "merged" => true,
                "separate" => false,
                _ => return Err(CommandError::NotAChoice { choices: "separate or merged" }),
            }),
            "crease" => {
                let [degrees] = values(value)?;
                if !(0.0..=180.0).contains(&degrees) {
                    return Err(CommandError::NumberOutOfRange);
                }
                Self::Crease(degrees)
            }
            _ => return Ok(None),
        };
        Ok(Some(option))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Command;
    use super::*;

    #[test]
    fn options_are_read_with_their_values() {
        let option = |line| match Command::parse(line) {
            Ok(Command::Option(option)) => Ok(option),
            Ok(other) => panic!("{other:?}"),
            Err(command_error) => Err(command_error),
        };
        assert_eq!(option("$eye=-1, 2.5 ,3e1"), Ok(PlotOption::Eye([-1.0, 2.5, 30.0])));
        let projection = |value| match option(value) {
            Ok(PlotOption::Projection(choice)) => Ok(choice),
            Ok(other) => panic!("{other:?}"),
            Err(command_error) => Err(command_error),
        };
        assert_eq!(
            projection("$projection = orthographic"),
            Ok(ProjectionChoice::Lens(Lens::Orthographic))
        );
        assert_eq!(projection("$projection=cabinet"), projection("$projection=oblique, 45,0.5"));
        assert_eq!(projection("$projection=oblique,45,3"), Err(CommandError::NumberOutOfRange));
        assert_eq!(
            projection("$projection=oblique,45"),
            Err(CommandError::WrongNumberCount { needed: 2 })
        );
        assert_eq!(
            projection("$projection=trimetric,10,20"),
            projection("$projection=axonometric,10,20")
        );
        assert!(matches!(
            projection("$projection=isometric,1,2"),
            Err(CommandError::NotAChoice { .. })
        ));
        assert_eq!(
            option("$page=210x297"),
            Ok(PlotOption::Page {
                width: Millimetres::from_num(210),
                height: Millimetres::from_num(297)
            })
        );
        assert_eq!(option("$eye=1,2"), Err(CommandError::WrongNumberCount { needed: 3 }));
        assert_eq!(option("$eye=1,2,3,4"), Err(CommandError::WrongNumberCount { needed: 3 }));
        assert_eq!(option("$eye=1,2,"), Err(CommandError::NotANumber));
        assert_eq!(option("$eye=1,2,1e300"), Err(CommandError::NumberOutOfRange));
        assert_eq!(option("$page=210"), Err(CommandError::NotAPage));
        assert_eq!(option("$page=0x297"), Err(CommandError::NumberOutOfRange));
        assert_eq!(option("$margin=-1"), Err(CommandError::NumberOutOfRange));
        assert_eq!(
            option("$hidden=gone"),
            Err(CommandError::NotAChoice {
                choices: "erased, dotted, dashed, shown, pen or pen,NUMBER"
            })
        );
        assert_eq!(Command::parse("$110=5"), Ok(Command::Setting { name: "110", value: "5" }));
    }
}
