//! The settings of motion, converted to the units in which motion is computed.

#[cfg(feature = "input-shaping")]
use super::shaping::{MOST_SHAPED_STEPS, Shaping};
use super::smooth::{JerkLimit, State};
use super::{PathLength, SLICE_TICKS, SliceSpeed, StepEvent, TICKS_PER_SECOND};
use crate::fixed::Millimetres;
use core::ops::RangeInclusive;

/// The settings of motion as the user chooses them. All are positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MotionSettings {
    /// Steps per millimetre of x and y of the page: 2 to 4000.
    pub steps_per_mm: [Millimetres; 2],
    /// The most steps that a motor makes in a millimetre of the path.
    pub motor_steps_per_mm: Millimetres,
    /// The greatest speed along the path with the pen down, in mm/min, 1 to 32767.
    pub draw_mm_per_min: Millimetres,
    /// The greatest speed along the path with the pen up, in mm/min, 1 to 32767.
    pub travel_mm_per_min: Millimetres,
    /// The greatest acceleration along the path, in mm/s², 10 to 32767.
    pub acceleration_mm_per_s2: Millimetres,
    /// The greatest rate at which the acceleration changes, in m/s³, 0.1 to 1000; 0 for no limit.
    pub jerk_m_per_s3: Millimetres,
    /// How far an imagined arc would deviate from a corner, in mm, 0 to 1.
    pub junction_deviation_mm: Millimetres,
    /// Whether bends of dense polylines are passed no faster than acceleration allows on the circle
    /// through them.
    pub centripetal: bool,
    /// The width of a step pulse, which is also the least time between two pulses, in ticks.
    pub pulse_ticks: u32,
    /// The time from a change of direction to the pulse, in ticks.
    pub direction_setup_ticks: u32,
    /// The number of steps that are sure to wait for the interrupt. Speeds are limited so that the
    /// machine can stop within these steps if no more come.
    pub queue_steps: u32,
}

impl MotionSettings {
    /// The greatest speed along the path, in mm/min, for which the width of the pulses is sure to
    /// leave room.
    pub fn greatest_pulsed(&self) -> Millimetres {
        let interval = u64::from(2 * self.pulse_ticks.max(1));
        let steps = u64::from(self.motor_steps_per_mm.min(MOST_STEPS).to_bits().unsigned_abs());
        // The dividend is below 2^63.
        let bits = ((60 * u64::from(TICKS_PER_SECOND)) << 32).checked_div(interval * steps);
        let bits = bits.unwrap_or(0);
        // The length of a step is rounded down, by less than this part of it.
        let bits = bits - (bits >> 16);
        Millimetres::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
    }
}

/// The settings that motion cannot honour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LimitsError {
    /// Steps per millimetre outside 2 to 4000.
    StepsPerMillimetre,
    /// A speed of zero or less.
    Speed,
    /// Acceleration below 10 mm/s².
    Acceleration,
    /// A jerk below 0.1 or above 1000 m/s³ that is not 0.
    Jerk,
    /// Junction deviation below 0 or above 1 mm.
    JunctionDeviation,
    /// The page reaches up to the anchors of the belts, or these are more than 2^21 steps away.
    Anchors,
    /// Pulses of 1 ms or longer.
    Pulse,
    /// The raised pen is to be lower than the lowered one, but a stepper motor lifts it, which
    /// looks for its stop upward.
    PenUpsideDown,
    /// The pen is to move while the machine does, but a stepper motor lifts it, which moves only at
    /// rest.
    #[cfg(feature = "pen-overlap")]
    PenByMotor,
    /// Backlash is to be taken up while the pen draws, but the motors draw no straight line
    /// together.
    #[cfg(feature = "spread-backlash")]
    BacklashOfBelts,
    /// Motion is to be shaped on a polargraph, whose pen does not move as the sum of its motors, or
    /// together with what moves the pen or the motors beside the plan, or in bends of any speed.
    #[cfg(feature = "input-shaping")]
    ShapingConflict,
    /// A frequency is so low that the copies of the motion would not fit into the memory.
    #[cfg(feature = "input-shaping")]
    ShapingFrequency {
        /// The least frequency that works, in hundredths of hertz.
        least: u32,
    },
    /// More steps a second are asked for than are shaped.
    #[cfg(feature = "input-shaping")]
    ShapedSteps {
        /// The most steps a second.
        possible: u32,
    },
    /// So many steps per second are asked for that the pulses would merge: lower the speed or the
    /// width of the pulse.
    TooManySteps {
        /// The steps per second that are asked for.
        asked: u32,
        /// The steps per second for which the width of the pulses leaves room.
        possible: u32,
    },
}

