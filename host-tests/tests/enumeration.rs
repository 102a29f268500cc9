//! Tests of the implicit enumeration against all possible matchings.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup_host_tests::enumeration::{
    Distances, Division, Effort, EnumerationError, ImplicitCosts, Optimum, Options, Reach, Sets,
    Start, SubProblem, Target, division_bound, optimum, solve_image_problem,
};
use penup_host_tests::random::Random;
use proptest::prelude::*;

/// The cost of the best matching, computed from the best one for every subset of the points.
fn least_cost(distances: Distances<'_>) -> u64 {
    let count = distances.count();
    let mut least = vec![u64::MAX; 1 << count];
    least[0] = 0;
    for paired in 0..(1usize << count) - 1 {
        if least[paired] == u64::MAX {
            continue;
        }
        let first = (!paired).trailing_zeros() as usize;
        for other in (first + 1..count).filter(|other| paired >> other & 1 == 0) {
            let next = paired | 1 << first | 1 << other;
            let cost = least[paired] + u64::from(distances.get(first, other));
            least[next] = least[next].min(cost);
        }
    }
    least[(1 << count) - 1]
}

/// Every matching of `count` points.
fn all_matchings(count: usize) -> Vec<Vec<[u8; 2]>> {
    fn extend(free: u64, pairs: &mut Vec<[u8; 2]>, all: &mut Vec<Vec<[u8; 2]>>) {
        if free == 0 {
            all.push(pairs.clone());
            return;
        }
        let first = free.trailing_zeros() as u8;
        for other in (first + 1..64).filter(|&other| free >> other & 1 != 0) {
            pairs.push([first, other]);
            extend(free & !(1 << first) & !(1 << other), pairs, all);
            pairs.pop();
        }
    }
    let mut all = Vec::new();
    extend((1 << count) - 1, &mut Vec::new(), &mut all);
    all
}

fn is_in(division: Division, pairs: &[[u8; 2]]) -> bool {
    pairs.iter().all(|&[a, b]| division.q >> a & 1 == 0 && division.p >> b & 1 == 0)
}

/// Random problems with an even number of points up to `most`, and distances with few or many
/// different values.
fn problem(most: usize) -> impl Strategy<Value = (usize, Vec<u32>)> {
    let range = prop_oneof![Just(2u32), Just(5), Just(100), Just(1 << 20), Just(u32::MAX)];
    (0..=most / 2, range).prop_flat_map(|(half, range)| {
        let count = 2 * half;
        let length = count * count.saturating_sub(1) / 2;
        (Just(count), prop::collection::vec(0..=range, length))
    })
}

fn any_options() -> impl Strategy<Value = Options> {
    let reach = prop_oneof![Just(Reach::All), Just(Reach::Useful)];
    let sub_problem = prop_oneof![Just(SubProblem::Pairings), Just(SubProblem::Assignment)];
    let sets = prop_oneof![
        Just(Sets::None),
        (0..9u8).prop_map(Sets::AtDepth),
        (0..9u8).prop_map(Sets::FromDepth)
    ];
    let target = prop_oneof![Just(Target::Better), Just(Target::ChoppedAndBacktracked)];
    (reach, any::<bool>(), sub_problem, sets, target).prop_map(
        |(reach, sorted, sub_problem, sets, target)| Options {
            start: Start::DominoGraph,
            reach,
            sorted,
            sub_problem,
            sets,
            target,
        },
    )
}

fn solve<'a>(
    distances: Distances<'a>,
    options: Options,
    memory: &'a mut [u64],
) -> Result<Optimum<'a>, EnumerationError> {
    optimum(distances, options, Scratch::new(memory), &mut NeverCancel, &mut |_| {})
}

