//! The table of the settings: number, name, unit, range and default. A new setting is a variant of
//! [`Setting`] and a row of [`SETTINGS`] here, and nothing else but the code that obeys it.

use super::Value;

/// The settings of the machine, which it keeps. They are in the order of [`SETTINGS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Setting {
    /// `$0` The width of a step pulse, in microseconds.
    StepPulse,
    /// `$1` How long the drivers stay on after a move; 255 for always.
    StepIdleDelay,
    /// `$2` The mask of motors whose step pulses are inverted: bit 0 for x, bit 1 for y, bit 2 for
    /// z.
    InvertSteps,
    /// `$3` The mask of motors whose direction is inverted: bit 0 for x, bit 1 for y, bit 2
    /// for z.
    InvertDirections,
    /// `$4` Whether the enable pin is inverted: high switches the drivers on.
    InvertEnable,
    /// `$5` The mask of contacts that are closed when they are not pressed: bit 0 for x, bit 1 for
    /// y, bit 2 for the emergency stop.
    InvertContacts,
    /// `$6` Whether the probe is inverted. There is none; the value is only kept.
    InvertProbe,
    /// `$10` The mask of what a status report holds: bit 0 the position of the machine instead of
    /// that of the work, bit 1 the room in the buffers.
    StatusReport,
    /// `$11` Junction deviation: how far a rounded corner would be from the true one. It determines
    /// the speed in corners.
    JunctionDeviation,
    /// `$12` Arc tolerance. Arcs are drawn to half a step, whatever it is.
    ArcTolerance,
    /// `$13` Whether reports are in inches.
    ReportInches,
    /// `$20` Whether moves that leave the travel are refused.
    SoftLimits,
    /// `$21` Whether a pressed limit switch stops the machine.
    HardLimits,
    /// `$22` Whether the machine must be homed before it draws.
    Homing,
    /// `$23` The mask of axes whose limit switch lies at their low end: bit 0 for x, bit 1 for y.
    HomingDirection,
    /// `$24` The speed of the second, slow approach to a switch.
    HomingFeed,
    /// `$25` The speed of the first approach to a switch.
    HomingSeek,
    /// `$26` How long the machine rests between two moves of homing.
    HomingDebounce,
    /// `$27` The distance from its switch at which an axis is homed.
    HomingPullOff,
    /// `$30` The greatest S that is reported.
    MaxSpindle,
    /// `$31` The least S that is reported while it is on.
    MinSpindle,
    /// `$32` Whether lines are drawn as by a laser: only G1 to G3, and only with S above 0.
    Laser,
    /// `$100` Steps per millimetre of x.
    StepsPerMmX,
    /// `$101` Steps per millimetre of y.
    StepsPerMmY,
    /// `$102` Steps per millimetre of z, whose motor lifts the pen.
    StepsPerMmZ,
    /// `$110` The greatest speed of x, in mm/min.
    MaxRateX,
    /// `$111` The greatest speed of y, in mm/min.
    MaxRateY,
    /// `$112` The greatest speed of z, in mm/min.
    MaxRateZ,
    /// `$120` The greatest acceleration of x, in mm/s².
    AccelerationX,
    /// `$121` The greatest acceleration of y, in mm/s².
    AccelerationY,
    /// `$122` The greatest acceleration of z, in mm/s².
    AccelerationZ,
    /// `$130` How far x may go from 0, in mm.
    TravelX,
    /// `$131` How far y may go from 0, in mm.
    TravelY,
    /// `$132` The travel of z from its upper stop to height 127.
    TravelZ,
    /// `$200` The time from a change of a direction pin to the step pulse.
    DirectionSetup,
    /// `$201` The speed along the path with the pen down.
    DrawSpeed,
    /// `$202` The speed along the path with the pen up.
    TravelSpeed,
    /// `$203` Whether the machine slows down in the bends of dense polylines so that the
    /// centripetal acceleration stays within the limit.
    Centripetal,
    /// `$204` The greatest jerk along the path, which is the rate of change of the acceleration; at
    /// least 0.1, or 0 for no limit.
    Jerk,
    /// `$205` Whether a line is drawn at one speed between its ends and its sharp corners: the
    /// greatest that its bends allow. It is for drawings, not for lines of G-code.
    SteadySpeed,
    /// `$206` What moves the pen in G-code: 0 what the program shows, 1 M3 and M5, 2 Z, 3 S.
    PenMode,
    /// `$207` The Z at which the pen is down, and on the side that `$208` says.
    PenZ,
    /// `$208` Whether the pen is down above that Z, and if Z rises (G91). Otherwise below.
    PenZAbove,
    /// `$209` How the pen is lifted: 0 by a servo or a solenoid, 1 by a stepper motor on z.
    Tool,
    /// `$210` The height of the raised pen, from 0 (highest) to 127.
    PenUpHeight,
    /// `$211` The height of the lowered pen, from 0 (highest) to 127.
    PenDownHeight,
    /// `$212` The dwell from the command to raise the pen to the first move.
    PenUpDwell,
    /// `$213` The dwell from the command to lower the pen to the first move.
    PenDownDwell,
    /// `$214` The time in which the pen moves in small steps from one end of its range of heights
    /// to the other; 0 if it moves at once.
    PenRamp,
    /// `$215` The length of ink after which the machine pauses at the end of a stroke; 0 for never.
    InkBeforePause,
    /// `$216` The S at which the pen is down, and on the side that `$217` says.
    PenS,
    /// `$217` Whether the pen is down below that S. Otherwise above.
    PenSBelow,
    /// `$218` For how long no byte may come from the computer before a drawing that the plotter has
    /// computed holds until one comes; 0 if it never holds.
    #[cfg(feature = "hold-in-silence")]
    SilenceBeforeHold,
    /// `$219` How much of a stroke is drawn from one point at which the machine rests, to keep how
    /// far it has come, to the next. 0 if it does not rest.
    PointDistance,
    /// `$220` The length of the dots and gaps of a dotted line. A dash is three dots long.
    DotLength,
    /// `$221` By how much a closed stroke of a drawing goes on beyond its end, along its beginning.
    StrokeOverlap,
    /// `$222` How far before its first point an open stroke of a drawing begins.
    StrokeLead,
    /// `$223` How far behind its last point an open stroke of a drawing ends.
    StrokeTrail,
    /// `$224` How long before a travel ends the pen is told to go down, at most; no longer than it
    /// takes.
    #[cfg(feature = "pen-overlap")]
    PenDownEarly,
    /// `$225` How long before the pen is up a travel begins; no longer than `$212`.
    #[cfg(feature = "pen-overlap")]
    TravelEarly,
    /// `$226` How motion is shaped so that the machine does not shake: 0 not at all, 1 ZV, 2 ZVD,
    /// 3 EI.
    #[cfg(feature = "input-shaping")]
    Shaper,
    /// `$227` The frequency at which x shakes; 0 if x is not shaped.
    #[cfg(feature = "input-shaping")]
    ShakeX,
    /// `$228` The frequency at which y shakes; 0 if y is not shaped.
    #[cfg(feature = "input-shaping")]
    ShakeY,
    /// `$229` The damping ratio: how soon the shaking ends by itself.
    #[cfg(feature = "input-shaping")]
    Damping,
    /// `$230` The kinematics of the machine: 0 Cartesian, 1 CoreXY, 2 polargraph.
    Kinematics,
    /// `$231` The distance from the left anchor of the belts to the right one.
    AnchorWidth,
    /// `$232` The horizontal distance from the left anchor to the page's origin, which is to the
    /// right of it.
    AnchorLeft,
    /// `$233` The height of the anchors above the origin.
    AnchorHeight,
    /// `$234` The length of a belt when it is homed, in mm.
    HomedBelt,
    /// `$235` The backlash of x: the travel that is lost when its motor reverses.
    BacklashX,
    /// `$236` The backlash of y, or of the second motor.
    BacklashY,
    /// `$237` The distance along a stroke within which backlash is taken up while the pen draws on;
    /// 0 to take it up at rest.
    #[cfg(feature = "spread-backlash")]
    BacklashDistance,
    /// `$238` How far the pen may be off the line where motion is shaped; 0 for no limit.
    #[cfg(feature = "input-shaping")]
    ShapingDeviation,
    /// `$240` The x coordinate at which the pen is parked (G28).
    ParkX,
    /// `$241` The y coordinate at which the pen is parked (G28).
    ParkY,
}