/// The settings as the planner needs them. A value of this type guarantees that they are valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The lengths of a step of x and y, in mm.
    pub(super) step_length: [SliceSpeed; 2],
    /// The least length of a move, in mm.
    pub(super) least_move: SliceSpeed,
    pub(super) draw_speed: SliceSpeed,
    pub(super) travel_speed: SliceSpeed,
    /// The stopping distance of the greater of the two speeds.
    pub(super) top: PathLength,
    /// The distance from that speed to rest, observing the limit on jerk if there is one. It is
    /// limited to the greatest value of its type.
    pub(super) longest_stop: PathLength,
    /// What one slice adds to the speed.
    pub(super) acceleration: SliceSpeed,
    /// The limit on jerk; `None` if there is none.
    pub(super) jerk: Option<JerkLimit>,
    pub(super) junction_deviation: PathLength,
    pub(super) centripetal: bool,
    /// The greatest distance by which rounding three points to steps moves one of them off the line
    /// through the others.
    pub(super) rounding: PathLength,
    /// 9·24 ρ in units of 2^-18 mm, where ρ is the greatest distance by which rounding moves a
    /// point off its chord.
    ///
    /// A bend of radius R is known with an error of 1/24 once ρ is no more than 1/24 of the height
    /// of its middle over a chord. That takes a circle through three points that are √(2·24·ρR)
    /// apart, which is valid for its middle half, and so up to 3/2 of that distance before its end.
    /// So at a distance D before the end of the known path, R/2 is at least D²/(9·24·ρ).
    pub(super) surely_known: u32,
    /// The length of a known path that holds the longest stop, and lets bends be known before, with
    /// a quarter to spare.
    pub(super) enough_path: PathLength,
    pub(super) pulse_ticks: u32,
    pub(super) setup_ticks: u32,
    /// The shapers of both axes; `None` if motion is not shaped.
    #[cfg(feature = "input-shaping")]
    pub(super) shaping: Option<Shaping>,
}

impl Default for Limits {
    /// A gentle machine: 80 steps/mm, 10 mm/s, 100 mm/s².
    fn default() -> Self {
        let step_length = SliceSpeed::from_bits(u32::MAX / 80);
        let speed = SliceSpeed::from_bits(7_036_874);
        let mut limits = Self {
            step_length: [step_length; 2],
            least_move: step_length,
            draw_speed: speed,
            travel_speed: speed,
            top: const { PathLength::lit("0.5") },
            longest_stop: const { PathLength::lit("0.5") },
            acceleration: SliceSpeed::from_bits(11_529),
            jerk: None,
            junction_deviation: PathLength::from_bits(1 << 12),
            centripetal: true,
            rounding: rounding([step_length; 2]),
            surely_known: 0,
            enough_path: PathLength::ZERO,
            pulse_ticks: 50,
            setup_ticks: 25,
            #[cfg(feature = "input-shaping")]
            shaping: None,
        };
        limits.find_needed_path();
        limits
    }
}

/// The most steps in a millimetre. It is a constant because parsing it from text at run time would
/// take 4 KB of flash.
const MOST_STEPS: Millimetres = Millimetres::lit("4000");

