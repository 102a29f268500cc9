//! The tables of chapter 7, section by section, with what Harrison found.
//!
//! The file is longer than 500 lines, because it follows the chapter from its beginning to its end.

use crate::meter::Meter;
use crate::problems::{INSTANCES, Problem};
use crate::sample::Sample;
use crate::table::Table;
use penup::stage::{NeverCancel, Scratch};
use penup_host_tests::enumeration::{
    Effort, Options, Reach, Sets, Start, SubProblem, Target, domino_matching, optimum,
    solve_image_problem,
};
use std::fmt::{Result, Write};

/// "Fairly high", so that there is something to improve (7.5, 7.8, 7.9).
const HIGH: Start = Start::NoMoreThan(350);

/// What he measured for one n: a row for each value that he varied.
type Rows<Row> = (usize, &'static [Row]);

/// All tables, in his order.
pub fn write_all(meter: &mut Meter, page: &mut String) -> Result {
    standard(meter, page)?;
    heuristic(meter, page)?;
    range_of_elements(meter, page)?;
    direct_solution(meter, page)?;
    reduction_of_upper_bound(meter, page)?;
    upper_bound_algorithm(meter, page)?;
    fewer_distances(meter, page)?;
    binary_chopping(meter, page)?;
    sets_of_sub_problems(meter, page)?;
    beyond(meter, page)
}

/// What an enumeration came to.
struct Run {
    /// None if no matching was found.
    cost: Option<u64>,
    lower_bound: u64,
    upper_bound: u64,
    effort: Effort,
    /// What it took until the best matching was found; none if that was the start, or is not
    /// counted.
    to_best: Option<f64>,
    /// In millions of instructions, or in steps of the search where those cannot be counted.
    price: f64,
    is_counted: bool,
}

fn run(meter: &mut Meter, problem: &Problem, options: Options) -> Run {
    run_with_laps(meter, problem, options, false)
}

fn run_with_laps(meter: &mut Meter, problem: &Problem, options: Options, laps: bool) -> Run {
    let mut memory = vec![0; 4096];
    let distances = problem.distances();
    let measured = meter.measure(laps, |found| {
        let scratch = Scratch::new(&mut memory);
        optimum(distances, options, scratch, &mut NeverCancel, found).ok()
    });
    let best = measured.result;
    let effort = best.map(|best| best.effort).unwrap_or_default();
    let steps = effort.sets + effort.sub_problems + effort.nodes;
    Run {
        cost: best.map(|best| best.cost),
        lower_bound: best.map_or(0, |best| best.lower_bounds.improved),
        upper_bound: best.map_or(0, |best| best.upper_bound),
        effort,
        to_best: measured.laps.last().and_then(|lap| lap.1).map(millions),
        price: measured.instructions.map_or(steps as f64, millions),
        is_counted: measured.instructions.is_some(),
    }
}

fn millions(instructions: u64) -> f64 {
    instructions as f64 / 1e6
}

/// The same run of every instance.
struct Runs(Vec<Run>);

impl Runs {
    fn new(mut each: impl FnMut(u32) -> Run) -> Self {
        Self((0..INSTANCES).map(&mut each).collect())
    }

    /// Of matrices with distances from 0 to 99.
    fn of_matrices(meter: &mut Meter, count: usize, options: Options) -> Self {
        Self::new(|instance| run(meter, &Problem::of_matrix(instance, count, 0, 100), options))
    }

    fn counts(&self, count: impl Fn(&Run) -> u64) -> Sample {
        Sample::of_counts(self.0.iter().map(count))
    }

    fn price(&self) -> Sample {
        let decimals = if self.0.iter().any(|run| run.is_counted) { 3 } else { 0 };
        Sample::new(self.0.iter().map(|run| run.price), decimals)
    }

    fn to_best(&self) -> Sample {
        Sample::new(self.0.iter().filter_map(|run| run.to_best), 3)
    }

    fn examined(&self) -> Sample {
        self.counts(|run| run.effort.examined)
    }

    fn sub_problems(&self) -> Sample {
        self.counts(|run| run.effort.sub_problems)
    }
}

fn standard(meter: &mut Meter, page: &mut String) -> Result {
    // n, subsets checked, subsets, seconds, bounds, optimum; seconds to the optimum (7.2.2).
    const HIS: [(usize, u32, u32, f64, [u32; 3], f64); 8] = [
        (4, 0, 2, 0.01, [52, 52, 52], 0.0),
        (6, 0, 6, 0.01, [56, 56, 56], 0.0),
        (8, 0, 20, 0.01, [62, 62, 62], 0.0),
        (10, 0, 70, 0.01, [87, 87, 87], 0.0),
        (12, 0, 252, 0.01, [102, 102, 102], 0.0),
        (14, 35, 924, 46.3, [84, 109, 95], 7.0),
        (16, 374, 3432, 371.0, [82, 115, 98], 93.0),
        (18, 305, 12870, 1162.0, [78, 109, 86], 277.0),
    ];
    let mut table = Table::new(&[
        "n",
        "checked",
        "of",
        "MI",
        "to optimum",
        "lower",
        "upper",
        "optimum",
        "his checked",
        "of",
        "s",
        "to optimum",
        "bounds",
        "optimum",
    ]);
    for (count, checked, subsets, seconds, [lower, upper, least], to_optimum) in HIS {
        let ours = Runs::new(|instance| {
            let problem = Problem::of_matrix(instance, count, 0, 100);
            run_with_laps(meter, &problem, Options::STANDARD, true)
        });
        table.row(&[
            &count,
            &ours.examined(),
            &ours.sub_problems(),
            &ours.price(),
            &ours.to_best(),
            &ours.counts(|run| run.lower_bound),
            &ours.counts(|run| run.upper_bound),
            &ours.counts(|run| run.cost.unwrap_or_default()),
            &checked,
            &subsets,
            &seconds,
            &to_optimum,
            &format!("{lower}-{upper}"),
            &least,
        ]);
    }
    writeln!(
        page,
        "7.2 The standard algorithm. (He goes through the subsets whose lower ends have no higher\n\
         ends too; his table has 16 for the 20 of n = 8. \"To optimum\" is over the instances in\n\
         which the upper bound was not yet the optimum.)\n\n{table}"
    )
}

fn heuristic(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(usize, f64, Option<[u32; 2]>); 23] = [
        (4, 0.013, Some([52, 52])),
        (6, 0.032, Some([56, 56])),
        (8, 0.051, Some([62, 62])),
        (10, 0.077, Some([98, 87])),
        (12, 0.093, Some([123, 102])),
        (14, 0.128, Some([123, 95])),
        (16, 0.171, Some([141, 98])),
        (18, 0.192, Some([152, 86])),
        (20, 0.234, None),
        (24, 0.347, None),
        (28, 0.396, None),
        (32, 0.524, None),
        (36, 0.686, None),
        (40, 0.893, None),
        (80, 2.90, None),
        (120, 6.56, None),
        (160, 11.57, None),
        (200, 17.49, None),
        (240, 23.83, None),
        (280, 32.33, None),
        (320, 43.93, None),
        (360, 56.82, None),
        (400, 66.58, None),
    ];
    let percent = |cost: u64, least: u64| 100.0 * (cost as f64 / least as f64 - 1.0);
    let mut table = Table::new(&["n", "MI", "over optimum %", "s", "his over optimum %"]);
    for (count, seconds, his) in HIS {
        let (mut prices, mut over) = (Vec::new(), Vec::new());
        for instance in 0..INSTANCES {
            let problem = Problem::of_matrix(instance, count, 0, 100);
            let ours = meter.measure(false, |_| problem.cost_by_regret());
            prices.extend(ours.instructions.map(millions));
            // Where he has it, too.
            if his.is_some() {
                over.push(percent(ours.result, least_cost(&problem)));
            }
        }
        let his = his.map(|[cost, least]| percent(cost.into(), least.into()));
        table.row(&[
            &count,
            &Sample::new(prices.into_iter(), 3),
            &Sample::new(over.into_iter(), 1),
            &seconds,
            &his.map_or_else(|| "-".into(), |his| format!("{his:.1}")),
        ]);
    }
    writeln!(
        page,
        "7.3 The heuristic alone, without exchanges: the pairs chosen by regret \
         (5.10.1).\n\n{table}"
    )
}

