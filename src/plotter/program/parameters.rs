//! What stays when a program ends: the origins of the coordinate systems, the position of G30, the
//! lines that are carried out at the start, and the text of `$I`.

use super::MachinePosition;
use crate::fixed::Millimetres;

/// The number of coordinate systems, G54 to G59.
pub(in crate::plotter) const SYSTEMS: usize = 6;

/// The length of the longest text that is kept, in bytes.
pub(in crate::plotter) const TEXT_LIMIT: usize = 32;

/// A text that is kept.
pub(in crate::plotter) type Text = heapless::String<TEXT_LIMIT, u8>;

/// The parameters that are kept when a program ends.
#[derive(Debug, Clone)]
pub(in crate::plotter) struct Parameters {
    /// The origins of G54 to G59.
    pub(in crate::plotter) systems: [MachinePosition; SYSTEMS],
    /// The position of G30.
    pub(in crate::plotter) second: MachinePosition,
    /// The startup lines `$N0` and `$N1`, and the text of `$I`.
    pub(in crate::plotter) texts: [Text; 3],
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            systems: [[Millimetres::ZERO; 3]; SYSTEMS],
            second: [Millimetres::ZERO; 3],
            texts: [const { Text::new() }; 3],
        }
    }
}

impl Parameters {
    /// The origin of a coordinate system, by its index.
    pub(in crate::plotter) fn system(&self, index: usize) -> MachinePosition {
        self.systems.get(index).copied().unwrap_or_default()
    }
}