impl Limits {
    /// Checks and converts the settings.
    ///
    /// # Errors
    /// See [`LimitsError`].
    pub fn new(settings: &MotionSettings) -> Result<Self, LimitsError> {
        let axis = |steps_per_mm: Millimetres| {
            const RANGE: RangeInclusive<Millimetres> = Millimetres::lit("2")..=MOST_STEPS;
            if !RANGE.contains(&steps_per_mm) {
                return Err(LimitsError::StepsPerMillimetre);
            }
            // 2^32 / (bits / 2^16), at most 2^31.
            let bits = (1u64 << 48).checked_div(steps_per_mm.to_bits().unsigned_abs().into());
            let bits = bits.ok_or(LimitsError::StepsPerMillimetre)?;
            Ok(SliceSpeed::from_bits(bits as u32))
        };
        let [x, y] = settings.steps_per_mm;
        let step_length = [axis(x)?, axis(y)?];
        let draw_speed = slice_speed(settings.draw_mm_per_min)?;
        let travel_speed = slice_speed(settings.travel_mm_per_min)?;
        if settings.acceleration_mm_per_s2 < 10 {
            return Err(LimitsError::Acceleration);
        }
        const JERKS: RangeInclusive<Millimetres> =
            Millimetres::lit("0.1")..=Millimetres::lit("1000");
        let jerk = settings.jerk_m_per_s3;
        if jerk != 0 && !JERKS.contains(&jerk) {
            return Err(LimitsError::Jerk);
        }
        if settings.junction_deviation_mm < 0 || settings.junction_deviation_mm > 1 {
            return Err(LimitsError::JunctionDeviation);
        }
        if settings.pulse_ticks >= TICKS_PER_SECOND / 1000
            || settings.direction_setup_ticks >= TICKS_PER_SECOND / 1000
        {
            return Err(LimitsError::Pulse);
        }
        let mut limits = Self {
            step_length,
            least_move: axis(settings.motor_steps_per_mm.min(MOST_STEPS))?,
            draw_speed,
            travel_speed,
            top: PathLength::ZERO,
            longest_stop: PathLength::ZERO,
            acceleration: slice_acceleration(settings.acceleration_mm_per_s2),
            jerk: None,
            junction_deviation: {
                // The deviation is at most 1 mm, and a unit of it is four units of the length.
                let deviation = settings.junction_deviation_mm.to_bits().unsigned_abs();
                PathLength::from_bits(deviation << 2)
            },
            centripetal: settings.centripetal,
            rounding: rounding(step_length),
            surely_known: 0,
            enough_path: PathLength::ZERO,
            pulse_ticks: settings.pulse_ticks.max(1),
            setup_ticks: settings.direction_setup_ticks,
            #[cfg(feature = "input-shaping")]
            shaping: None,
        };
        let held = limits.held_by(settings.queue_steps);
        limits.draw_speed = draw_speed.min(held);
        limits.travel_speed = travel_speed.min(held);
        let fastest = limits.draw_speed.max(limits.travel_speed);
        limits.top = limits.stopping_distance(fastest);
        limits.jerk = JerkLimit::new(jerk, limits.acceleration, fastest);
        limits.longest_stop = limits.jerk.map_or(limits.top, |jerk| {
            let state = State { speed: fastest.to_bits(), ramp: 0 };
            let distance = jerk.braking_distance(state, 0) >> 14;
            PathLength::from_bits(u32::try_from(distance).unwrap_or(u32::MAX))
        });
        limits.find_needed_path();
        limits.check_step_rate()?;
        Ok(limits)
    }

    /// Derives how much of the path must be known from the other limits.
    fn find_needed_path(&mut self) {
        self.surely_known = self.rounding.to_bits().saturating_mul(9 * 24);
        let needed = self.longest_stop.to_bits().saturating_add(self.surely_known / 4);
        self.enough_path = PathLength::from_bits(needed.saturating_add(needed / 4));
    }

