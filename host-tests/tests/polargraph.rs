//! Tests of polargraphs: the lines on the page, computed from the true lengths of both belts.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PagePoint};
use penup::machine::{Anchors, Kinematics, Setting, Settings, Target, TargetList, Value};
use penup_host_tests::pin_machine;
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Two anchors above the page.
#[derive(Debug, Clone, Copy)]
struct PolargraphMachine {
    settings: Settings,
    steps_per_mm: f64,
    /// From one anchor to the other, steps.
    width: f64,
    /// From the left anchor to the page's origin, to the right and up, steps.
    left: f64,
    height: f64,
}

impl PolargraphMachine {
    /// Lengths in mm.
    fn new(steps_per_mm: f64, width: f64, left: f64, height: f64) -> Self {
        let mut settings = Settings::default();
        for (setting, value) in [
            (Setting::StepsPerMmX, steps_per_mm),
            (Setting::AnchorWidth, width),
            (Setting::AnchorLeft, left),
            (Setting::AnchorHeight, height),
            (Setting::Kinematics, 2.0),
        ] {
            settings.set(setting, Value::from_num(value)).expect("valid");
        }
        let Kinematics::Polargraph(Anchors { left, width }) = settings.kinematics() else {
            unreachable!("as set")
        };
        let [width, left, height] = [width, -left.x, left.y].map(f64::from);
        Self { settings, steps_per_mm, width, left, height }
    }

    /// The belts' true lengths, in steps.
    fn belts(self, x: f64, y: f64) -> (f64, f64) {
        let Self { width, left, height, .. } = self;
        ((x + left).hypot(height - y), (width - left - x).hypot(height - y))
    }

    /// Where the pen hangs.
    fn page(self, belts: PagePoint) -> (f64, f64) {
        let Self { width, left, height, .. } = self;
        let (a, b) = (f64::from(belts.x), f64::from(belts.y));
        let x = (a * a - b * b + width * width) / (2.0 * width);
        (x - left, height - (a * a - x * x).sqrt())
    }

    /// How many steps the belts are off the line, if both are to be off as little as can be; 0.5
    /// for less.
    fn off(self, belts: PagePoint, from: PagePoint, to: PagePoint) -> f64 {
        let (from, delta) = (
            (f64::from(from.x), f64::from(from.y)),
            (f64::from(to.x - from.x), f64::from(to.y - from.y)),
        );
        let off = |along: f64| {
            let (a, b) = self.belts(from.0 + along * delta.0, from.1 + along * delta.1);
            (f64::from(belts.x) - a).abs().max((f64::from(belts.y) - b).abs())
        };
        let (x, y) = self.page(belts);
        let squared = delta.0.powi(2) + delta.1.powi(2);
        let along = ((x - from.0) * delta.0 + (y - from.1) * delta.1) / squared;
        if off(along.clamp(0.0, 1.0)) <= 0.5 {
            return 0.5;
        }
        // The greater of the two has one valley within some steps; close below the anchors' height
        // a step of the belts is many of the page.
        let depth = (self.height - y).max(1.0);
        let reach = 5.0 * (1.0 + f64::from(belts.x.max(belts.y)) / depth) / squared.sqrt();
        let (mut low, mut high) = ((along - reach).max(0.0), (along + reach).min(1.0));
        for _ in 0..60 {
            let third = (high - low) / 3.0;
            if off(low + third) < off(high - third) {
                high -= third;
            } else {
                low += third;
            }
        }
        off(low)
    }
}

fn polargraphs() -> impl Strategy<Value = PolargraphMachine> {
    (10.0f64..80.0, 600.0f64..2000.0, 100.0f64..150.0, 430.0f64..900.0)
        .prop_map(|(steps, width, left, height)| PolargraphMachine::new(steps, width, left, height))
}

