//! What the user is told about a file with the options for it: what is drawn otherwise than the
//! file says, and which options change nothing.
//!
//! Each row of `RULES` says when some options change nothing, and why. Whether an option changes
//! something in this very model is not asked, only whether it could. Options that contradict each
//! other, or that need another one, are refused by the command line.

use crate::Settings;
use penup::plotter::{OPTIONS, PlotOption, PlotOptions, VisibilityMode};
use penup_readers::page::Page;
use penup_readers::words::{MOSTLY_FLAT, PROBABLY_Y_UP};

/// The length in mm below which nothing is drawn: about a step of the usual motors.
const SMALLEST: f64 = 0.0125;

/// What is told of a plan that is not laid on the page as it is.
const SEEN_IN_SPACE: &str = "the drawing lies flat, but a view of it is chosen, so it is drawn as \
                             a model in space, not at true size";

/// What is told of a plan with these `bounds`, its least and greatest coordinates in mm.
pub fn of_plan(settings: &Settings, bounds: [[f64; 2]; 2]) -> Vec<String> {
    if !settings.shows_plans_flat() {
        return vec![SEEN_IN_SPACE.to_owned()];
    }
    let told =
        [settings.moves_plan(bounds), settings.fits_turned(bounds), too_small(settings, bounds)];
    told.into_iter().flatten().collect()
}

/// The notes of readers that say nothing new, because the user has done what they advise.
pub fn followed(settings: &Settings) -> Vec<&'static str> {
    let (_, names) = changed(settings);
    let advice = [(MOSTLY_FLAT, &["crease"][..]), (PROBABLY_Y_UP, &["up", "angles"])];
    let is_done = |options: &[&str]| options.iter().any(|it| names.iter().any(|name| name == it));
    advice.into_iter().filter(|(_, options)| is_done(options)).map(|(note, _)| note).collect()
}

/// Says that a plan with these least and greatest coordinates is so small that nothing, or hardly
/// anything, is drawn of it at true size.
fn too_small(settings: &Settings, [low, high]: [[f64; 2]; 2]) -> Option<String> {
    let [width, height] = [0, 1].map(|axis: usize| high[axis] - low[axis]);
    let is_small = width.max(height) < SMALLEST && settings.value("fit") == Some("off");
    // What coordinates of many decimals add is left out.
    let digits = |length: f64| (length * 1e9).round() / 1e9;
    is_small.then(|| {
        format!(
            "the drawing is {} x {} mm at true size, which is less than a step of the motors: \
             --fit scales it to the page",
            digits(width),
            digits(height)
        )
    })
}

/// Says which page a plan is scaled to, if it is the file's `own`, and not the `sheet` of a user.
pub fn fits_own_page(settings: &Settings, own: Option<Page>, sheet: Page) -> Option<String> {
    let Page { width, height } = own?;
    let is_own = [sheet.width, sheet.height] == [width, height];
    (is_own && settings.value("fit") == Some("on")).then(|| {
        format!(
            "--fit scales to the page of the file, which is {width} x {height} mm: --page A4 is \
             another one"
        )
    })
}

/// What decides whether an option can change anything.
struct Choices<'s> {
    options: PlotOptions,
    settings: &'s Settings,
    is_plan: bool,
}

impl Choices<'_> {
    /// Whether the drawing is a plan that is laid on the page as it is.
    fn is_flat(&self) -> bool {
        self.is_plan && self.options.shows_plans_flat()
    }
}