    /// The same limits for the brake of motion that is shaped, whatever the speed of motion that is
    /// not.
    #[cfg(feature = "input-shaping")]
    pub fn with_shaping(self, shaping: Option<Shaping>) -> Self {
        Self { shaping, ..self }
    }

    /// The same limits for motion that is shaped.
    ///
    /// # Errors
    /// [`LimitsError::ShapedSteps`] if that would be too many steps a second.
    #[cfg(feature = "input-shaping")]
    pub fn shaped(self, shaping: Option<Shaping>) -> Result<Self, LimitsError> {
        let shaped = self.with_shaping(shaping);
        let asked = self.step_rate(self.draw_speed.max(self.travel_speed));
        // Changes of direction come between the steps at any speed, and leave room for that.
        let pulses = TICKS_PER_SECOND.checked_div(2 * self.least_interval()).unwrap_or(u32::MAX);
        let possible = pulses.min(MOST_SHAPED_STEPS);
        if shaping.is_some() && asked > u64::from(possible) {
            return Err(LimitsError::ShapedSteps { possible });
        }
        Ok(shaped)
    }

    fn check_step_rate(&self) -> Result<(), LimitsError> {
        let asked = self.step_rate(self.draw_speed.max(self.travel_speed));
        let possible = TICKS_PER_SECOND.checked_div(self.least_interval()).unwrap_or(u32::MAX);
        if asked > u64::from(possible) {
            return Err(LimitsError::TooManySteps {
                asked: u32::try_from(asked).unwrap_or(u32::MAX),
                possible,
            });
        }
        Ok(())
    }

    /// The greatest number of steps a second at this speed.
    pub(super) fn step_rate(&self, speed: SliceSpeed) -> u64 {
        let slices_per_second = u64::from(TICKS_PER_SECOND / SLICE_TICKS);
        let rate = u64::from(speed.to_bits()) * slices_per_second;
        rate.checked_div(self.least_move.to_bits().into()).unwrap_or(u64::MAX)
    }

    /// The least time between two pulses of the same axis, which is the width of the pulse and a
    /// pause of the same length.
    pub fn least_interval(&self) -> u32 {
        (2 * self.pulse_ticks).min(StepEvent::MAX_TICKS)
    }

    /// The greatest speed from which the machine can stop within 13/16 of `queue` steps. The rest
    /// is a reserve for a main loop that is a little late, so that the machine does not slow down
    /// at once, and for events between the steps.
    fn held_by(&self, queue: u32) -> SliceSpeed {
        // A step is below 2^31.
        let held = (u64::from(self.least_move.to_bits()) * u64::from(queue) / 16 * 13) >> 14;
        self.speed(PathLength::from_bits(u32::try_from(held).unwrap_or(u32::MAX)))
    }

    /// The greater of the two speeds, in mm/min.
    pub fn greatest_rate(&self) -> Millimetres {
        mm_per_min(self.draw_speed.max(self.travel_speed))
    }

    /// The stopping distance of `speed`, v²/2a, limited to the greatest value of its type.
    pub(super) fn stopping_distance(&self, speed: SliceSpeed) -> PathLength {
        // 14 bits finer than a length.
        let bits = self.fine_stopping_distance(speed) >> 14;
        PathLength::from_bits(u32::try_from(bits).unwrap_or(u32::MAX))
    }

    /// The stopping distance of `speed` in units of 2^-32 mm.
    fn fine_stopping_distance(&self, speed: SliceSpeed) -> u64 {
        // Units of 2^-64 mm² divided by units of 2^-32 mm.
        let twice = 2 * u64::from(self.acceleration.to_bits());
        square(speed.to_bits().into()).checked_div(twice).unwrap_or(u64::MAX)
    }

    /// The speed with this stopping distance, √2as.
    pub(super) fn speed(&self, stopping_distance: PathLength) -> SliceSpeed {
        // The root of 64 bits has 32.
        SliceSpeed::from_bits(self.squared_speed(stopping_distance).isqrt() as u32)
    }

