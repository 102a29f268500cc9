//! Counts instructions: the program runs itself under valgrind's `callgrind`, which counts within
//! [`measured`] and writes the count whenever [`lap`] ends.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;

/// Under this argument the program measures and prints nothing.
pub const MEASURE: &str = "--measure";

/// What a piece of work cost.
#[derive(Debug, Clone)]
pub struct Measured<R> {
    pub result: R,
    /// The cost of each matching that was found on the way, and the instructions until then.
    pub laps: Vec<(u64, Option<u64>)>,
    /// All instructions; none if they cannot be counted here.
    pub instructions: Option<u64>,
}

/// Where the counts come from.
#[derive(Debug)]
pub enum Meter {
    /// This run is the one that is measured, or nothing can be measured.
    Silent,
    /// The counts of all laps and pieces of work, in their order.
    Known(std::vec::IntoIter<u64>),
}

impl Meter {
    /// Measures the whole program in a run of its own, if valgrind is installed.
    pub fn new() -> Self {
        let directory = std::env::temp_dir().join(format!("penup-{}", std::process::id()));
        let counts = count_in(&directory);
        // What is left there is of no use to anybody.
        let _ = std::fs::remove_dir_all(&directory);
        counts.map_or(Self::Silent, |counts| Self::Known(counts.into_iter()))
    }

    /// Does `work`, which tells the costs that it finds; with `laps` each of them is counted to.
    pub fn measure<R>(
        &mut self,
        laps: bool,
        work: impl FnOnce(&mut dyn FnMut(u64)) -> R,
    ) -> Measured<R> {
        let mut costs = Vec::with_capacity(1 << 12);
        let mut work = Some(work);
        let mut result = None;
        measured(&mut || {
            let work = work.take().expect("done once");
            result = Some(work(&mut |cost| {
                if laps {
                    costs.push(cost);
                    lap();
                }
            }));
        });
        let mut so_far = Some(0);
        let mut count = || {
            so_far = match self {
                Self::Known(counts) => so_far.zip(counts.next()).map(|(sum, count)| sum + count),
                Self::Silent => None,
            };
            so_far
        };
        let laps = costs.into_iter().map(|cost| (cost, count())).collect();
        Measured { result: result.expect("done"), laps, instructions: count() }
    }
}

/// Only what happens in here is counted.
#[inline(never)]
fn measured(work: &mut dyn FnMut()) {
    work();
    lap();
}

/// A count is written when this ends.
#[inline(never)]
fn lap() {
    black_box(());
}

fn count_in(directory: &Path) -> Option<Vec<u64>> {
    std::fs::create_dir_all(directory).ok()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--collect-atstart=no", "--toggle-collect=*meter::measured*"])
        .arg("--dump-after=*meter::lap*")
        .arg(format!("--callgrind-out-file={}", directory.join("counts").display()))
        .arg(std::env::current_exe().ok()?)
        .arg(MEASURE)
        .output()
        .ok()?;
    if !output.status.success() {
        return None;
    }
    (1..)
        .map_while(|part| std::fs::read_to_string(directory.join(format!("counts.{part}"))).ok())
        // The last part is what was left when the program ended.
        .filter(|text| !text.contains("Trigger: Program termination"))
        .map(|text| {
            let total = text.lines().find_map(|line| line.strip_prefix("totals: "));
            total.and_then(|total| total.trim().parse().ok())
        })
        .collect()
}