fn assert_matching(distances: Distances<'_>, best: &Optimum<'_>) {
    let mut points: Vec<u8> = best.pairs.concat();
    assert!(best.pairs.iter().all(|[a, b]| a < b));
    points.sort_unstable();
    assert!(points.iter().copied().eq(0..distances.count() as u8), "each point once");
    assert_eq!(distances.cost(best.pairs), best.cost);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn every_variant_finds_the_least_cost(
        (count, below) in problem(12),
        options in any_options(),
    ) {
        let distances = Distances::new(count, &below).expect("a problem");
        let mut memory = vec![0; 1000];
        let best = solve(distances, options, &mut memory).expect("an optimum");
        assert_matching(distances, &best);
        prop_assert_eq!(best.cost, least_cost(distances));
        prop_assert!(best.is_proved());
        let bounds = best.lower_bounds;
        prop_assert!(bounds.rarest_minimum.max(bounds.largest_minimum) <= bounds.improved);
        prop_assert!(bounds.improved <= best.cost && best.cost <= best.upper_bound);
    }

    #[test]
    fn a_given_cost_is_reached_or_refused(
        (count, below) in problem(10),
        options in any_options(),
        spare in 0..20u64,
    ) {
        let distances = Distances::new(count, &below).expect("a problem");
        let least = least_cost(distances);
        let mut memory = vec![0; 1000];
        let enough = Options { start: Start::NoMoreThan(least + spare), ..options };
        let best = solve(distances, enough, &mut memory).expect("an optimum");
        assert_matching(distances, &best);
        prop_assert_eq!((best.cost, best.proved), (least, least));
        if least > 0 {
            let too_little = Options { start: Start::NoMoreThan(least - 1), ..options };
            let refused = solve(distances, too_little, &mut memory);
            prop_assert_eq!(refused, Err(EnumerationError::NoneSoCheap));
        }
    }

    #[test]
    fn what_may_miss_the_optimum_says_so(
        (count, below) in problem(10),
        options in any_options(),
        reach in prop_oneof![Just(Reach::All), Just(Reach::NoLongerThanStart)],
        chopped in any::<bool>(),
    ) {
        let distances = Distances::new(count, &below).expect("a problem");
        let least = least_cost(distances);
        let target = if chopped { Target::Chopped } else { options.target };
        let mut memory = vec![0; 1000];
        let options = Options { reach, target, ..options };
        let best = solve(distances, options, &mut memory).expect("a matching");
        assert_matching(distances, &best);
        prop_assert!(best.proved <= least && least <= best.cost);
        prop_assert!(best.cost <= best.upper_bound);
    }

    #[test]
    fn implicit_costs_never_exceed_a_distance_and_improve((count, below) in problem(24)) {
        let distances = Distances::new(count, &below).expect("a problem");
        let mut memory = vec![0; 200];
        let mut scratch = Scratch::new(&mut memory);
        let methods = [ImplicitCosts::by_rarest_minimum, ImplicitCosts::by_largest_minimum];
        for method in methods {
            let mut costs = method(distances, &mut scratch).expect("memory");
            let before = costs.sum_in_halves();
            prop_assert!((0..count).all(|point| costs.image_graph_at(point) != 0));
            costs.improve();
            prop_assert!(costs.sum_in_halves() >= before);
            for a in 0..count {
                prop_assert!((0..a).all(|b| costs.reduced(a, b) >= 0));
                prop_assert!(costs.image_graph_at(a) != 0, "no point left alone");
            }
        }
    }

    #[test]
    fn a_division_costs_no_less_than_its_bound(
        (count, below) in problem(8),
        word in any::<u64>(),
        decided in 0..=8usize,
        improved in any::<bool>(),
    ) {
        let distances = Distances::new(count, &below).expect("a problem");
        let decided = (1u64 << decided.min(count)) - 1;
        let division = Division { p: word & decided, q: !word & decided };
        let mut memory = vec![0; 1000];
        let mut scratch = Scratch::new(&mut memory);
        let costs = if improved {
            solve_image_problem(distances, &mut scratch).expect("memory").0
        } else {
            ImplicitCosts::zero(distances, &mut scratch).expect("memory")
        };
        let bound = division_bound(&costs, division, scratch).expect("memory");
        let matchings = all_matchings(count);
        let within = matchings.iter().filter(|pairs| is_in(division, pairs));
        match (bound, within.map(|pairs| distances.cost(pairs)).min()) {
            (Some(bound), Some(least)) => prop_assert!(bound <= least),
            (None, least) => prop_assert_eq!(least, None),
            (Some(_), None) => {}
        }
    }

    #[test]
    fn the_criterion_means_the_only_optimum((count, below) in problem(8)) {
        let distances = Distances::new(count, &below).expect("a problem");
        let mut memory = vec![0; 100];
        let (costs, _) = solve_image_problem(distances, &mut Scratch::new(&mut memory))
            .expect("memory");
        let matchings = all_matchings(count);
        if let Some(pairs) = matchings.iter().find(|pairs| costs.meets_criterion(pairs)) {
            let cost = distances.cost(pairs);
            prop_assert_eq!(costs.lower_bound(), cost);
            let is_least = |other: &_| distances.cost(other) > cost;
            prop_assert!(matchings.iter().all(|other| other == pairs || is_least(other)));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn eighteen_points_as_many_as_harrison_reached(seed in any::<u32>()) {
        let mut random = Random::new(u64::from(seed));
        let below: Vec<u32> =
            std::iter::repeat_with(|| random.below(101) as u32).take(18 * 17 / 2).collect();
        let distances = Distances::new(18, &below).expect("a problem");
        let mut memory = vec![0; 1000];
        let best = solve(distances, Options::default(), &mut memory).expect("an optimum");
        assert_matching(distances, &best);
        prop_assert_eq!((best.cost, best.proved), (least_cost(distances), best.cost));
    }
}

/// Cancels the computation at the `after`th check.
struct GivesUp {
    after: u32,
    looks: u32,
}

impl Cancel for GivesUp {
    fn check(&mut self) -> Result<(), Aborted> {
        self.looks += 1;
        if self.looks > self.after { Err(Aborted) } else { Ok(()) }
    }
}

/// Two clusters with an odd number of points each, far apart: a hard proof.
fn hard() -> Vec<u32> {
    let position = |point: usize| point as u32 * 7919 % 101;
    (0..16).flat_map(|a| (0..a).map(move |b| 50 + (position(a) * position(b)) % 20)).collect()
}

#[test]
fn it_can_be_given_up_at_any_look() {
    let below = hard();
    let distances = Distances::new(16, &below).expect("a problem");
    let mut memory = vec![0; 1000];
    let mut patient = GivesUp { after: u32::MAX, looks: 0 };
    let ends = |cancel: &mut GivesUp, memory: &mut [u64]| {
        let scratch = Scratch::new(memory);
        optimum(distances, Options::STANDARD, scratch, cancel, &mut |_| {}).map(|best| best.cost)
    };
    ends(&mut patient, &mut memory).expect("an optimum");
    assert!(patient.looks > 100);
    for after in [0, 1, patient.looks / 2, patient.looks - 1] {
        let given_up = ends(&mut GivesUp { after, looks: 0 }, &mut memory);
        assert_eq!(given_up, Err(EnumerationError::Aborted));
    }
}

#[test]
fn too_little_memory_is_refused_with_the_figures() {
    let below = hard();
    let distances = Distances::new(16, &below).expect("a problem");
    let enough = (9 * 16 * 16 + 60 * 16) / 8;
    assert!(solve(distances, Options::default(), &mut vec![0; enough]).is_ok());
    for words in (0..200).step_by(10) {
        let refused =
            solve(distances, Options::default(), &mut vec![0; words]).map(|best| best.cost);
        assert!(matches!(refused, Err(EnumerationError::Scratch(_))), "{words} words");
    }
}

#[test]
fn nothing_to_pair_costs_nothing() {
    let distances = Distances::new(0, &[]).expect("no points");
    for start in [Start::DominoGraph, Start::NoMoreThan(5)] {
        let options = Options { start, ..Options::STANDARD };
        let mut memory = [0; 8];
        let best = solve(distances, options, &mut memory).expect("nothing");
        assert_eq!((best.pairs.len(), best.cost, best.is_proved()), (0, 0, true));
    }
}

#[test]
fn sixty_four_points_at_the_longest_distance() {
    let below = vec![u32::MAX; 64 * 63 / 2];
    let distances = Distances::new(64, &below).expect("a problem");
    let mut memory = vec![0; 8000];
    let best = solve(distances, Options::STANDARD, &mut memory).expect("an optimum");
    assert_matching(distances, &best);
    assert_eq!(best.cost, 32 * u64::from(u32::MAX));
    assert_eq!(best.effort, Effort::default(), "the bounds meet");
}

#[test]
fn each_improvement_is_reported_and_the_last_is_the_optimum() {
    let below = hard();
    let distances = Distances::new(16, &below).expect("a problem");
    let mut memory = vec![0; 1000];
    let mut costs = Vec::new();
    let options = Options { start: Start::NoMoreThan(10_000), ..Options::STANDARD };
    let scratch = Scratch::new(&mut memory);
    let best = optimum(distances, options, scratch, &mut NeverCancel, &mut |cost| costs.push(cost))
        .expect("an optimum");
    assert!(costs.is_sorted_by(|one, next| one > next));
    assert_eq!(costs.last(), Some(&best.cost));
    assert_eq!(costs.len(), best.effort.improvements as usize);
}
