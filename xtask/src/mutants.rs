//! Changes the library in small ways, and looks for changes that its unit tests do not find.

use std::fmt;
use std::fs;
use std::process::Command;
use std::str::FromStr;

use anyhow::{Context, Result, ensure};

use crate::command::{cargo, describe, output, run};

/// The modules whose changes are tried: what decides which lines are drawn, in which order, by
/// which steps and when.
const FILES: [&str; 10] = [
    "src/fixed.rs",
    "src/fixed/**",
    "src/geometry.rs",
    "src/view/**",
    "src/visibility/**",
    "src/order/**",
    "src/step/**",
    "src/motion/**",
    "src/protocol/**",
    "src/storage/**",
];

/// What a whole build of the workspace turns on. Of code that is not compiled no change would be
/// found.
const FEATURES: &str = "host,threads,tiles";

/// The longest time for the tests of one change, in seconds. One that makes them hang is found.
/// Without a change they take some four seconds on one busy core.
const TIMEOUT: u32 = 60;

/// How many changes of the sample there are to one of the further changes. The sample has a few
/// less than were asked for, because it is every so manyth change; with the further ones it has
/// more.
const FURTHER: usize = 19;

/// A portion of the sample: number `number`, from 1, of `of` portions of the same size; or further
/// changes, none of which is in the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A portion of the sample.
    Of {
        /// Which one, from 1 on.
        number: usize,
        /// How many there are.
        of: usize,
    },
    /// Further changes.
    Further,
}

impl Part {
    /// The whole sample.
    pub const WHOLE: Self = Self::Of { number: 1, of: 1 };

    /// Which of cargo-mutants' shards of all changes it is, and of how many, if the sample is every
    /// `step`th change, from the first on: every `of`th of these, from number `number` on. The
    /// further ones lie half-way between two changes of the sample.
    fn shard(self, step: usize) -> (usize, usize) {
        match self {
            Self::Of { number, of } => ((number - 1) * step, of * step),
            Self::Further => (step / 2, FURTHER * step),
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Of { number, of } => write!(formatter, "{number}-of-{of}"),
            Self::Further => write!(formatter, "further"),
        }
    }
}

impl FromStr for Part {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "further" {
            return Ok(Self::Further);
        }
        let portion = text.split_once('/').and_then(|(number, of)| {
            let (number, of): (usize, usize) = (number.parse().ok()?, of.parse().ok()?);
            ((1..=of).contains(&number) && of <= 1000).then_some(Self::Of { number, of })
        });
        portion.context(
            "a portion is written as 2/5, the second of five (at most 1000), or as further",
        )
    }
}

/// Tries about `count` changes, spread evenly over all that there are, or a portion of them, and
/// prints those that no test finds. The same count gives the same changes, and all portions
/// together are the whole. The lists stay in target/mutants.
///
/// # Errors
/// `cargo-mutants` is missing, the tests fail without a change, or a change is not found.
pub fn run_sample(count: u32, part: Part) -> Result<()> {
    ensure!(
        mutants().arg("--version").output().is_ok_and(|out| out.status.success()),
        "this needs cargo-mutants; install it with\ncargo install cargo-mutants --locked"
    );
    let list: Vec<&str> = ["mutants", "--list", "--package", "penup"].to_vec();
    let files = FILES.iter().flat_map(|file| ["--file", file]);
    let list: Vec<&str> = list.into_iter().chain(files.clone()).collect();
    let all = output("cargo", &list).map_or(0, |text| text.lines().count());
    ensure!(all > 0, "cargo-mutants lists no change");
    let step = all.div_ceil(count.max(1) as usize).max(1);
    let (shard, shards) = part.shard(step);
    say!("penup: the sample is one change in {step} of {all}; portion {part}")?;
    // The copy of the workspace lies beside what is built, because it fills a small /tmp.
    let folder = crate::root().join("target/mutants");
    let output = folder.join(part.to_string());
    fs::create_dir_all(&output).with_context(|| format!("cannot make {}", output.display()))?;
    let mut command = mutants();
    command
        .env("TMPDIR", &folder)
        .args(["--package", "penup", "--profile", "mutants", "--cap-lints", "true"])
        .args(["--features", FEATURES])
        .args(files)
        .args(["--sharding", "round-robin", "--shard", &format!("{shard}/{shards}")])
        // For the build as well, which would make the examples anew besides.
        .args(["--cargo-arg", "--lib"])
        .args(["--timeout", &TIMEOUT.to_string(), "--no-shuffle", "--output"])
        .arg(&output);
    say!("penup: {}", describe(&command))?;
    run(&mut command)
}

/// The command in the root of the workspace.
fn mutants() -> Command {
    let mut command = cargo();
    command.current_dir(crate::root()).arg("mutants");
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_portions_are_the_whole_sample() {
        let chosen = |part: Part, step| {
            let (shard, shards) = part.shard(step);
            (0..1000).filter(move |change| change % shards == shard)
        };
        let parts = (1..=4).map(|number| Part::Of { number, of: 4 });
        let mut together: Vec<usize> = parts.flat_map(|part| chosen(part, 7)).collect();
        together.sort_unstable();
        assert_eq!(together, chosen(Part::WHOLE, 7).collect::<Vec<_>>());
        assert_eq!(together, (0..1000).step_by(7).collect::<Vec<_>>());
        // The further changes are others, and so many that the sample and they are enough.
        let further: Vec<usize> = chosen(Part::Further, 7).collect();
        assert_eq!(further.len(), 1000usize.div_ceil(7 * FURTHER));
        assert!(further.iter().all(|change| !together.contains(change)));
    }

    #[test]
    fn a_portion_that_does_not_exist_is_refused() {
        assert!("2/5".parse::<Part>().is_ok_and(|part| part == Part::Of { number: 2, of: 5 }));
        for text in ["", "2", "0/5", "6/5", "1/0", "a/5", "1/1001", "-1/5"] {
            assert!(text.parse::<Part>().is_err(), "{text}");
        }
    }
}