/// What the best matching costs. Not measured.
fn least_cost(problem: &Problem) -> u64 {
    let mut memory = vec![0; 4096];
    let scratch = Scratch::new(&mut memory);
    let best =
        optimum(problem.distances(), Options::default(), scratch, &mut NeverCancel, &mut |_| {});
    best.map(|best| best.cost).expect("an optimum")
}

fn range_of_elements(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(usize, [f64; 5]); 3] = [
        (10, [4.21, 3.77, 3.43, 2.05, 2.0]),
        (12, [22.34, 18.8, 12.94, 9.32, 10.0]),
        (14, [212.9, 218.2, 144.2, 96.2, 73.2]),
    ];
    let mut table = Table::new(&["n", "range", "checked", "MI", "s"]);
    for (count, seconds) in HIS {
        for (range, seconds) in (20..=100).step_by(20).zip(seconds) {
            let options = Options { start: HIGH, ..Options::STANDARD };
            let ours = Runs::new(|instance| {
                run(meter, &Problem::of_matrix(instance, count, 20, range), options)
            });
            table.row(&[&count, &range, &ours.examined(), &ours.price(), &seconds]);
        }
    }
    writeln!(
        page,
        "7.4 The range of the elements, the least 20. (No upper bound, so that all n \
         enumerate.)\n\n{table}"
    )
}