/// The description of a setting: what its row in the table says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingInfo {
    /// The setting that this row of the table describes.
    pub setting: Setting,
    /// The number by which the user changes it, below 256; see [`SettingInfo::number`].
    number: u8,
    /// The name of the setting, as the list printed by `$$` shows it.
    pub name: &'static str,
    /// The index of the unit in [`UNITS`]; see [`SettingInfo::unit`].
    unit: u8,
    /// The least value that the setting may have.
    pub least: Value,
    /// The greatest value that the setting may have.
    pub greatest: Value,
    /// The value that it has until the user changes it.
    pub default: Value,
    /// Whether the setting takes whole numbers only.
    pub whole: bool,
}

impl SettingInfo {
    /// The number by which the user changes the setting, as in `$100=80`.
    pub const fn number(&self) -> u16 {
        self.number as u16
    }

    /// The unit; empty for a plain number.
    pub fn unit(&self) -> &'static str {
        UNITS.get(usize::from(self.unit)).copied().unwrap_or("")
    }
}

/// All units of settings. A row holds the index of its unit, which takes less flash than a text.
const UNITS: [&str; 16] = [
    "", "us", "ms", "s", "mm", "m", "mm/min", "mm/s2", "m/s3", "step/mm", "mask", "0|1", "0|1|2",
    "0|1|2|3", "of 127", "Hz",
];

