//! The tables of chapter 7, section by section, with what Harrison found.

use crate::meter::Meter;
use crate::problems::{Problem, Star};
use crate::table::Table;
use penup::order::enumeration::{
    Effort, Options, Reach, Sets, Start, SubProblem, Target, domino_matching, optimum,
    solve_image_problem,
};
use penup::stage::{Scratch, Undisturbed};
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
    laps: Vec<(u64, Option<u64>)>,
    price: String,
}

fn run(meter: &mut Meter, problem: &Problem, options: Options) -> Run {
    let mut memory = vec![0; 4096];
    let distances = problem.distances();
    let measured = meter.measure(|found| {
        let scratch = Scratch::new(&mut memory);
        optimum(distances, options, scratch, &mut Undisturbed, found).ok()
    });
    let best = measured.result;
    let effort = best.map(|best| best.effort).unwrap_or_default();
    let steps = effort.sets + effort.sub_problems + effort.nodes;
    Run {
        cost: best.map(|best| best.cost),
        lower_bound: best.map_or(0, |best| best.lower_bounds.improved),
        upper_bound: best.map_or(0, |best| best.upper_bound),
        effort,
        laps: measured.laps,
        price: measured.instructions.map_or_else(|| format!("{steps} steps"), millions),
    }
}

fn millions(instructions: u64) -> String {
    format!("{:.3}", instructions as f64 / 1e6)
}

fn counted(instructions: Option<u64>) -> String {
    instructions.map_or_else(|| "-".into(), millions)
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
        "bounds",
        "optimum",
        "his checked",
        "of",
        "s",
        "to optimum",
        "bounds",
        "optimum",
    ]);
    for (count, checked, subsets, seconds, [lower, upper, least], to_optimum) in HIS {
        let ours = run(meter, &Problem::of_matrix(count, 0, 100), Options::STANDARD);
        let last = ours.laps.last().and_then(|lap| lap.1);
        table.row(&[
            &count,
            &ours.effort.examined,
            &ours.effort.sub_problems,
            &ours.price,
            &counted(last),
            &format!("{}-{}", ours.lower_bound, ours.upper_bound),
            &ours.cost.unwrap_or_default(),
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
         ends too; his table has 16 for the 20 of n = 8.)\n\n{table}"
    )
}