fn direct_solution(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(usize, [f64; 2], [u32; 2]); 5] = [
        (10, [0.91, 0.59], [8, 3]),
        (12, [2.77, 1.18], [10, 2]),
        (14, [55.3, 37.4], [12, 5]),
        (16, [380.0, 195.0], [14, 5]),
        (18, [1280.0, 752.0], [37, 3]),
    ];
    let mut table = Table::new(&[
        "n",
        "standard MI",
        "direct MI",
        "iterations",
        "direct",
        "standard s",
        "direct s",
        "his iterations",
        "direct",
    ]);
    for (count, seconds, iterations) in HIS {
        let options = Options { start: HIGH, ..Options::STANDARD };
        let standard = Runs::of_matrices(meter, count, options);
        let assignment = Options { sub_problem: SubProblem::Assignment, ..options };
        let direct = Runs::of_matrices(meter, count, assignment);
        let improvements = |run: &Run| run.effort.improvements.into();
        table.row(&[
            &count,
            &standard.price(),
            &direct.price(),
            &standard.counts(improvements),
            &direct.counts(improvements),
            &seconds[0],
            &seconds[1],
            &iterations[0],
            &iterations[1],
        ]);
    }
    writeln!(page, "7.5 Direct solution of the sub-problems, from a high upper bound.\n\n{table}")
}

fn reduction_of_upper_bound(meter: &mut Meter, page: &mut String) -> Result {
    const OPTIMA: [u64; 4] = [87, 102, 95, 98];
    const HIS: [Rows<(u64, f64)>; 4] = [
        (
            10,
            &[
                (125, 0.862),
                (120, 0.847),
                (115, 0.844),
                (110, 0.843),
                (105, 0.837),
                (100, 0.689),
                (95, 0.447),
                (90, 0.324),
            ],
        ),
        (12, &[(125, 2.61), (120, 2.6), (115, 2.11), (110, 1.52), (105, 0.96)]),
        (14, &[(125, 53.6), (120, 53.3), (115, 52.5), (110, 48.5), (105, 44.4), (100, 44.3)]),
        (16, &[(125, 391.0), (120, 382.0), (115, 371.0), (110, 340.0), (105, 317.0), (100, 315.0)]),
    ];
    let mut table = Table::new(&["n", "above optimum", "checked", "MI", "s"]);
    for ((count, rows), his_optimum) in HIS.into_iter().zip(OPTIMA) {
        for &(upper_bound, seconds) in rows {
            let above = upper_bound - his_optimum;
            let ours = Runs::new(|instance| {
                let problem = Problem::of_matrix(instance, count, 0, 100);
                let start = Start::NoMoreThan(least_cost(&problem) + above);
                run(meter, &problem, Options { start, ..Options::STANDARD })
            });
            table.row(&[&count, &above, &ours.examined(), &ours.price(), &seconds]);
        }
    }
    writeln!(
        page,
        "7.6 Reduction of the upper bound, by how much it is above the optimum.\n\n{table}"
    )
}

