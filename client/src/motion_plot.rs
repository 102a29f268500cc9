//! Plots the speed, the acceleration and the jerk of a job over time, as SVG.
//!
//! The motion is that of the library's own planner: its step events are recorded, and the place of
//! the plan along the path at each step gives the curves. [`Motion::record`] records a job, and
//! [`Motion::svg`] draws it. Where the pen is raised, from one order to the next, the plots are
//! grey. Only Cartesian machines are plotted.

use penup::drawing::PagePoint;
use penup::machine::{Machine, MachineError, Path, PulserState, Setting, Settings, State, Target};
use penup::motion::{Block, EventKind, EventQueue, StepEvent, TICKS_PER_SECOND};
use std::fmt::Write as _;

/// The number of moves that are planned ahead, as many as on the Pico.
const BLOCKS: usize = penup::board_table::PICO.memory.blocks;
/// The error of a position of the plan in mm, which is that of a length in the library.
const PLACE_ERROR: f64 = 4e-6;
/// The number of columns of a plot. Each shows the least and the greatest value in its time.
const COLUMNS: usize = 1200;
/// The time in seconds between two steps from which on the machine is at rest.
const STANDSTILL: f64 = 0.1;
/// The height of one of the three plots, and the space between them.
const HEIGHT: f64 = 220.0;
const SPACE: f64 = 50.0;
/// The space to the left of the plots.
const LEFT: f64 = 90.0;

/// The recorded motion of a job.
#[derive(Debug, Clone)]
pub struct Motion {
    /// The time (s) of each step, and the place of the plan (mm) along the path.
    steps: Vec<(f64, f64)>,
    /// The duration of the job in seconds.
    seconds: f64,
    /// From when (s) to when the pen is told to be raised.
    raised: Vec<[f64; 2]>,
    /// The greatest speed in mm/s, the acceleration in mm/s², and the jerk in mm/s³, if limited.
    limits: [Option<f64>; 3],
}

/// An event queue that records the time of each step, and of each order to the pen, in ticks.
#[derive(Default)]
struct Recorder {
    times: Vec<u64>,
    orders: Vec<(u64, u8)>,
    now: u64,
}

impl EventQueue for Recorder {
    fn room(&self) -> usize {
        usize::MAX
    }
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        if event.step() != (0, 0) {
            self.times.push(self.now);
        }
        if let EventKind::Pen { height } = event.kind() {
            self.orders.push((self.now, height));
        }
        self.now += u64::from(event.ticks());
        Ok(())
    }
}

impl Recorder {
    /// From when to when, in seconds, the pen is told to be elsewhere than at the height `down`.
    fn raised(&self, down: u8) -> Vec<[f64; 2]> {
        let seconds = |ticks: u64| ticks as f64 / f64::from(TICKS_PER_SECOND);
        let (mut raised, mut since) = (Vec::new(), Some(0));
        for &(time, height) in &self.orders {
            if height != down {
                since = since.or(Some(time));
            } else if let Some(since) = since.take() {
                raised.push([seconds(since), seconds(time)]);
            }
        }
        raised.extend(since.map(|since| [seconds(since), seconds(self.now)]));
        raised
    }
}

/// Plans a whole job, which starts at the page's origin, and passes its step events to `queue`. It
/// goes on at once where the machine waits for another pen or for ink.
///
/// # Errors
/// The machine refuses the job.
pub(crate) fn plan(
    settings: Settings,
    path: &mut dyn Path,
    queue: &mut dyn EventQueue,
) -> Result<(), MachineError> {
    let pins = PulserState::new();
    let mut blocks = vec![Block::EMPTY; BLOCKS];
    let mut machine = Machine::new(settings, &mut blocks, &pins, u32::MAX);
    machine.start(path)?;
    machine.fill(path, queue);
    while matches!(machine.state(), State::Hold { .. }) {
        machine.resume();
        machine.fill(path, queue);
    }
    match machine.state() {
        State::Idle => Ok(()),
        state => Err(MachineError::State(state)),
    }
}

/// Measures the moves of a job, which starts at the page's origin.
///
/// # Errors
/// The machine refuses the job.
pub(crate) fn measure(settings: Settings, path: &mut dyn Path) -> Result<(), MachineError> {
    let (pins, mut blocks) = (PulserState::new(), vec![Block::EMPTY; BLOCKS]);
    Machine::new(settings, &mut blocks, &pins, u32::MAX).start(path).map(drop)
}

