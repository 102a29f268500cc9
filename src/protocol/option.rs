//! The options of a plot, `$name=value`.

use super::CommandError;
use super::values::{PENS, direction, number, on_or_off, positive, values, whole};
use crate::fixed::{Decimal, Millimetres};
use crate::order;
use crate::view::{Direction, Lens};

/// What is drawn, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlotOption {
    /// `$eye=x,y,z`
    Eye(Direction),
    /// `$at=x,y,z`
    At(Direction),
    /// `$up=x,y,z`
    Up(Direction),
    /// `$angles=α,β,γ`: Harrison's rotation, in degrees.
    Angles(Direction),
    /// `$view=auto`: forget eye, at, up and angles.
    AutomaticView,
    /// `$projection=…`
    Projection(ProjectionChoice),
    /// `$behind=clip|refuse`: what is behind the eye is cut off (`true`), or an error.
    ClipBehind(bool),
    /// `$see=faces|wire|vertices|edges`
    See(VisibilityMode),
    /// `$hidden=erased|dotted|dashed|shown|pen|pen,NUMBER`
    Hidden(HiddenLines),
    /// `$seams=on|off`: where faces pass through each other.
    Seams(bool),
    /// `$blocks=separate|merged`: whether blocks that touch are one shape (`true`).
    MergedBlocks(bool),
    /// `$crease=DEGREES`: edges less sharp are not drawn.
    Crease(f64),
    /// `$precision=auto|LENGTH`: how far coordinates may be off; `None` goes by their decimals.
    Precision(Option<Decimal>),
    /// `$pens=auto|one`: whether one pen draws all (`true`).
    OnePen(bool),
    /// `$page=WIDTHxHEIGHT` in mm
    Page {
        /// Along x.
        width: Millimetres,
        /// Along y.
        height: Millimetres,
    },
    /// `$margin=MM`
    Margin(Millimetres),
    /// `$title-size=MM`
    TitleSize(Millimetres),
    /// `$fit=on|off`
    Fit(bool),
    /// `$order=auto|greedy|exact`
    Order(order::Method),
    /// `$cycle=on|off`: whether the pen returns to where it began.
    Cycle(bool),
    /// `$effort=N`
    Effort(u32),
    /// `$lift=MM`
    Lift(Millimetres),
}

/// How the model comes onto the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProjectionChoice {
    /// From the eye, through a lens.
    Lens(Lens),
    /// Parallel, from a direction in degrees; eye and angles are not used.
    Axonometric {
        /// From the x axis towards y: -90 is in front.
        azimuth: f64,
        /// Above the xy plane.
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
            // All three axes are foreshortened alike: the elevation is atan(1 / sqrt 2).
            ("isometric", None) => axonometric(-45.0, 35.264_389_682_754_654),
            // The two axes that are foreshortened alike lie at 7 and 42 degrees: 1, 1 and 1/2.
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

/// How it is found out what is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VisibilityMode {
    /// Any faces hide what is behind them.
    #[default]
    Faces,
    /// Nothing hides anything: a wire frame.
    Wire,
    /// The vertices alone are those of one convex solid.
    Vertices,
    /// The vertices and edges are those of one convex solid.
    Edges,
}

/// What becomes of the hidden lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HiddenLines {
    /// Left out.
    #[default]
    Erased,
    /// Drawn dotted.
    Dotted,
    /// Drawn dashed.
    Dashed,
    /// Drawn like visible ones: a wire frame.
    Shown,
    /// Drawn with this pen, from 0.
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
            // The first pen draws what is seen.
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
    /// `None` if no option has this name.
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