fn upper_bound_algorithm(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(usize, u32, u32, f64); 14] = [
        (4, 52, 52, 0.02),
        (6, 56, 56, 0.05),
        (8, 62, 62, 0.10),
        (10, 87, 87, 0.18),
        (12, 102, 102, 0.37),
        (14, 84, 109, 1.38),
        (16, 82, 115, 2.09),
        (18, 78, 109, 3.06),
        (20, 84, 98, 3.62),
        (22, 93, 108, 5.55),
        (24, 100, 141, 19.0),
        (26, 94, 126, 49.0),
        (28, 93, 134, 174.0),
        (30, 101, 148, 423.0),
    ];
    let mut table = Table::new(&["n", "lower", "upper", "MI", "his lower", "upper", "s"]);
    for (count, lower, upper, seconds) in HIS {
        let (mut bounds, mut prices) = (Vec::new(), Vec::new());
        for instance in 0..INSTANCES {
            let problem = Problem::of_matrix(instance, count, 0, 100);
            let mut memory = vec![0; 4096];
            let mut scratch = Scratch::new(&mut memory);
            let ours = meter.measure(false, |_| {
                let (costs, bounds) = solve_image_problem(problem.distances(), &mut scratch)?;
                let pairs = domino_matching(&costs, &mut scratch, &mut NeverCancel)?;
                let upper = problem.distances().cost(pairs);
                Ok::<_, penup_host_tests::enumeration::EnumerationError>([bounds.improved, upper])
            });
            bounds.push(ours.result.expect("memory"));
            prices.extend(ours.instructions.map(millions));
        }
        let [ours_below, ours_above] =
            [0, 1].map(|side: usize| Sample::of_counts(bounds.iter().map(|bound| bound[side])));
        let price = Sample::new(prices.into_iter(), 3);
        table.row(&[&count, &ours_below, &ours_above, &price, &lower, &upper, &seconds]);
    }
    writeln!(page, "7.7 Both bounds. (His seconds of the upper bound alone.)\n\n{table}")
}

fn fewer_distances(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [Rows<(usize, f64, f64)>; 4] = [
        (10, &[(45, 0.91, 1.94), (38, 0.76, 1.92), (29, 0.64, 1.86), (19, 0.36, 1.71)]),
        (12, &[(66, 2.77, 7.88), (56, 2.45, 7.80), (39, 1.60, 7.57), (25, 0.93, 7.35)]),
        (14, &[(91, 55.29, 34.12), (74, 51.31, 34.09), (54, 45.03, 34.03), (34, 37.25, 33.98)]),
        (16, &[(120, 380.0, 163.0), (98, 341.0, 162.0), (71, 274.0, 160.0), (47, 206.0, 157.0)]),
    ];
    let mut table =
        Table::new(&["n", "distances", "optimum kept, of 20", "MI", "sorted MI", "s", "sorted s"]);
    for (count, rows) in HIS {
        for &(wanted, seconds, seconds_sorted) in rows {
            let mut of = |sorted: bool| {
                Runs::new(|instance| {
                    let problem = Problem::of_matrix(instance, count, 0, 100);
                    let reach = Reach::NoLongerThan(problem.shortest(wanted));
                    let options = Options { start: HIGH, reach, sorted, ..Options::STANDARD };
                    run(meter, &problem, options)
                })
            };
            let (ours, sorted) = (of(false), of(true));
            let kept = (0..INSTANCES).zip(&ours.0).filter(|(instance, run)| {
                run.cost == Some(least_cost(&Problem::of_matrix(*instance, count, 0, 100)))
            });
            table.row(&[
                &count,
                &wanted,
                &kept.count(),
                &ours.price(),
                &sorted.price(),
                &seconds,
                &seconds_sorted,
            ]);
        }
    }
    writeln!(
        page,
        "7.8 Fewer distances (the shortest, and those as long as the longest of them), as they \
         come and\n\
         sorted, from a high upper bound.\n\n{table}"
    )
}