impl Motion {
    /// Records the motion of a job, which starts at the page's origin.
    ///
    /// # Errors
    /// The machine refuses the job.
    pub fn record(settings: Settings, path: &mut dyn Path) -> Result<Self, MachineError> {
        let mut recorder = Recorder::default();
        plan(settings, path, &mut recorder)?;
        path.rewind();
        let second = f64::from(TICKS_PER_SECOND);
        let times = recorder.times.iter().map(|&ticks| ticks as f64 / second);
        let value = |setting| settings.get(setting).to_num::<f64>();
        let rate = value(Setting::MaxRateX).min(value(Setting::MaxRateY));
        let speed = value(Setting::DrawSpeed).max(value(Setting::TravelSpeed)).min(rate) / 60.0;
        let acceleration = value(Setting::AccelerationX).min(value(Setting::AccelerationY));
        let jerk = 1000.0 * value(Setting::Jerk);
        Ok(Self {
            steps: times.zip(positions(path, &settings)).collect(),
            seconds: recorder.now as f64 / second,
            raised: recorder.raised(value(Setting::PenDownHeight) as u8),
            limits: [Some(speed), Some(acceleration), (jerk > 0.0).then_some(jerk)],
        })
    }

    /// The three plots, one above the other, with the limits as dashed lines, and grey where the
    /// pen is raised.
    ///
    /// Acceleration and jerk are means over a few milliseconds, as long as the errors of the
    /// positions need, so changes within less than that look smoother than they are.
    pub fn svg(&self) -> String {
        self.draw(&self.curves())
    }

    /// The speed, the acceleration and the jerk, all in mm and s, with their times.
    ///
    /// They are the divided differences of the positions at steps that lie a window apart.
    fn curves(&self) -> [Vec<(f64, f64)>; 3] {
        let steps = &self.steps;
        let jerk = self.limits[2].unwrap_or(20_000.0);
        let window = (8.0 * PLACE_ERROR / (0.08 * jerk)).cbrt();
        let mut curves = [const { Vec::new() }; 3];
        let mut knots = [0; 4];
        for first in 0..steps.len() {
            knots[0] = first;
            for index in 1..4 {
                let least = steps.get(knots[index - 1]).map_or(f64::MAX, |step| step.0 + window);
                knots[index] = knots[index].max(knots[index - 1]);
                while steps.get(knots[index]).is_some_and(|step| step.0 < least) {
                    knots[index] += 1;
                }
            }
            let known: Vec<_> = knots.iter().map_while(|&knot| steps.get(knot)).collect();
            let mut differences: Vec<f64> = known.iter().map(|step| step.1).collect();
            let mut factor = 1.0;
            for order in 1..known.len() {
                for index in 0..known.len() - order {
                    let span = known[index + order].0 - known[index].0;
                    differences[index] = (differences[index + 1] - differences[index]) / span;
                }
                factor *= order as f64;
                let times = &known[..=order];
                if times.windows(2).all(|pair| pair[1].0 - pair[0].0 < STANDSTILL) {
                    let sum: f64 = times.iter().map(|step| step.0).sum();
                    curves[order - 1].push((sum / times.len() as f64, factor * differences[0]));
                }
            }
        }
        for pair in steps.windows(2).filter(|pair| pair[1].0 - pair[0].0 >= STANDSTILL) {
            for curve in &mut curves {
                curve.extend([(pair[0].0 + window, 0.0), (pair[1].0 - window, 0.0)]);
            }
        }
        for curve in &mut curves {
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        curves
    }

    fn draw(&self, curves: &[Vec<(f64, f64)>; 3]) -> String {
        let width = LEFT + COLUMNS as f64 + 20.0;
        let height = 3.0 * (HEIGHT + SPACE) + 10.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        let names = ["speed, mm/s", "acceleration, mm/s²", "jerk, m/s³"];
        let units = [1.0, 1.0, 1000.0];
        for (index, (name, unit)) in names.iter().zip(units).enumerate() {
            let plot = Plot {
                name,
                top: 30.0 + index as f64 * (HEIGHT + SPACE),
                values: curves[index].iter().map(|&(time, value)| (time, value / unit)).collect(),
                limit: self.limits[index].map(|limit| limit / unit),
                seconds: self.seconds,
                raised: &self.raised,
            };
            plot.draw(&mut svg);
        }
        svg += "</svg>\n";
        svg
    }
}

/// One of the three plots.
struct Plot<'a> {
    name: &'a str,
    /// The y of its upper edge.
    top: f64,
    /// The times and the values, in the order of the times.
    values: Vec<(f64, f64)>,
    /// The limit, if there is one.
    limit: Option<f64>,
    /// The duration that the width shows.
    seconds: f64,
    /// From when to when the pen is raised.
    raised: &'a [[f64; 2]],
}

