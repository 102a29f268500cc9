//! How long the way with the pen up becomes if the pen begins while the order is being computed,
//! and if it begins afterwards, with the Pico's memory: of scenes, and of 1000 random strokes.

#![allow(clippy::expect_used, reason = "a measurement fails by panicking")]
use penup::board_table::PICO;
use penup::boards::host::lend_memory_of;
use penup::drawing::{Drawing, PagePoint, Segment};
use penup::machine::Settings;
use penup::order::{
    Effort, First, Leg, Meanwhile, Options, Pace, Report, choose_first, order, order_rest,
};
use penup::plotter::EMPTY_LOOKAHEAD;
use penup::stage::{NeverCancel, Scratch};
use penup_host_tests::order_drawings::{Strokes, flow_field, hatched, random};
use penup_host_tests::whole_jobs::{Bench, job_lines};

/// The scenes and their cameras.
const SCENES: [(&str, &str); 4] = [
    ("lattice5", "$eye=-15.37,-20.71,25.13"),
    ("lattice7", "$eye=-21.37,-28.71,35.13"),
    ("gears", "$view=auto"),
    ("text300", "$view=auto"),
];
struct Time;
impl Meanwhile for Time {
    fn milliseconds(&self, strokes: u32, down: u64) -> u64 {
        let mm = |l: u64| l as f64 / 256.0 / 80.0;
        let f: f64 = std::env::var("F").map_or(1.0, |f| f.parse().expect("a number"));
        ((mm(down) / 50.0 * 1000.0 + 300.0 * f64::from(strokes)) * f) as u64
    }
}

type Drawn = (Vec<PagePoint>, Vec<Segment<u16>>);

fn drawing_of(scene: &str, option: &str) -> Drawn {
    let memory = PICO.memory;
    let blocks = EMPTY_LOOKAHEAD.len();
    let lent = lend_memory_of(memory.vertices, memory.corners, memory.words, blocks);
    let mut bench = Bench::with_memory(lent);
    let lines = job_lines(&format!("{scene}.obj"), &[option]);
    let (_, model) = lines.split_last().expect("lines");
    for line in model {
        bench.say(&format!("{line}\n"));
    }
    let Ok(drawing) = bench.plotter.draw(&mut NeverCancel) else { return Drawn::default() };
    (drawing.points.to_vec(), drawing.segments.to_vec())
}

fn narrow(strokes: Strokes) -> Drawn {
    let narrow = |number: u32| u16::try_from(number).expect("a small number");
    let segments = strokes.segments.iter();
    let segments = segments.map(|s| Segment::new(narrow(s.from()), narrow(s.to()))).collect();
    (strokes.points, segments)
}

struct Count(u64);
impl penup::stage::Cancel for Count {
    fn check(&mut self) -> Result<(), penup::stage::Aborted> {
        self.0 += 1;
        Ok(())
    }
}
fn main() {
    let scenes =
        SCENES.into_iter().map(|(scene, option)| (scene.to_owned(), drawing_of(scene, option)));
    let random = (1..4).map(|seed| (format!("random {seed}"), narrow(random(1000, seed))));
    let hatched = (1..2).map(|seed| (format!("hatched {seed}"), narrow(hatched(1000, seed))));
    let flow = (1..2).map(|seed| (format!("flow {seed}"), narrow(flow_field(400, seed))));
    for (name, (points, segments)) in scenes.chain(random).chain(hatched).chain(flow) {
        let options = Options { lift_cost: 2 * 80 * 256, ..Options::default() };
        let used = segments.len() * 8 / 8 + points.len() + 16;
        let mut memory = vec![0u64; PICO.memory.words.saturating_sub(used)];
        let mut tour = vec![Leg::<u16>::new(0, false); segments.len()];
        let mm = |length: u64| length as f64 / 256.0 / 80.0;
        let show = |what: &str, r: Report| {
            println!(
                "{name} {what}: up {:.1} lifts {} odd {} parts {} down {:.1}",
                mm(r.pen_up),
                r.lifts,
                r.odd_points,
                r.components,
                mm(r.pen_down)
            )
        };
        for effort in [
            Effort::Auto(Pace::default()),
            Effort::Auto(Pace { units_per_second: 4_000_000, ..Pace::default() }),
            Effort::Units(0),
        ] {
            let options = Options { effort, ..options };
            let drawing = Drawing { points: &points, segments: &segments };
            let mut c = Count(0);
            let Ok(report) = order(drawing, options, Scratch::new(&mut memory), &mut c, &mut tour)
            else {
                println!("{name}: refused");
                continue;
            };
            show(&format!("today {:.2} s", c.0 as f64 * 256.0 / 250e3), report);
            let mut segments = segments.clone();
            let first = choose_first(
                &points,
                &mut segments,
                options,
                &Time,
                Scratch::new(&mut memory),
                &mut NeverCancel,
            )
            .expect("strokes");
            let drawing = Drawing { points: &points, segments: &segments };
            let (drawn, rest) = tour.split_at_mut(first.segments);
            penup::order::first_legs(drawn);
            let mut c = Count(0);
            let report =
                order_rest(drawing, first, drawn, options, Scratch::new(&mut memory), &mut c, rest)
                    .expect("an order");
            let mut at: Option<PagePoint> = None;
            let (mut ups, mut n) = (vec![], 0);
            for leg in &tour {
                let sg = segments[leg.segment()];
                let (f, t) =
                    if leg.reversed() { (sg.to(), sg.from()) } else { (sg.from(), sg.to()) };
                let (f, t) = (points[f as usize], points[t as usize]);
                if let Some(a) = at {
                    if a != f {
                        ups.push(mm(penup::order::length(a, f).into()).round());
                    }
                }
                at = Some(t);
                n += 1;
                if n > first.segments + 8 {
                    break;
                }
            }
            show(
                &format!(
                    "early {} strokes {ups:?} {:.2} s",
                    first.parts,
                    c.0 as f64 * 256.0 / 250e3
                ),
                report,
            );
        }
    }
    let _ = (First::default(), Settings::default());
}