/// Returns the index of a unit. A unit that is not among them does not compile.
const fn unit_index(unit: &str) -> u8 {
    let mut index = 0;
    loop {
        let (one, other) = (UNITS[index].as_bytes(), unit.as_bytes());
        let mut equal = 0;
        while equal < one.len() && equal < other.len() && one[equal] == other[equal] {
            equal += 1;
        }
        if equal == one.len() && equal == other.len() {
            return index as u8;
        }
        index += 1;
    }
}

/// Makes a row; the range is the least, the greatest and the default value.
const fn row(
    setting: Setting,
    number: u8,
    name: &'static str,
    unit: &'static str,
    (least, greatest, default): (f64, f64, f64),
    whole: bool,
) -> SettingInfo {
    // The number is rounded to the nearest value, as a value that is sent is.
    const fn value(number: f64) -> Value {
        let half = if number < 0.0 { -0.5 } else { 0.5 };
        Value::from_bits((number * 65536.0 + half) as i32)
    }
    SettingInfo {
        setting,
        number,
        name,
        unit: unit_index(unit),
        least: value(least),
        greatest: value(greatest),
        default: value(default),
        whole,
    }
}

/// Whether the board can invert the pins of the drivers, and switches them off at rest. On other
/// boards these settings have one value.
const DRIVER_PINS: bool = cfg!(feature = "driver-pins");
/// The names of [`Setting::StepIdleDelay`], [`Setting::InvertSteps`] and [`Setting::InvertEnable`].
const DRIVER_NAMES: [&str; 3] = if DRIVER_PINS {
    ["drivers off after a move: 255 is never", "invert step pulses", "invert enable pin"]
} else {
    [
        "drivers off after a move (never on this board)",
        "invert step pulses (not on this board)",
        "invert enable pin (not on this board)",
    ]
};
/// The least and the greatest value, and the default, of the same settings.
const DRIVER_RANGES: [(f64, f64, f64); 3] = if DRIVER_PINS {
    [(0.0, 255.0, 255.0), (0.0, 7.0, 0.0), (0.0, 1.0, 0.0)]
} else {
    [(255.0, 255.0, 255.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
};

/// Whether the board keeps how far a job has come. On other boards [`Setting::PointDistance`] has
/// one value.
const KEEPS_POINTS: bool = cfg!(feature = "resume");
/// The name of [`Setting::PointDistance`].
const POINT_NAME: &str =
    if KEEPS_POINTS { "within a line keep the point reached each" } else { "(not on this board)" };
/// The least and the greatest value of such a setting, and its default.
const POINT_RANGE: (f64, f64, f64) =
    if KEEPS_POINTS { (0.0, 10000.0, 0.0) } else { (0.0, 0.0, 0.0) };

/// All settings, sorted by number: number, name, unit, range with default, and whether only whole
/// numbers are allowed.
#[rustfmt::skip] // a table
pub const SETTINGS: &[SettingInfo] = {
    use Setting::*;
    &[
        row(StepPulse, 0, "step pulse length", "us", (0.2, 500.0, 2.0), false),
        row(StepIdleDelay, 1, DRIVER_NAMES[0], "ms", DRIVER_RANGES[0], true),
        row(InvertSteps, 2, DRIVER_NAMES[1], "mask", DRIVER_RANGES[1], true),
        row(InvertDirections, 3, "invert directions", "mask", (0.0, 7.0, 0.0), true),
        row(InvertEnable, 4, DRIVER_NAMES[2], "0|1", DRIVER_RANGES[2], true),
        row(InvertContacts, 5, "invert contacts", "mask", (0.0, 7.0, 0.0), true),
        row(InvertProbe, 6, "invert probe; there is none", "0|1", (0.0, 1.0, 0.0), true),
        row(StatusReport, 10, "status report", "mask", (0.0, 3.0, 1.0), true),
        row(JunctionDeviation, 11, "junction deviation", "mm", (0.0, 1.0, 0.05), false),
        row(ArcTolerance, 12, "arc tolerance, or half a step", "mm", (0.0, 10.0, 0.002), false),
        row(ReportInches, 13, "report in inches", "0|1", (0.0, 1.0, 0.0), true),
        row(SoftLimits, 20, "soft limits", "0|1", (0.0, 1.0, 1.0), true),
        row(HardLimits, 21, "hard limits", "0|1", (0.0, 1.0, 0.0), true),
        row(Homing, 22, "homing", "0|1", (0.0, 1.0, 0.0), true),
        row(HomingDirection, 23, "switches at the low end", "mask", (0.0, 3.0, 3.0), true),
        row(HomingFeed, 24, "homing speed, slow approach", "mm/min", (1.0, 32767.0, 60.0), false),
        row(HomingSeek, 25, "homing speed, fast approach", "mm/min", (1.0, 32767.0, 1500.0), false),
        row(HomingDebounce, 26, "homing pause for the switches", "ms", (0.0, 1000.0, 0.0), false),
        row(HomingPullOff, 27, "homing pull-off", "mm", (0.1, 50.0, 2.0), false),
        row(MaxSpindle, 30, "greatest S", "", (1.0, 32767.0, 1000.0), false),
        row(MinSpindle, 31, "least S", "", (0.0, 32767.0, 0.0), false),
        row(Laser, 32, "pen as a laser: by G1 with S", "0|1", (0.0, 1.0, 0.0), true),
        row(StepsPerMmX, 100, "steps per mm of x", "step/mm", (2.0, 4000.0, 80.0), false),
        row(StepsPerMmY, 101, "steps per mm of y", "step/mm", (2.0, 4000.0, 80.0), false),
        row(StepsPerMmZ, 102, "steps per mm of z", "step/mm", (2.0, 4000.0, 400.0), false),
        row(MaxRateX, 110, "maximum speed of x", "mm/min", (1.0, 32767.0, 6000.0), false),
        row(MaxRateY, 111, "maximum speed of y", "mm/min", (1.0, 32767.0, 6000.0), false),
        row(MaxRateZ, 112, "maximum speed of z", "mm/min", (1.0, 32767.0, 300.0), false),
        row(AccelerationX, 120, "acceleration of x", "mm/s2", (10.0, 32767.0, 800.0), false),
        row(AccelerationY, 121, "acceleration of y", "mm/s2", (10.0, 32767.0, 800.0), false),
        row(AccelerationZ, 122, "acceleration of z", "mm/s2", (10.0, 32767.0, 50.0), false),
        row(TravelX, 130, "travel of x", "mm", (1.0, 8000.0, 420.0), false),
        row(TravelY, 131, "travel of y", "mm", (1.0, 8000.0, 420.0), false),
        row(TravelZ, 132, "travel of z", "mm", (0.1, 50.0, 4.0), false),
        row(DirectionSetup, 200, "direction setup time", "us", (0.1, 500.0, 1.0), false),
        row(DrawSpeed, 201, "drawing speed", "mm/min", (1.0, 32767.0, 3000.0), false),
        row(TravelSpeed, 202, "travel speed", "mm/min", (1.0, 32767.0, 6000.0), false),
        row(Centripetal, 203, "limit speed by curvature", "0|1", (0.0, 1.0, 1.0), true),
        row(Jerk, 204, "jerk", "m/s3", (0.0, 1000.0, 0.0), false),
        row(SteadySpeed, 205, "one speed along a line of a drawing", "0|1", (0.0, 1.0, 0.0), true),
        row(PenMode, 206, "pen by: auto, M3 and M5, Z, S", "0|1|2|3", (0.0, 3.0, 0.0), true),
        row(PenZ, 207, "pen down at Z", "mm", (-1000.0, 1000.0, 0.0), false),
        row(PenZAbove, 208, "pen down at lower Z, higher Z", "0|1", (0.0, 1.0, 0.0), true),
        row(Tool, 209, "pen lifted by a stepper", "0|1", (0.0, 1.0, 0.0), true),
        row(PenUpHeight, 210, "height of the raised pen", "of 127", (0.0, 127.0, 0.0), true),
        row(PenDownHeight, 211, "height of the lowered pen", "of 127", (0.0, 127.0, 127.0), true),
        row(PenUpDwell, 212, "dwell after raising the pen", "ms", (1.0, 1300.0, 150.0), false),
        row(PenDownDwell, 213, "dwell after lowering the pen", "ms", (1.0, 1300.0, 150.0), false),
        row(PenRamp, 214, "pen ramp time", "ms", (0.0, 5000.0, 0.0), false),
        row(InkBeforePause, 215, "drawn length before a pause", "m", (0.0, 10000.0, 0.0), false),
        row(PenS, 216, "pen down at S", "", (0.0, 32767.0, 45.0), false),
        row(PenSBelow, 217, "pen down at higher S, lower S", "0|1", (0.0, 1.0, 0.0), true),
        #[cfg(feature = "hold-in-silence")]
        row(
            SilenceBeforeHold,
            218,
            "silence before a drawing waits",
            "s",
            (0.0, 3600.0, 0.0),
            true,
        ),
        row(PointDistance, 219, POINT_NAME, "m", POINT_RANGE, false),
        row(DotLength, 220, "length of a dot", "mm", (0.1, 100.0, 1.0), false),
        row(StrokeOverlap, 221, "closed lines go on by", "mm", (0.0, 10.0, 0.0), false),
        row(StrokeLead, 222, "open lines begin early by", "mm", (0.0, 10.0, 0.0), false),
        row(StrokeTrail, 223, "open lines end late by", "mm", (0.0, 10.0, 0.0), false),
        #[cfg(feature = "pen-overlap")]
        row(
            PenDownEarly,
            224,
            "pen goes down before a travel ends",
            "ms",
            (0.0, 500.0, 0.0),
            false,
        ),
        #[cfg(feature = "pen-overlap")]
        row(TravelEarly, 225, "travel begins before the pen is up", "ms", (0.0, 500.0, 0.0), false),
        #[cfg(feature = "input-shaping")]
        row(Shaper, 226, "input shaping: off, ZV, ZVD, EI", "0|1|2|3", (0.0, 3.0, 0.0), true),
        #[cfg(feature = "input-shaping")]
        row(ShakeX, 227, "x shakes at", "Hz", (0.0, 500.0, 40.0), false),
        #[cfg(feature = "input-shaping")]
        row(ShakeY, 228, "y shakes at", "Hz", (0.0, 500.0, 40.0), false),
        #[cfg(feature = "input-shaping")]
        row(Damping, 229, "damping ratio of the shaking", "", (0.0, 0.5, 0.1), false),
        row(Kinematics, 230, "kinematics", "0|1|2", (0.0, 2.0, 0.0), true),
        row(AnchorWidth, 231, "distance between anchors", "mm", (100.0, 8000.0, 800.0), false),
        row(AnchorLeft, 232, "left anchor to the origin", "mm", (0.0, 8000.0, 190.0), false),
        row(AnchorHeight, 233, "anchors above the origin", "mm", (10.0, 8000.0, 700.0), false),
        row(HomedBelt, 234, "belt length when homed", "mm", (10.0, 8000.0, 500.0), false),
        row(BacklashX, 235, "backlash of x", "mm", (0.0, 10.0, 0.0), false),
        row(BacklashY, 236, "backlash of y", "mm", (0.0, 10.0, 0.0), false),
        #[cfg(feature = "spread-backlash")]
        row(BacklashDistance, 237, "backlash taken up within", "mm", (0.0, 10.0, 0.0), false),
        #[cfg(feature = "input-shaping")]
        row(ShapingDeviation, 238, "shaping rounds lines by", "mm", (0.0, 10.0, 0.25), false),
        row(ParkX, 240, "park at x", "mm", (0.0, 8000.0, 0.0), false),
        row(ParkY, 241, "park at y", "mm", (0.0, 8000.0, 0.0), false),
    ]
};

// A row in the wrong place or a default out of its range does not compile.
const _: () = {
    let mut index = 0;
    while index < SETTINGS.len() {
        let row = &SETTINGS[index];
        assert!(row.setting as usize == index, "the rows have another order than the settings");
        assert!(index == 0 || row.number > SETTINGS[index - 1].number, "rows not sorted by number");
        let default = row.default.to_bits();
        assert!(row.least.to_bits() <= default && default <= row.greatest.to_bits());
        index += 1;
    }
};

impl Setting {
    /// Returns the row of the table that describes this setting.
    pub const fn info(self) -> &'static SettingInfo {
        &SETTINGS[self as usize]
    }

    /// The setting with this number, or `None` if there is none.
    ///
    /// ```
    /// use penup::machine::Setting;
    /// assert_eq!(Setting::numbered(100), Some(Setting::StepsPerMmX));
    /// assert_eq!(Setting::numbered(99), None);
    /// ```
    pub fn numbered(number: u16) -> Option<Self> {
        let index = SETTINGS.binary_search_by_key(&number, |info| info.number());
        Some(SETTINGS.get(index.ok()?)?.setting)
    }
}