impl Plot<'_> {
    /// The x of a time.
    fn x(&self, time: f64) -> f64 {
        LEFT + time / self.seconds.max(1e-9) * COLUMNS as f64
    }

    /// Draws what is grey because the pen is raised, and the axis of the time.
    fn draw_time(&self, svg: &mut String) {
        let bottom = self.top + HEIGHT;
        let mut path = String::new();
        for &[from, to] in self.raised {
            let (x, width) = (self.x(from), self.x(to) - self.x(from));
            let _ = write!(path, "M{x:.1} {}h{width:.1}v{HEIGHT}h-{width:.1}z", self.top);
        }
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"#ececec\"/>");
        let step = tick_step(self.seconds);
        for number in 0..=(self.seconds / step) as u32 {
            let time = step * f64::from(number);
            let (x, y) = (self.x(time), bottom + 4.0);
            let _ = writeln!(svg, "<path d=\"M{x:.1} {bottom}v4\" stroke=\"#888888\"/>");
            let unit = if number == 0 { " s" } else { "" };
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\" font-size=\"10\">\
                 {}{unit}</text>",
                y + 9.0,
                (time * 1000.0).round() / 1000.0,
            );
        }
    }

    fn draw(&self, svg: &mut String) {
        let least = self.values.iter().map(|point| point.1).fold(0.0, f64::min);
        let greatest = self.values.iter().map(|point| point.1).fold(0.0, f64::max);
        let reach = self.limit.unwrap_or(0.0).max(greatest).max(-least).max(1e-9) * 1.08;
        let bottom = if least < -1e-3 * reach { -reach } else { 0.0 };
        let y = |value: f64| self.top + HEIGHT * (reach - value) / (reach - bottom);
        let right = LEFT + COLUMNS as f64;
        // Writing to a string cannot fail.
        self.draw_time(svg);
        let mut line = |value: f64, style: &str| {
            let y = y(value);
            let _ = writeln!(svg, "<path d=\"M{LEFT} {y:.1}H{right}\" {style}/>");
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 6.0,
                y + 4.0,
                rounded(value)
            );
        };
        line(0.0, "stroke=\"#888888\"");
        for limit in self.limit.into_iter().flat_map(|limit| [limit, -limit]) {
            if limit >= bottom {
                line(limit, "stroke=\"#d7433b\" stroke-dasharray=\"6 4\"");
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.1}\">{}; {:.3} s; greatest {}</text>",
            self.top - 8.0,
            self.name,
            self.seconds,
            rounded(greatest.max(-least))
        );
        let column = |time: f64| (time / self.seconds * COLUMNS as f64) as usize;
        let tenths = |value: f64| (10.0 * y(value)).round() as i64;
        let mut points: Vec<(f64, i64)> = Vec::new();
        let mut add = |point: (f64, i64)| {
            // A level line needs only its ends.
            let is_level = matches!(points[..], [.., a, b] if a.1 == b.1 && b.1 == point.1);
            if is_level {
                points.pop();
            }
            points.push(point);
        };
        for values in self.values.chunk_by(|a, b| column(a.0) == column(b.0)) {
            let low = values.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
            let high = values.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
            let x = LEFT + column(values[0].0) as f64 + 0.5;
            // What is less high than the line is wide is one point.
            if tenths(low) - tenths(high) > 10 {
                add((x, tenths(low)));
                add((x, tenths(high)));
            } else {
                add((x, tenths(f64::midpoint(low, high))));
            }
        }
        let mut path = String::new();
        for (index, (x, tenths)) in points.into_iter().enumerate() {
            let letter = if index == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{letter}{x} {}", tenths as f64 / 10.0);
        }
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" stroke=\"#1b1f3b\"/>");
    }
}