fn binary_chopping(meter: &mut Meter, page: &mut String) -> Result {
    // n; solutions found, seconds to the last of them, all seconds: standard, chopping.
    const HIS: [Rows<(u32, f64, f64)>; 2] = [
        (14, &[(13, 17.91, 58.0), (4, 6.51, 44.0)]),
        (16, &[(15, 100.46, 371.0), (4, 28.83, 256.0)]),
    ];
    let mut table = Table::new(&[
        "n",
        "target",
        "solutions",
        "MI to the last",
        "all MI",
        "optimum found, of 20",
        "his solutions",
        "s to the last",
        "all s",
    ]);
    for (count, rows) in HIS {
        let standard = Options { start: HIGH, ..Options::STANDARD };
        for (name, target, his) in [
            ("better", Target::Better, rows.first()),
            ("chopped", Target::Chopped, rows.get(1)),
            ("chopped, backtracked", Target::ChoppedAndBacktracked, None),
        ] {
            let options = Options { target, ..standard };
            let ours = Runs::new(|instance| {
                let problem = Problem::of_matrix(instance, count, 0, 100);
                run_with_laps(meter, &problem, options, true)
            });
            let optimal = (0..INSTANCES).zip(&ours.0).filter(|(instance, run)| {
                run.cost == Some(least_cost(&Problem::of_matrix(*instance, count, 0, 100)))
            });
            let shown = |value: Option<f64>, otherwise: &str| {
                value.map_or_else(|| otherwise.to_owned(), |value| value.to_string())
            };
            table.row(&[
                &count,
                &name,
                &ours.counts(|run| run.effort.improvements.into()),
                &ours.to_best(),
                &ours.price(),
                &optimal.count(),
                &shown(his.map(|his| his.0.into()), "-"),
                &shown(his.map(|his| his.1), "-"),
                &shown(his.map(|his| his.2), "\"extremely high\""),
            ]);
        }
    }
    writeln!(page, "7.9 Binary chopping, from a high upper bound.\n\n{table}")
}

fn sets_of_sub_problems(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [Rows<f64>; 3] = [
        (12, &[10.5, 10.1, 9.9, 11.2, 10.5]),
        (14, &[60.3, 55.8, 53.5, 53.5, 61.9, 59.8]),
        (16, &[378.0, 383.0, 399.0, 410.0, 427.0, 422.0, 391.0]),
    ];
    let mut table = Table::new(&["n", "sgd", "sub-problems", "MI", "s"]);
    for (count, rows) in HIS {
        for (depth, seconds) in (2..).zip(rows) {
            let options = Options { start: HIGH, sets: Sets::AtDepth(depth), ..Options::STANDARD };
            let ours = Runs::of_matrices(meter, count, options);
            table.row(&[&count, &depth, &ours.sub_problems(), &ours.price(), &seconds]);
        }
        let options = Options { start: HIGH, sets: Sets::FromDepth(1), ..Options::STANDARD };
        let ours = Runs::of_matrices(meter, count, options);
        table.row(&[&count, &"all", &ours.sub_problems(), &ours.price(), &"-"]);
    }
    writeln!(
        page,
        "7.10 Sets of sub-problems. (Higher ends already chosen count in our bound, not in his; \
         he\n\
         left out the bound at every depth as too much work.)\n\n{table}"
    )
}

fn beyond(meter: &mut Meter, page: &mut String) -> Result {
    let mut table = Table::new(&["n", "matrix MI", "sub-problems", "points MI", "sub-problems"]);
    for count in (14..=22).step_by(2) {
        let matrix = Runs::of_matrices(meter, count, Options::default());
        let points = Runs::new(|instance| {
            run(meter, &Problem::of_points(instance, count), Options::default())
        });
        table.row(&[
            &count,
            &matrix.price(),
            &matrix.sub_problems(),
            &points.price(),
            &points.sub_problems(),
        ]);
    }
    writeln!(
        page,
        "All variants together (a bound at every depth, direct solution, distances that can be of\n\
         use), to the proved optimum.\n\n{table}"
    )
}
