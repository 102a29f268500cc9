//! Jobs with random settings and orders, and how near their speed, acceleration and jerk come to
//! the limits. The property tests assert it, and the example `motion_soak` prints the worst.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use crate::event_checker::{self, Ratios, Run};
use crate::motion_optimum::{Limits, squared_limits};
use crate::motion_paths::{STEPS_PER_MM, circle, positions, settings, steps};
use crate::pin_machine;
use crate::random::Random;
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Setting, Settings, State, Target, TargetList, Value};

/// The settings of a plotter.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// The maximum speed with the pen up and down, in mm/s.
    pub speed: f64,
    /// The maximum acceleration, in mm/s².
    pub acceleration: f64,
    /// The maximum jerk, in mm/s³; 0 for no limit.
    pub jerk: f64,
    /// The junction deviation, in mm.
    pub deviation: f64,
}

/// How near a stroke comes to its limits: each as a part of the limit.
#[derive(Debug, Clone, Copy, Default)]
pub struct Nearness {
    /// The acceleration over any 5 ms, or over the time needed to determine it to 4 %.
    pub acceleration: f64,
    /// The jerk.
    pub jerk: f64,
    /// The speed on lines and at corners, less 0.1 mm/s, because at 0.4 mm/s successive times are
    /// one slice apart.
    pub speed: f64,
    /// The line on which, or at the beginning of which, the speed is that near.
    pub line: usize,
}

impl Case {
    /// Settings within the ranges of the property tests. `jerk` is the range of the decimal
    /// logarithm of the jerk in mm/s³.
    pub fn random(random: &mut Random, jerk: [f64; 2]) -> Self {
        Self {
            speed: number(random, 5.0, 120.0),
            acceleration: number(random, 50.0, 5000.0),
            jerk: 10f64.powf(number(random, jerk[0], jerk[1])),
            deviation: number(random, 0.001, 0.5),
        }
    }

    /// The settings of the machine, with bends limited.
    pub fn settings(self) -> Settings {
        let mut settings = settings(self.speed, self.acceleration, self.deviation, true);
        settings.set(Setting::Jerk, Value::from_num(self.jerk / 1000.0)).expect("valid");
        settings
    }

    /// The same for the reference.
    pub fn limits(self) -> Limits {
        Limits {
            speed: self.speed,
            acceleration: self.acceleration,
            junction_deviation: self.deviation,
            centripetal: true,
            beside_bends: false,
            step: 1.0 / STEPS_PER_MM,
        }
    }

    /// Measures the jerk, the acceleration, and the speed at each corner and on each line.
    pub fn measure(self, points: &[PagePoint], run: &Run) -> Nearness {
        let positions = positions(points);
        let acceleration = event_checker::greatest_acceleration(
            &run.times,
            &positions,
            event_checker::acceleration_window(self.acceleration),
        );
        let jerk = match self.jerk {
            0.0 => 0.0,
            limit => event_checker::greatest_jerk(&run.times, &positions, limit) / limit,
        };
        let mut nearness = Nearness {
            acceleration: acceleration / self.acceleration,
            jerk,
            ..Nearness::default()
        };
        let mm: Vec<_> = points
            .iter()
            .map(|p| (f64::from(p.x) / STEPS_PER_MM, f64::from(p.y) / STEPS_PER_MM))
            .collect();
        let (corners, lines) = squared_limits(&mm, self.limits());
        let mut note = |speed: f64, squared_limit: f64, line: usize| {
            let part = (speed - 0.1) / squared_limit.sqrt();
            if part > nearness.speed {
                (nearness.speed, nearness.line) = (part, line);
            }
        };
        // Of each line its first move, and its length.
        let mut first = 0;
        for (line, (ends, &limit)) in points.windows(2).zip(&lines).enumerate() {
            let (dx, dy) = (ends[1].x - ends[0].x, ends[1].y - ends[0].y);
            let after = first + dx.abs().max(dy.abs()) as usize;
            let speed = |index: usize| {
                (positions[index] - positions[index - 1])
                    / (run.times[index] - run.times[index - 1])
            };
            for index in first + 1..after {
                note(speed(index), limit, line);
            }
            if line > 0 {
                // The corner is passed between the last move of one line and the first of the next.
                let distance = positions[first] - positions[first - 1];
                note(speed(first), corners[line] + self.acceleration * 2.0 * distance, line);
            }
            first = after;
        }
        nearness
    }

    /// Checks the jerk, the acceleration, and the speed at each corner and on each line.
    ///
    /// # Panics
    /// Panics if the acceleration exceeds 1.05 times its limit, the jerk 1.1 times, or a speed 1.03
    /// times and 0.1 mm/s.
    pub fn check(self, name: &str, points: &[PagePoint], run: &Run) {
        let nearness = self.measure(points, run);
        assert!(nearness.acceleration <= 1.05, "{name} {self:?}: {nearness:?}");
        assert!(nearness.jerk <= 1.1, "{name} {self:?}: {nearness:?}");
        assert!(nearness.speed <= 1.03, "{name} {self:?}: {nearness:?}");
    }
}

/// Strokes with corners, a curve and dashes, and pen-up moves.
pub fn job() -> Vec<Target> {
    let line = |points: Vec<(f64, f64)>, ink: LineType| {
        let points = steps(&points);
        points
            .into_iter()
            .enumerate()
            .map(move |(index, point)| Target { point, ink: (index > 0).then_some(ink) })
    };
    line(vec![(2.0, 3.0), (14.0, 3.0), (14.0, 9.0), (3.0, 10.5)], LineType::Full)
        .chain(line(circle(2.0, 80), LineType::Full))
        .chain(line(vec![(20.0, 2.0), (31.0, 7.0)], LineType::Dashed))
        .collect()
}