fn positions() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((0.0f64..400.0, 0.0f64..420.0), 2..5)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn lines_are_straight_within_half_a_step_of_the_belts(
        polargraph in polargraphs(),
        positions in positions(),
    ) {
        let settings = polargraph.settings;
        let targets: Vec<_> = positions
            .iter()
            .enumerate()
            .map(|(index, &(x, y))| Target {
                point: PagePoint {
                    x: (x * polargraph.steps_per_mm) as i32,
                    y: (y * polargraph.steps_per_mm) as i32,
                },
                ink: (index > 0).then_some(LineType::Full),
            })
            .collect();
        let events =
            pin_machine::record(settings, &mut TargetList::new(&targets), 64).expect("on the page");
        let start = settings.kinematics().motors(PagePoint::default());
        let mut moves = pin_machine::moves(&events).into_iter().map(|(_, moved)| PagePoint {
            x: start.x + moved.x,
            y: start.y + moved.y,
        });
        let mut from = PagePoint::default();
        for target in &targets {
            let end = settings.kinematics().motors(target.point);
            let mut belts = settings.kinematics().motors(from);
            while belts != end {
                let at = moves.next().expect("every corner is reached");
                let off = polargraph.off(at, from, target.point);
                // Half of the 1/8191 in which pieces lie beside the steps, and the bow of a
                // segment.
                prop_assert!(off <= 0.5005, "{} steps at {:?} from {:?} to {:?}, begins {:?} ends \
                 {:?}", off, at, from, target.point, settings.kinematics().motors(from), end);
                belts = at;
            }
            from = target.point;
        }
        prop_assert_eq!(moves.next(), None);
    }

    #[test]
    fn the_same_steps_are_inked_forward_and_backward(
        polargraph in polargraphs(),
        ends in ((0.0f64..400.0, 0.0f64..420.0), (0.0f64..400.0, 0.0f64..420.0)),
        short: bool,
        build in 0..3,
        line_type in prop::sample::select(LineType::ALL.to_vec()),
    ) {
        let mut settings = polargraph.settings;
        settings.set(Setting::Kinematics, Value::from_num(build)).expect("valid");
        let steps = settings.page_steps().map(|steps| steps.to_num::<f64>());
        let point =
            |(x, y): (f64, f64)| PagePoint { x: (x * steps[0]) as i32, y: (y * steps[1]) as i32 };
        let near =
            |(x, y): (f64, f64), (dx, dy): (f64, f64)| (x + (dx - x) / 40.0, y + (dy - y) / 40.0);
        let a = ends.0;
        let (a, b) = (point(a), point(if short { near(a, ends.1) } else { ends.1 }));
        let draw = |from, to| {
            let targets = [
                Target { point: from, ink: None },
                Target { point: to, ink: Some(line_type) },
            ];
            let events = pin_machine::record(settings, &mut TargetList::new(&targets), 64);
            let (mut at, mut down) = (settings.kinematics().motors(PagePoint::default()), false);
            let mut inked = BTreeSet::new();
            for event in events.expect("on the page") {
                let before = at;
                let (dx, dy) = event.step();
                at = PagePoint { x: at.x + dx, y: at.y + dy };
                if down && before != at {
                    inked.insert((before.min(at), before.max(at)));
                }
                if let penup::motion::EventKind::Pen { height } = event.kind() {
                    down = height >= 64;
                }
            }
            inked
        };
        prop_assert_eq!(draw(a, b), draw(b, a));
    }

    #[test]
    fn dots_are_as_long_as_on_any_machine(
        polargraph in polargraphs(),
        ends in ((0.0f64..400.0, 0.0f64..420.0), (0.0f64..400.0, 0.0f64..420.0)),
        dot in 0.5f64..20.0,
        dashed: bool,
    ) {
        let mut settings = polargraph.settings;
        settings.set(Setting::DotLength, Value::from_num(dot)).expect("valid");
        let step = 1.0 / polargraph.steps_per_mm;
        let point = |(x, y): (f64, f64)| PagePoint { x: (x / step) as i32, y: (y / step) as i32 };
        let ink = if dashed { LineType::Dashed } else { LineType::Dotted };
        let (from, to) = (point(ends.0), point(ends.1));
        let targets = [Target { point: from, ink: None }, Target { point: to, ink: Some(ink) }];
        let events =
            pin_machine::record(settings, &mut TargetList::new(&targets), 64).expect("on the page");
        let start = settings.kinematics().motors(PagePoint::default());
        // The page's length of each stroke.
        let mut strokes: Vec<f64> = Vec::new();
        let (mut at, mut down, mut begun) = (start, false, start);
        for event in &events {
            let (dx, dy) = event.step();
            at = PagePoint { x: at.x + dx, y: at.y + dy };
            if let penup::motion::EventKind::Pen { height } = event.kind() {
                if down && height < 64 {
                    let (a, b) = (polargraph.page(begun), polargraph.page(at));
                    strokes.push((b.0 - a.0).hypot(b.1 - a.1) * step);
                }
                (down, begun) = (height >= 64, at);
            }
        }
        let delta = (f64::from(to.x - from.x), f64::from(to.y - from.y));
        let length = delta.0.hypot(delta.1) * step;
        let dot = if dashed { 3.0 * dot } else { dot };
        prop_assume!(length > 4.0 * dot);
        // Half of them are gaps.
        let each = length / (2.0 * strokes.len() as f64 - 1.0);
        prop_assert!((each / dot - 1.0).abs() < dot / length + 0.05, "{} mm, not {}", each, dot);
        for stroke in strokes {
            // Belts that are nearly parallel or in line make a step of the page many.
            prop_assert!((stroke - each).abs() < 0.1 * each + 8.0 * step, "{} mm, not \
             {}", stroke, each);
        }
    }
}
