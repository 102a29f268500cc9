//! What outlives a loss of power.

use super::{Board, Record};
use crate::machine::{SETTING_COUNT, Settings, Value};
use crate::protocol::Refusal;

/// A setting: its number, its value.
const SETTING_BYTES: usize = 6;

/// The settings as they were kept, else the defaults.
#[inline(never)] // Its frame must not lie under the stages'.
pub(super) fn settings<B: Board>(board: &mut B) -> Settings {
    let mut values = heapless::Vec::<(u16, Value), SETTING_COUNT>::new();
    board.recall(Record::Settings, &mut |kept| {
        let mut bytes = [0; SETTING_BYTES];
        // More than there are settings would be of another version: its last ones are not known here.
        while kept.read(&mut bytes) == SETTING_BYTES && !values.is_full() {
            let [a, b, c, d, e, f] = bytes;
            let value = Value::from_bits(i32::from_le_bytes([c, d, e, f]));
            let _ = values.push((u16::from_le_bytes([a, b]), value));
        }
    });
    Settings::restored(values)
}

/// Keeps them.
///
/// # Errors
/// [`Refusal::NotKept`]: they are in force, but those before will be after a loss of power.
#[inline(never)] // Its frame must not lie under the stages'.
pub(super) fn keep_settings<B: Board>(settings: &Settings, board: &mut B) -> Result<(), Refusal> {
    let mut bytes = [0; SETTING_COUNT * SETTING_BYTES];
    for (place, (info, value)) in bytes.chunks_exact_mut(SETTING_BYTES).zip(settings.iter()) {
        place[..2].copy_from_slice(&info.number.to_le_bytes());
        place[2..].copy_from_slice(&value.to_bits().to_le_bytes());
    }
    board.keep(Record::Settings, &[&bytes]).map_err(|_| Refusal::NotKept)
}