    /// The square of the speed with this stopping distance, in units of 2^-64 (mm per slice)²,
    /// limited to 64 bits.
    pub(super) fn squared_speed(&self, stopping_distance: PathLength) -> u64 {
        let twice = 2 * u64::from(self.acceleration.to_bits());
        (twice * u64::from(stopping_distance.to_bits())).saturating_mul(1 << 14)
    }

    /// The least stopping distance whose [squared speed](Limits::squared_speed) is not below that
    /// of `speed`.
    pub(super) fn least_limit(&self, speed: u64) -> PathLength {
        let twice = 2 * u64::from(self.acceleration.to_bits());
        let bits = (speed * speed).div_ceil(twice.max(1)).div_ceil(1 << 14);
        PathLength::from_bits(u32::try_from(bits).unwrap_or(u32::MAX))
    }

    /// The length of a move by (`dx`, `dy`) steps, each within ±2^22; `None` beyond 16 m.
    pub fn length(&self, dx: i32, dy: i32) -> Option<PathLength> {
        let [step_x, step_y] = self.step_length;
        // Each component is at most 2^22 * 2^31 = 2^53 units of 2^-32 mm.
        let x = u64::from(dx.unsigned_abs()) * u64::from(step_x.to_bits());
        let y = u64::from(dy.unsigned_abs()) * u64::from(step_y.to_bits());
        let bits = hypotenuse(x, y);
        u32::try_from((bits + (1 << 13)) >> 14).ok().map(PathLength::from_bits)
    }
}

/// Returns 23/16 of the longer step. Each of three points is off by up to half a diagonal, and the
/// outer two count half, which makes at most √2 steps. The result is slightly greater, so that no
/// corner of single steps is exactly as sharp.
fn rounding([x, y]: [SliceSpeed; 2]) -> PathLength {
    PathLength::from_bits(((x.max(y).to_bits() >> 14) * 23).div_ceil(16))
}

/// The square of a number below 2^32. `pow` would be a call of a function with a loop.
#[inline(always)]
pub(super) fn square(number: u64) -> u64 {
    number * number
}

/// √(x² + y²) of numbers below 2^62, to 31 significant bits.
pub(super) fn hypotenuse(x: u64, y: u64) -> u64 {
    if x == 0 || y == 0 {
        return x + y;
    }
    let shift = (64 - x.max(y).leading_zeros()).saturating_sub(31);
    let (x, y) = (x >> shift, y >> shift);
    (x * x + y * y).isqrt() << shift
}

/// Converts mm/min to mm per slice, at most 0.09.
pub(super) fn slice_speed(mm_per_min: Millimetres) -> Result<SliceSpeed, LimitsError> {
    if mm_per_min <= 0 {
        return Err(LimitsError::Speed);
    }
    let bits = u64::from(mm_per_min.to_bits().unsigned_abs());
    // Converts 2^-16 mm/min to 2^-32 mm/slice. The product is below 2^31 * 2^28.
    let speed = (bits << 16) * u64::from(SLICE_TICKS) / (60 * u64::from(TICKS_PER_SECOND));
    Ok(SliceSpeed::from_bits((speed as u32).max(1)))
}

/// Converts mm per slice to mm/min.
pub(super) fn mm_per_min(speed: SliceSpeed) -> Millimetres {
    // Converts 2^-32 mm/slice to 2^-16 mm/min. The product is below 2^32 * 2^31 before it is
    // shifted.
    let bits = (u64::from(speed.to_bits()) * (60 * u64::from(TICKS_PER_SECOND))) >> 16;
    let bits = (bits + u64::from(SLICE_TICKS) / 2) / u64::from(SLICE_TICKS);
    Millimetres::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
}