/// The time from one mark of the axis to the next: 1, 2 or 5 times a power of ten, so that there
/// are 6 to 15 marks.
fn tick_step(seconds: f64) -> f64 {
    let least = seconds.max(1e-6) / 15.0;
    let decade = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * decade >= least);
    factor.unwrap_or(10.0) * decade
}

/// A number with three digits or more.
fn rounded(value: f64) -> String {
    if value.abs() >= 100.0 || value == 0.0 {
        format!("{value:.0}")
    } else if value.abs() >= 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.4}")
    }
}

/// The positions of the plan along the path (mm) at the steps of the job: each is due when the plan
/// is half a step from its end.
fn positions(path: &mut dyn Path, settings: &Settings) -> Vec<f64> {
    let [x, y] = settings.page_steps().map(|steps| steps.to_num::<f64>());
    let (mut at, mut start) = (PagePoint::default(), 0.0);
    let mut positions = Vec::new();
    while let Some(Target { point, .. }) = path.next_target() {
        let (dx, dy) = (point.x - at.x, point.y - at.y);
        let length = (f64::from(dx) / x).hypot(f64::from(dy) / y);
        let count = dx.abs().max(dy.abs());
        positions.extend(
            (0..count).map(|step| start + length * (f64::from(step) + 0.5) / f64::from(count)),
        );
        start += length;
        at = point;
    }
    path.rewind();
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine_settings::{AssignedSetting, simulated};
    use penup::drawing::LineType;
    use penup::machine::TargetList;

    fn motion(given: &[&str]) -> Motion {
        let given: Vec<_> =
            given.iter().map(|text| AssignedSetting::parse(text).expect("a setting")).collect();
        let settings = simulated(&given).expect("valid");
        let ink = Some(LineType::Full);
        let targets = [
            Target { point: PagePoint { x: 4000, y: 0 }, ink },
            Target { point: PagePoint { x: 4000, y: 4000 }, ink },
        ];
        Motion::record(settings, &mut TargetList::new(&targets)).expect("within the travel")
    }

    /// The least and the greatest speed, acceleration and jerk.
    fn extremes(motion: &Motion) -> [(f64, f64); 3] {
        motion.curves().map(|curve| {
            let values = curve.iter().map(|point| point.1);
            values.fold((0.0, 0.0), |(least, most), value| (value.min(least), value.max(most)))
        })
    }

    #[test]
    fn the_curves_reach_the_limits_and_keep_them() {
        let motion = motion(&["$204=5", "120=400", "121=400"]);
        let [speed, acceleration, jerk] = extremes(&motion);
        assert!((speed.1 - 50.0).abs() < 0.5 && speed.0 > -0.1, "{speed:?}");
        for value in [-acceleration.0, acceleration.1] {
            assert!((value / 400.0 - 1.0).abs() < 0.05, "{acceleration:?}");
        }
        for value in [-jerk.0, jerk.1] {
            assert!((0.9..1.1).contains(&(value / 5000.0)), "{jerk:?}");
        }
    }

    #[test]
    fn the_pen_is_raised_before_and_behind_each_stroke() {
        let motion = motion(&[]);
        // It is lowered at once, raised behind the stroke, and raised for its dwell.
        let [before, behind] = motion.raised[..] else {
            panic!("{:?}", motion.raised);
        };
        assert!(before[0] == 0.0 && before[1] < 0.01, "{before:?}");
        let last = motion.steps.last().expect("steps").0;
        assert!(behind[0] >= last && behind[0] < last + 0.01, "{behind:?}");
        assert!((behind[1] - behind[0] - 0.15).abs() < 0.01 && behind[1] == motion.seconds);
        assert_eq!([0.28, 1.0, 5.6, 70.0].map(tick_step), [0.02, 0.1, 0.5, 5.0]);
    }

    #[test]
    fn the_picture_has_three_curves_and_their_limits() {
        let without = motion(&[]).svg();
        let with = motion(&["204=20"]).svg();
        for (svg, dashed) in [(without, 3), (with, 5)] {
            assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
            assert_eq!(svg.matches("fill=\"none\"").count(), 3);
            assert_eq!(svg.matches("dasharray").count(), dashed);
        }
    }
}