/// What a user does while the [`job`] is drawn, and how late the main loop is.
#[derive(Debug, Clone)]
pub struct Orders {
    /// When (in ticks), which (0: an override, 1: 100 %, 2: a hold, from which the machine goes on
    /// as soon as it stands), and the percent.
    pub orders: Vec<(u64, u8, u8)>,
    /// Whether the job is aborted with the last order.
    pub aborts: bool,
    /// The time of one turn of the main loop, in ticks.
    pub turn_ticks: u64,
    /// The feeds of the lines in turn, in mm/min, if lines are sent one by one. Otherwise the job
    /// is stored, and has none.
    pub feeds: Vec<u16>,
}

impl Orders {
    /// Draws the [`job`] and measures it at the pins.
    ///
    /// # Panics
    /// Panics if the pins break a rule, if the pen does not end raised, or if the job is not drawn
    /// to its end although nobody aborted it.
    pub fn measure(&self, case: Case) -> Ratios {
        let settings = case.settings();
        let targets = job();
        let is_stored = self.feeds.is_empty();
        let mut path = TargetList::new(if is_stored { &targets } else { &[] });
        let mut started = false;
        let mut unsent = targets.iter().zip(self.feeds.iter().cycle()).peekable();
        let mut orders = self.orders.clone();
        orders.sort_unstable();
        let last = orders.last().map_or(0, |&(due, ..)| due);
        let mut waiting = orders.iter().peekable();
        let mut first = path.clone();
        let trace = pin_machine::run(settings, &mut path, self.turn_ticks, &mut |turn| {
            if is_stored && !started {
                started = true;
                turn.machine.start(&mut first).expect("within the travel");
            }
            while let Some(&(_, order, percent)) = waiting.next_if(|order| turn.now >= order.0) {
                match order {
                    0 => turn.machine.set_override(percent),
                    1 => turn.machine.set_override(100),
                    _ => turn.machine.hold(),
                }
            }
            if self.aborts && turn.now >= last {
                turn.machine.abort();
                unsent.by_ref().for_each(drop);
            }
            while let Some((target, feed)) = unsent.peek()
                && turn.machine.has_room()
                && turn.machine.draw_to(**target, Some(Value::from_num(**feed))).is_ok()
            {
                unsent.next();
            }
            if turn.machine.state() == (State::Hold { stopped: true }) && turn.machine.is_stopped()
            {
                assert_eq!(turn.machine.planned_position(), turn.pins);
                turn.machine.resume();
            }
            let is_sent = unsent.peek().is_none();
            !is_sent || turn.machine.state() != State::Idle || !turn.machine.is_stopped()
        });
        let drawn = event_checker::check_pins(&trace, &settings);
        assert_eq!(drawn.pen, 0, "the pen is not raised");
        if !self.aborts {
            assert_eq!(Some(drawn.end), targets.last().map(|target| target.point));
        }
        event_checker::speed_ratios(&drawn.runs, &targets, &settings, false)
    }
}

/// A number between two others.
pub fn number(random: &mut Random, from: f64, to: f64) -> f64 {
    from + (to - from) * random.below(1 << 40) as f64 / (1u64 << 40) as f64
}

/// A random walk in small steps that bends smoothly, as drawings from a camera or a font do; and
/// for each point how sharply it bends there, in 1/mm, before it is rounded to steps.
pub fn random_curve(random: &mut Random) -> (Vec<PagePoint>, Vec<f64>) {
    let mut bends = vec![0.0];
    let mut points = vec![PagePoint { x: 20_000, y: 20_000 }];
    let chord = number(random, 2.0, 40.0);
    let (mut x, mut y, mut heading, mut bend) = (20_000.0f64, 20_000.0f64, 0.0f64, 0.0f64);
    for _ in 0..random.between(20, 400) {
        if random.once_in(12) {
            let radius = 10f64.powf(number(random, 1.3, 4.0));
            bend = chord / radius * random.one_of(&[-1.0, 0.0, 1.0]);
        }
        let turn = bend.clamp(-0.5, 0.5);
        heading += turn;
        *bends.last_mut().expect("never empty") = turn.abs() / chord * STEPS_PER_MM;
        (x, y) = (x + chord * heading.cos(), y + chord * heading.sin());
        points.push(PagePoint { x: x.round() as i32, y: y.round() as i32 });
        bends.push(0.0);
    }
    (points, bends)
}

/// The greatest acceleration towards the centre of a bend, as a part of the limit, on lines that
/// bend at both ends. Each line is at least a step long.
pub fn in_bends(case: Case, points: &[PagePoint], bends: &[f64], run: &Run) -> f64 {
    let places = positions(points);
    let (mut first, mut greatest) = (0, 0.0f64);
    for (ends, bends) in points.windows(2).zip(bends.windows(2)) {
        let moves = (ends[1].x - ends[0].x).abs().max((ends[1].y - ends[0].y).abs()) as usize;
        for index in first.max(1)..first + moves {
            let speed =
                (places[index] - places[index - 1]) / (run.times[index] - run.times[index - 1]);
            greatest = greatest.max((speed - 0.1).powi(2) * bends[0].min(bends[1]));
        }
        first += moves;
    }
    greatest / case.acceleration
}
