//! A spiral of short chords, the most demanding drawing for the motion planner.

/// The protocol lines that draw a spiral of `chords` chords of 0.05 mm around (20, 20) mm. It
/// begins with `radius`, in mm, and grows by a millimetre per turn. `settings` are sent before it
/// is drawn.
pub fn lines(chords: u16, radius: f64, settings: &[&str]) -> Vec<String> {
    let (mut angle, mut lines) = (0.0f64, Vec::new());
    for _ in 0..=chords {
        let radius = radius + angle / std::f64::consts::TAU;
        let (x, y) = (20.0 + radius * angle.cos(), 20.0 + radius * angle.sin());
        lines.push(format!("v {x:.4} {y:.4} 0"));
        angle += 0.05 / radius;
    }
    for first in (1..=chords).step_by(10) {
        let points = first..=(first + 10).min(chords + 1);
        let points: Vec<_> = points.map(|point| point.to_string()).collect();
        lines.push(format!("l {}", points.join(" ")));
    }
    let fast = ["$0=0.5", "$110=32767", "$111=32767", "$page=45x45", "$margin=1"];
    lines.extend(fast.iter().chain(settings).map(|setting| (*setting).to_owned()));
    lines.push("$plot".to_owned());
    lines
}

/// A spiral drawn at 2800 chords per second, of 180 moves on average: 510,000 steps per second, and
/// 564,000 where one axis moves alone.
pub fn at_half_a_million() -> Vec<String> {
    let settings = ["$100=4000", "$101=4000", "$120=32767", "$121=32767", "$201=8460", "$202=8460"];
    lines(1200, 4.0, &settings)
}