fn heuristic(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(u16, f64, Option<[u32; 2]>); 23] = [
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
    let mut table = Table::new(&["n", "MI", "over optimum %", "s", "his over optimum %"]);
    for (count, seconds, his) in HIS {
        let mut star = Star::new(count);
        let ours = meter.measure(|_| star.order());
        let percent =
            |cost: u64, least: u64| format!("{:.1}", 100.0 * (cost as f64 / least as f64 - 1.0));
        // Not measured here: only the check of the heuristic.
        let over = (count <= 36).then(|| {
            let problem = Problem::of_points(usize::from(count));
            let mut memory = vec![0; 4096];
            let scratch = Scratch::new(&mut memory);
            let options = Options::default();
            optimum(problem.distances(), options, scratch, &mut Undisturbed, &mut |_| {})
                .map(|best| percent(ours.result.pen_up, best.cost))
                .expect("an optimum")
        });
        let his = his.map(|[cost, least]| percent(u64::from(cost), u64::from(least)));
        table.row(&[
            &count,
            &counted(ours.instructions),
            &over.unwrap_or_default(),
            &seconds,
            &his.unwrap_or_default(),
        ]);
    }
    writeln!(
        page,
        "7.3 The heuristic, and the tour. (Ours of points on a page, as it takes no matrix.)\n\n{table}"
    )
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
            let ours = run(meter, &Problem::of_matrix(count, 20, range), options);
            table.row(&[&count, &range, &ours.effort.examined, &ours.price, &seconds]);
        }
    }
    writeln!(
        page,
        "7.4 The range of the elements, the least 20. (No upper bound, so that all n enumerate.)\n\n{table}"
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
        let problem = Problem::of_matrix(count, 0, 100);
        let options = Options { start: HIGH, ..Options::STANDARD };
        let standard = run(meter, &problem, options);
        let assignment = Options { sub_problem: SubProblem::Assignment, ..options };
        let direct = run(meter, &problem, assignment);
        table.row(&[
            &count,
            &standard.price,
            &direct.price,
            &standard.effort.improvements,
            &direct.effort.improvements,
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
        let problem = Problem::of_matrix(count, 0, 100);
        let least = run(meter, &problem, Options::default()).cost.unwrap_or_default();
        for &(upper_bound, seconds) in rows {
            let above = upper_bound - his_optimum;
            let start = Start::NoMoreThan(least + above);
            let ours = run(meter, &problem, Options { start, ..Options::STANDARD });
            table.row(&[&count, &above, &ours.effort.examined, &ours.price, &seconds]);
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
        let problem = Problem::of_matrix(count, 0, 100);
        let mut memory = vec![0; 4096];
        let mut scratch = Scratch::new(&mut memory);
        let ours = meter.measure(|_| {
            let (costs, bounds) = solve_image_problem(problem.distances(), &mut scratch)?;
            let pairs = domino_matching(&costs, &mut scratch, &mut Undisturbed)?;
            Ok::<_, penup::order::enumeration::EnumerationError>((
                bounds.improved,
                problem.distances().cost(pairs),
            ))
        });
        let (our_lower, our_upper) = ours.result.expect("memory");
        let price = counted(ours.instructions);
        table.row(&[&count, &our_lower, &our_upper, &price, &lower, &upper, &seconds]);
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
    let mut table = Table::new(&[
        "n",
        "distances",
        "cost",
        "MI",
        "sorted MI",
        "his distances",
        "s",
        "sorted s",
    ]);
    for (count, rows) in HIS {
        let problem = Problem::of_matrix(count, 0, 100);
        for &(wanted, seconds, seconds_sorted) in rows {
            let (longest, kept) = problem.shortest(wanted);
            let reach = Reach::NoLongerThan(longest);
            let options = Options { start: HIGH, reach, ..Options::STANDARD };
            let ours = run(meter, &problem, options);
            let sorted = run(meter, &problem, Options { sorted: true, ..options });
            let cost = ours.cost.map_or_else(|| "none".into(), |cost| cost.to_string());
            table.row(&[
                &count,
                &kept,
                &cost,
                &ours.price,
                &sorted.price,
                &wanted,
                &seconds,
                &seconds_sorted,
            ]);
        }
    }
    writeln!(
        page,
        "7.8 Fewer distances, as they come and sorted, from a high upper bound.\n\n{table}"
    )
}

fn binary_chopping(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [(usize, &str, &str); 2] = [
        (
            14,
            "349 at 0, 229 at 0.06, 178 at 0.16, 167 at 0.29, 162 at 0.44, 151 at 0.61, 143 at 0.74, \
             141 at 4.36, 130 at 4.73, 126 at 4.84, 113 at 6.74, 96 at 16.91, 95 at 17.91; all 58",
            "349 at 0, 178 at 0.06, 130 at 1.85, 96 at 6.51; all 44",
        ),
        (
            16,
            "357 at 0, 337 at 0.08, 324 at 0.21, 231 at 0.32, 230 at 0.49, 226 at 0.54, 179 at 0.79, \
             146 at 0.94, 127 at 1.25, 122 at 1.97, 118 at 8.18, 115 at 8.34, 114 at 22.53, \
             105 at 87.18, 98 at 100.46; all 371",
            "357 at 0, 179 at 0.2, 127 at 0.46, 105 at 28.83; all 256",
        ),
    ];
    writeln!(page, "7.9 Binary chopping: each solution and what it took, in MI and in s.\n")?;
    for (count, his_standard, his_chopping) in HIS {
        let problem = Problem::of_matrix(count, 0, 100);
        let standard = Options { start: HIGH, ..Options::STANDARD };
        let chopping = Options { target: Target::Chopped, ..standard };
        for (name, options, his) in
            [("standard", standard, his_standard), ("chopping", chopping, his_chopping)]
        {
            let ours = run(meter, &problem, options);
            let laps: Vec<String> = ours
                .laps
                .iter()
                .map(|&(cost, instructions)| format!("{cost} at {}", counted(instructions)))
                .collect();
            writeln!(page, "- n = {count}, {name}: {}; all {}", laps.join(", "), ours.price)?;
            writeln!(page, "  - his: {his}")?;
        }
        let target = Target::ChoppedAndBacktracked;
        let ours = run(meter, &problem, Options { target, ..standard });
        let cost = ours.cost.unwrap_or_default();
        writeln!(page, "- n = {count}, with backtracking: {cost}, proved; all {}", ours.price)?;
        writeln!(page, "  - his: \"extremely high\"")?;
    }
    writeln!(page)
}

fn sets_of_sub_problems(meter: &mut Meter, page: &mut String) -> Result {
    const HIS: [Rows<f64>; 3] = [
        (12, &[10.5, 10.1, 9.9, 11.2, 10.5]),
        (14, &[60.3, 55.8, 53.5, 53.5, 61.9, 59.8]),
        (16, &[378.0, 383.0, 399.0, 410.0, 427.0, 422.0, 391.0]),
    ];
    let mut table = Table::new(&["n", "sgd", "sub-problems", "MI", "s"]);
    for (count, rows) in HIS {
        let problem = Problem::of_matrix(count, 0, 100);
        for (depth, seconds) in (2..).zip(rows) {
            let options = Options { start: HIGH, sets: Sets::AtDepth(depth), ..Options::STANDARD };
            let ours = run(meter, &problem, options);
            table.row(&[&count, &depth, &ours.effort.sub_problems, &ours.price, &seconds]);
        }
        let options = Options { start: HIGH, sets: Sets::FromDepth(1), ..Options::STANDARD };
        let ours = run(meter, &problem, options);
        table.row(&[&count, &"all", &ours.effort.sub_problems, &ours.price, &"-"]);
    }
    writeln!(
        page,
        "7.10 Sets of sub-problems. (Higher ends already chosen count in our bound, not in his; he\n\
         left out the bound at every depth as too much work.)\n\n{table}"
    )
}

fn beyond(meter: &mut Meter, page: &mut String) -> Result {
    let mut table = Table::new(&["n", "matrix MI", "sub-problems", "points MI", "sub-problems"]);
    for count in (14..=36).step_by(2) {
        let matrix = run(meter, &Problem::of_matrix(count, 0, 100), Options::default());
        let points = run(meter, &Problem::of_points(count), Options::default());
        table.row(&[
            &count,
            &matrix.price,
            &matrix.effort.sub_problems,
            &points.price,
            &points.effort.sub_problems,
        ]);
    }
    writeln!(
        page,
        "All variants together (a bound at every depth, direct solution, distances that can be of\n\
         use), to the proved optimum.\n\n{table}"
    )
}