/// Converts mm/s² to mm per slice per slice.
fn slice_acceleration(mm_per_s2: Millimetres) -> SliceSpeed {
    // 2^-16 mm/s² to 2^-32 mm/slice²: bits * 2^16 * 2^24 / (2^6 * 5^8)², the twos cancelled.
    let bits = u64::from(mm_per_s2.to_bits().unsigned_abs());
    SliceSpeed::from_bits(((bits << 28) / const { 5u64.pow(16) }) as u32)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn settings() -> MotionSettings {
        MotionSettings {
            steps_per_mm: [Millimetres::from_num(100); 2],
            motor_steps_per_mm: Millimetres::from_num(100),
            draw_mm_per_min: Millimetres::from_num(3000),
            travel_mm_per_min: Millimetres::from_num(6000),
            acceleration_mm_per_s2: Millimetres::from_num(200),
            jerk_m_per_s3: Millimetres::ZERO,
            junction_deviation_mm: Millimetres::from_num(0.127),
            centripetal: true,
            pulse_ticks: 50,
            direction_setup_ticks: 25,
            queue_steps: u32::MAX,
        }
    }

    #[test]
    fn units() {
        let limits = Limits::new(&settings()).expect("valid");
        let slice = f64::from(SLICE_TICKS) / f64::from(TICKS_PER_SECOND);
        assert!((limits.draw_speed.to_num::<f64>() / slice - 50.0).abs() < 1e-5);
        assert!((limits.acceleration.to_num::<f64>() / slice / slice - 200.0).abs() < 1e-2);
        let stop = limits.stopping_distance(limits.draw_speed);
        assert!((stop.to_num::<f64>() - 6.25).abs() < 1e-3);
        assert!((limits.speed(stop).to_num::<f64>() / slice - 50.0).abs() < 1e-3);
        let length = limits.length(3000, -4000).expect("short");
        assert!((length.to_num::<f64>() - 50.0).abs() < 1e-4);
        assert_eq!(limits.length(0, 0), Some(PathLength::ZERO));
        assert_eq!(limits.length(1 << 22, 1 << 22), None);
    }

    #[test]
    fn what_cannot_be_kept_is_refused() {
        let wrong = |change: fn(&mut MotionSettings)| {
            let mut wrong = settings();
            change(&mut wrong);
            Limits::new(&wrong).err()
        };
        assert_eq!(wrong(|_| ()), None);
        assert_eq!(
            wrong(|s| s.steps_per_mm[1] = Millimetres::ONE),
            Some(LimitsError::StepsPerMillimetre)
        );
        assert_eq!(wrong(|s| s.draw_mm_per_min = Millimetres::ZERO), Some(LimitsError::Speed));
        assert_eq!(
            wrong(|s| s.acceleration_mm_per_s2 = Millimetres::ZERO),
            Some(LimitsError::Acceleration)
        );
        assert_eq!(wrong(|s| s.jerk_m_per_s3 = Millimetres::ONE), None);
        for refused in ["-1", "0.05", "1001"] {
            let jerk = refused.parse().expect("a number");
            let settings = MotionSettings { jerk_m_per_s3: jerk, ..settings() };
            assert_eq!(Limits::new(&settings), Err(LimitsError::Jerk));
        }
        assert_eq!(
            wrong(|s| s.junction_deviation_mm = -Millimetres::DELTA),
            Some(LimitsError::JunctionDeviation)
        );
        assert!(matches!(
            wrong(|s| s.pulse_ticks = 2000),
            Some(LimitsError::TooManySteps { possible: 6250, .. })
        ));
    }

    #[test]
    fn speeds_are_told_as_they_were_set() {
        for set in [5.0, 60.0, 3000.0, 12_345.5, 32_000.0] {
            let told = mm_per_min(slice_speed(Millimetres::from_num(set)).expect("a speed"));
            assert!((told.to_num::<f64>() - set).abs() < 1e-3 * set + 0.01, "{told} {set}");
        }
    }
}
