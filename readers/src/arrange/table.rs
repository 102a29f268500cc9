//! The table of the options of a plan: one row for each.

use super::{Arrangement, Crop, Hatch};

/// One option of a plan. The flags of the command line and their help are made from it.
#[derive(Debug, Clone, Copy)]
pub struct PlanOption {
    /// The name of the option, as in `--name`.
    pub name: &'static str,
    /// The placeholder for the value in the help; empty if the option takes none.
    pub value: &'static str,
    /// The text of the help.
    pub help: &'static str,
    /// Whether the option would have no effect on a plan that is scaled to the page.
    pub changes_size: bool,
    /// Parses and sets the value. On an error nothing is changed.
    pub(super) set: fn(&mut Arrangement, &str) -> Result<(), String>,
    /// Whether the option is given.
    pub(super) is_set: fn(&Arrangement) -> bool,
}

/// The least and the greatest factor of a scale.
const FACTORS: std::ops::RangeInclusive<f64> = 0.001..=1000.0;

/// The greatest tolerance in mm.
const MOST_TOLERANCE: f64 = 10.0;

/// The options, in the order in which they act.
pub const PLAN_OPTIONS: &[PlanOption] = &[
    PlanOption {
        name: "layer",
        value: "NAMES",
        help: "Draw these layers only, by name or number, with commas between them; a file without \
               layers has one for each pen",
        changes_size: false,
        set: |arrangement, text| {
            arrangement.layers = names(text)?;
            Ok(())
        },
        is_set: |arrangement| !arrangement.layers.is_empty(),
    },
    PlanOption {
        name: "scale",
        value: "FACTOR",
        help: "Make the drawing larger or smaller about its middle; X,Y scales each axis by its \
               own factor",
        changes_size: true,
        set: |arrangement, text| {
            let factors = numbers(text)?;
            let factors = match *factors.as_slice() {
                [factor] => [factor, factor],
                [x, y] => [x, y],
                _ => return Err("a scale is one factor, or one for each axis".to_owned()),
            };
            if !factors.iter().all(|factor| FACTORS.contains(&factor.abs())) {
                return Err("a factor is 0.001 to 1000, or negative to mirror".to_owned());
            }
            arrangement.scale = Some(factors);
            Ok(())
        },
        is_set: |arrangement| arrangement.scale.is_some(),
    },
    PlanOption {
        name: "rotate",
        value: "DEGREES",
        help: "Turn the drawing clockwise about its middle; negative turns counterclockwise",
        changes_size: false,
        set: |arrangement, text| {
            let [degrees] = *numbers(text)?.as_slice() else {
                return Err("a rotation is one angle".to_owned());
            };
            arrangement.rotate = Some(degrees);
            Ok(())
        },
        is_set: |arrangement| arrangement.rotate.is_some(),
    },
    PlanOption {
        name: "hatch",
        value: "MM",
        help: "Hatch filled shapes by lines so far apart, by the fill rule of an SVG and else \
               even-odd; MM,DEGREES turns the lines, which else run at 45 degrees",
        changes_size: false,
        set: |arrangement, text| {
            let (spacing, angle) = match *numbers(text)?.as_slice() {
                [spacing] => (spacing, 45.0),
                [spacing, angle] => (spacing, angle),
                _ => return Err("a hatch is a distance, and an angle after a comma".to_owned()),
            };
            if !(0.05..=1000.0).contains(&spacing) {
                return Err("hatch lines are 0.05 to 1000 mm apart".to_owned());
            }
            arrangement.hatch = Some(Hatch { spacing, angle });
            Ok(())
        },
        is_set: |arrangement| arrangement.hatch.is_some(),
    },
    PlanOption {
        name: "center",
        value: "",
        help: "Lay the drawing in the middle of the page",
        changes_size: true,
        set: |arrangement, _| {
            arrangement.center = true;
            Ok(())
        },
        is_set: |arrangement| arrangement.center,
    },
    PlanOption {
        name: "crop",
        value: "X,Y,WIDTH,HEIGHT",
        help: "Cut off what is beyond this rectangle, in mm from the lower left corner of the \
               page; page cuts at the margin of the page",
        changes_size: false,
        set: |arrangement, text| {
            if text.trim() == "page" {
                arrangement.crop = Some(Crop::Page);
                return Ok(());
            }
            let [x, y, width, height] = *numbers(text)?.as_slice() else {
                return Err("a crop is page, or X,Y,WIDTH,HEIGHT".to_owned());
            };
            if !(width > 0.0 && height > 0.0) {
                return Err("the width and the height of a crop are above 0".to_owned());
            }
            // The border lies where coordinates are written, in thousandths, so that it is exact.
            let rounded = |value: f64| (value * 1000.0).round() / 1000.0;
            let corners = [[x, y], [x + width, y + height]];
            arrangement.crop = Some(Crop::Rectangle(corners.map(|it| it.map(rounded))));
            Ok(())
        },
        is_set: |arrangement| arrangement.crop.is_some(),
    },
    PlanOption {
        name: "linemerge",
        value: "MM",
        help: "Join strokes of one pen whose ends are no farther apart, in either direction",
        changes_size: false,
        set: |arrangement, text| {
            arrangement.linemerge = Some(tolerance(text)?);
            Ok(())
        },
        is_set: |arrangement| arrangement.linemerge.is_some(),
    },
    PlanOption {
        name: "simplify",
        value: "MM",
        help: "Leave out points as long as each stays within this distance of the line",
        changes_size: false,
        set: |arrangement, text| {
            arrangement.simplify = Some(tolerance(text)?);
            Ok(())
        },
        is_set: |arrangement| arrangement.simplify.is_some(),
    },
    PlanOption {
        name: "layer-order",
        value: "NAMES",
        help: "Draw the layers in this order, by name or number, with commas between them: pen 1 \
               draws the first, and so on; those that are not named come last",
        changes_size: false,
        set: |arrangement, text| {
            arrangement.layer_order = names(text)?;
            Ok(())
        },
        is_set: |arrangement| !arrangement.layer_order.is_empty(),
    },
];

/// Parses numbers with commas between them.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| match word.trim().parse::<f64>() {
        Ok(number) if number.is_finite() && number.abs() <= 1e6 => Ok(number),
        _ => Err(format!("\"{}\" is not a number up to a million", word.trim())),
    };
    text.split(',').map(number).collect()
}

/// Parses a distance that may be neglected.
fn tolerance(text: &str) -> Result<f64, String> {
    match *numbers(text)?.as_slice() {
        [tolerance] if tolerance > 0.0 && tolerance <= MOST_TOLERANCE => Ok(tolerance),
        _ => Err(format!("a tolerance is above 0 and up to {MOST_TOLERANCE} mm")),
    }
}

/// Parses names with commas between them.
fn names(text: &str) -> Result<Vec<String>, String> {
    let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
    let is_whole = names.iter().all(|name| !name.is_empty());
    if is_whole { Ok(names) } else { Err("the name of a layer is empty".to_owned()) }
}
