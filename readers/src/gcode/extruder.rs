//! The extruder of a 3D printer, the axis E: only a move during which it pushes leaves a line.

use super::moves::Moves;

/// Where the extruder stands.
#[derive(Debug, Default)]
pub(super) struct Extruder {
    at: f64,
    /// Whether E is a distance (`M83`) rather than a position (`M82`).
    pub is_relative: bool,
}

impl Extruder {
    /// Turns the extruder by the value of E, which is a distance in relative moves (`G91`), too.
    /// Returns whether it pushes.
    pub fn advance(&mut self, value: f64, in_relative_moves: bool) -> bool {
        let before = self.at;
        self.at = if self.is_relative || in_relative_moves { before + value } else { value };
        self.at > before
    }

    /// Calls the present position `value` (`G92`).
    pub fn set(&mut self, value: f64) {
        self.at = value;
    }
}

/// Says what of a program for a 3D printer is drawn; `None` if no move extrudes.
pub(super) fn note(moves: &Moves) -> Option<String> {
    let extruding = moves.iter().filter(|it| it.signals.extrudes);
    let count = extruding.clone().count();
    if count == 0 {
        return None;
    }
    let others = match moves.len() - count {
        1 => "1 move is not".to_owned(),
        others => format!("{others} moves are not"),
    };
    let mut heights: Vec<f64> = extruding.filter_map(|it| it.signals.height).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let layers = match heights.len() {
        0 | 1 => String::new(),
        layers => format!(", and its layers at {layers} heights lie one upon the other"),
    };
    Some(format!(
        "the program is for a 3D printer: only what it extrudes is drawn, {others}{layers}"
    ))
}