/// When some options change nothing.
struct Rule {
    applies: fn(&Choices<'_>) -> bool,
    /// Whether the option with this name is one of them.
    names: fn(&str) -> bool,
    /// The reason, as the beginning of a sentence.
    because: &'static str,
}

/// The rules. An option is told by the first one that names it.
const RULES: [Rule; 6] = [
    Rule {
        applies: |choices| choices.is_flat(),
        names: is_of_camera,
        because: "the drawing lies flat and is drawn as it lies, as no model in space does",
    },
    Rule {
        applies: |choices| !choices.is_flat(),
        names: |name| name == "fit",
        because: "a model in space is always scaled to the page",
    },
    Rule {
        applies: |choices| choices.options.see == VisibilityMode::Wire,
        names: |name| matches!(name, "hidden" | "seams" | "blocks"),
        because: "in a wire frame nothing hides anything",
    },
    Rule {
        applies: |choices| {
            matches!(choices.options.see, VisibilityMode::Vertices | VisibilityMode::Edges)
        },
        names: |name| matches!(name, "seams" | "blocks" | "crease"),
        because: "one convex solid has neither seams nor blocks, and all its edges are drawn",
    },
    Rule {
        applies: |choices| choices.settings.value("angles").is_some(),
        names: |name| matches!(name, "at" | "up"),
        because: "--angles alone says where the camera looks",
    },
    Rule {
        applies: |choices| choices.options.title().is_none(),
        names: |name| name == "title-size",
        because: "there is no --title",
    },
];

fn is_of_camera(name: &str) -> bool {
    let of = |option: &&PlotOption| option.name == name;
    let flag = OPTIONS.iter().find(of).and_then(|option| option.flag.get());
    flag.is_some_and(|flag| flag.heading == "Camera")
}

/// The options of the plotter with these settings, and the names of those that are not as usual.
fn changed(settings: &Settings) -> (PlotOptions, Vec<String>) {
    let usual: Vec<String> = PlotOptions::default().lines().map(|it| it.to_string()).collect();
    let options = settings.options();
    let name = |line: String| Some(line.strip_prefix('$')?.split('=').next()?.to_owned());
    let names = options
        .lines()
        .map(|line| line.to_string())
        .zip(usual)
        .filter(|(now, usual)| now != usual)
        .filter_map(|(now, _)| name(now))
        .collect();
    (options, names)
}

/// Names the options among the `settings` that change nothing, each with the reason, in sentences.
/// The file `is_plan` if it lies flat.
pub fn idle_options(settings: &Settings, is_plan: bool) -> Vec<String> {
    let (options, mut names) = changed(settings);
    let choices = Choices { options, settings, is_plan };
    let mut sentences = Vec::new();
    for rule in RULES.iter().filter(|rule| (rule.applies)(&choices)) {
        let idle = names.extract_if(.., |name| (rule.names)(name));
        let idle: Vec<String> = idle.map(|name| format!("--{name}")).collect();
        if !idle.is_empty() {
            sentences.push(format!(
                "{}, so nothing is changed by {}",
                rule.because,
                idle.join(", ")
            ));
        }
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::{SEEN_IN_SPACE, idle_options, of_plan};
    use crate::Settings;
    use penup_readers::page::A4;

    #[test]
    fn each_option_that_changes_nothing_is_told_once_with_the_reason() {
        let told = |values: &[(&'static str, &str)], is_plan| {
            let values = values.iter().map(|(name, value)| (*name, (*value).to_owned())).collect();
            idle_options(&Settings { page: A4, values }, is_plan)
        };
        let all = [
            ("at", "1,2,3"),
            ("hidden", "dotted"),
            ("seams", "off"),
            ("blocks", "merged"),
            ("crease", "30"),
            ("title-size", "8"),
            ("fit", "on"),
        ];
        let with = |name, value| [&all[..], &[(name, value)]].concat();
        let no_title = "there is no --title, so nothing is changed by --title-size";
        let scaled =
            "a model in space is always scaled to the page, so nothing is changed by --fit";
        assert_eq!(told(&all, false), [scaled, no_title]);
        assert_eq!(told(&with("title", "Ada"), false), [scaled]);
        assert_eq!(
            told(&all, true),
            [
                "the drawing lies flat and is drawn as it lies, as no model in space does, so \
                 nothing is changed by --at, --hidden, --seams, --blocks, --crease",
                no_title
            ]
        );
        let wire = "in a wire frame nothing hides anything, so nothing is changed by --hidden, \
                    --seams, --blocks";
        assert_eq!(told(&with("see", "wire"), false), [scaled, wire, no_title]);
        for see in ["vertices", "edges"] {
            let convex = "one convex solid has neither seams nor blocks, and all its edges are \
                          drawn, so nothing is changed by --seams, --blocks, --crease";
            assert_eq!(told(&with("see", see), false), [scaled, convex, no_title]);
        }
        let angles = "--angles alone says where the camera looks, so nothing is changed by --at";
        assert_eq!(told(&with("angles", "10,20,30"), true), [scaled, angles, no_title]);
        assert!(told(&[], false).is_empty() && told(&[], true).is_empty());
    }
    #[test]
    fn a_plan_that_is_seen_in_space_is_told_to_be_no_longer_at_true_size() {
        let told = |name, value: &str| {
            let values = vec![("fit", "off".to_owned()), (name, value.to_owned())];
            of_plan(&Settings { page: A4, values }, [[20.0, 20.0], [60.0, 50.0]])
        };
        for (name, value) in
            [("eye", "0,0,9"), ("projection", "isometric"), ("see", "edges"), ("angles", "1,2,3")]
        {
            assert_eq!(told(name, value), [SEEN_IN_SPACE], "{name}");
        }
        for (name, value) in [("at", "1,2,3"), ("projection", "cabinet"), ("see", "wire")] {
            assert_eq!(told(name, value), [""; 0], "{name}");
        }
    }
}
