//! The notes that are kept with the progress of a job: what the drawing depends on, and how many
//! strokes it has.

use super::super::Origin;
#[cfg(feature = "tiles")]
use super::parts::drawn_in_parts;
use crate::checksum::Crc32;
use crate::index::Index;
use crate::machine::{Setting, Settings, Value};
use crate::plotter::{Board, Inner, records};
use crate::protocol::CommandError;
use crate::storage::LogProgress;

/// The settings that decide where a homed machine has its origin. Of the travel that is [`placed`].
const ORIGIN: [Setting; 12] = [
    Setting::InvertDirections,
    Setting::HomingDirection,
    Setting::TravelX,
    Setting::TravelY,
    Setting::HomingPullOff,
    Setting::StepsPerMmX,
    Setting::StepsPerMmY,
    Setting::Kinematics,
    Setting::AnchorWidth,
    Setting::AnchorLeft,
    Setting::AnchorHeight,
    Setting::HomedBelt,
];
/// The other settings that decide where ink falls. All of them must be the same in all parts of a
/// drawing.
const STROKES: [Setting; 7] = [
    Setting::PointDistance,
    Setting::DotLength,
    Setting::BacklashX,
    Setting::BacklashY,
    Setting::StrokeOverlap,
    Setting::StrokeLead,
    Setting::StrokeTrail,
];

/// A mark at the beginning of the notes; those with another layout have another mark.
pub(super) const LAYOUT: u32 = u32::from_le_bytes(*b"run5");
/// The mark of the notes of a job that is sent while it is drawn.
pub(super) const STREAMED: u32 = u32::from_le_bytes(*b"str4");
/// The mark of the notes of a drawing that is computed and drawn part by part. Its number of
/// strokes is not known when it begins.
#[cfg(feature = "tiles")]
pub(super) const PARTS: u32 = u32::from_le_bytes(*b"prt4");

/// Number of words before the settings: layout, version, strokes, whether the model is known, the
/// checksums of model and options, that of the firmware's sources, and whether the machine was
/// homed. For a job that is sent the fourth to sixth are how many strokes are noted at once, the
/// number by which its sender knows it, and 0. For a drawing in parts, whose record has all that,
/// they are 0.
const HEAD: usize = 8;
/// Size of the notes in words: each setting takes two.
const WORDS: usize = HEAD + 2 * (ORIGIN.len() + STROKES.len());
const _: () = assert!(WORDS * size_of::<u32>() <= crate::storage::NOTE_BYTES);

/// The notes that are kept with the progress of a job.
type Notes = [[u8; 4]; WORDS];

/// The value of a setting as far as it decides where ink falls. The travel does so only where it is
/// the position of a limit switch, at the high end of an axis.
fn placed(settings: &Settings, setting: Setting) -> Value {
    let low_end = match setting {
        Setting::TravelX => 1,
        Setting::TravelY => 2,
        _ => 0,
    };
    let homes_low = settings.whole(Setting::HomingDirection) & low_end != 0;
    if low_end != 0 && (homes_low || !settings.is_on(Setting::Homing)) {
        return Value::ZERO;
    }
    settings.get(setting)
}

/// The refusal of a job because of a setting whose value was another one `before`, as far as it
/// decides where ink falls. The travel of a machine that homes ends where its switch is; of one
/// that does not, it is no matter. So where only one of the values is 0, homing has changed.
fn changed(setting: Setting, before: Value, now: Value) -> CommandError {
    let is_travel = matches!(setting, Setting::TravelX | Setting::TravelY);
    if is_travel && (before == Value::ZERO) != (now == Value::ZERO) {
        let before = if before == Value::ZERO { Value::ZERO } else { Value::ONE };
        return CommandError::OtherSetting { setting: Setting::Homing, before };
    }
    CommandError::OtherSetting { setting, before }
}

/// A number that differs between versions of the firmware.
fn version() -> u32 {
    let mut digest = Crc32::new();
    digest.update(env!("CARGO_PKG_VERSION").as_bytes());
    digest.finalize()
}

/// The word of notes with this index.
pub(super) fn word(notes: &Notes, index: usize) -> u32 {
    notes.get(index).map_or(0, |word| u32::from_le_bytes(*word))
}

/// Returns the notes of a job of this many strokes, which is drawn from this origin. `layout` is
/// the mark of their layout, and `more` are three words that identify the job.
#[inline(never)] // It is called in several places, and its loop is unrolled.
pub(super) fn begin_notes(
    settings: &Settings,
    layout: u32,
    strokes: u32,
    more: [u32; 3],
    origin: Origin,
) -> Notes {
    let [first, second, third] = more;
    let is_homed = u32::from(origin.is_homed());
    let head = [layout, version(), strokes, first, second, third, records::SOURCES, is_homed];
    let settings = ORIGIN.into_iter().chain(STROKES).flat_map(|setting| {
        [setting.info().number().into(), placed(settings, setting).to_bits().cast_unsigned()]
    });
    let mut notes: Notes = [[0; 4]; WORDS];
    for (slot, word) in notes.iter_mut().zip(head.into_iter().chain(settings)) {
        *slot = word.to_le_bytes();
    }
    notes
}

/// The checksum of the settings that decide where a homed machine has its origin.
#[inline(never)] // It is called in several places, and its loop is unrolled.
pub(super) fn origin_settings(settings: &Settings) -> u32 {
    let mut digest = Crc32::new();
    for setting in ORIGIN {
        digest.update(&placed(settings, setting).to_bits().to_le_bytes());
    }
    digest.finalize()
}

/// Whether the notes are those of a job that is sent while it is drawn.
pub(super) fn is_streamed(notes: &Notes) -> bool {
    word(notes, 0) == STREAMED
}

/// Whether the machine had been homed when the job began.
pub(super) fn began_homed(notes: &Notes) -> bool {
    word(notes, 7) != 0
}

/// Whether the notes are those of a drawing in parts.
#[cfg(feature = "tiles")]
pub(super) fn is_in_parts(notes: &Notes) -> bool {
    word(notes, 0) == PARTS
}

/// Returns the number of strokes of a job with these notes that are drawn, according to its
/// log.
pub(super) fn done(notes: &Notes, noted: LogProgress) -> u32 {
    let (strokes, at_once) = (word(notes, 2), word(notes, 3));
    #[cfg(feature = "tiles")]
    if is_in_parts(notes) {
        return if noted.is_closed { u32::MAX } else { drawn_in_parts(noted.parts) };
    }
    if is_streamed(notes) { noted.parts.saturating_mul(at_once).min(strokes) } else { noted.parts }
}

/// Reads the notes of the kept job, and how much of it is drawn.
pub(super) fn read<B: Board>(board: &mut B) -> Option<(Notes, LogProgress)> {
    let mut notes: Notes = [[0; 4]; WORDS];
    let (length, noted) = board.progress(notes.as_flattened_mut())?;
    let layout = word(&notes, 0);
    let is_known = layout == LAYOUT || layout == STREAMED;
    #[cfg(feature = "tiles")]
    let is_known = is_known || layout == PARTS;
    (length == size_of::<Notes>() && is_known).then_some((notes, noted))
}

/// The number of strokes of the kept job. Of a job that began before its order was known, the
/// order has the number. The notes have an estimate, and there are more strokes than those that are
/// drawn as long as the order is missing, because the job is not complete then.
pub(super) fn all_strokes<B: Board>(notes: &Notes, noted: LogProgress, board: &mut B) -> u32 {
    let strokes = word(notes, 2);
    #[cfg(feature = "early-ink")]
    if word(notes, 0) == LAYOUT {
        return match records::strokes_of_added_order(board) {
            Some(strokes) => strokes,
            None if records::is_begun(board) => estimated_strokes(strokes, done(notes, noted)),
            None => strokes,
        };
    }
    let _ = (board, noted);
    strokes
}

/// The number of strokes of a job whose order is not known, by the estimate in its notes. It has
/// more strokes than those that are `done`.
#[cfg(feature = "early-ink")]
fn estimated_strokes(estimate: u32, done: u32) -> u32 {
    estimate.max(done.saturating_add(1))
}

/// Whether the order of the job with these notes has to be computed again.
#[cfg(feature = "early-ink")]
pub(super) fn is_without_order<B: Board>(notes: &Notes, board: &mut B) -> bool {
    word(notes, 0) == LAYOUT
        && records::is_begun(board)
        && records::strokes_of_added_order(board).is_none()
}

impl<I: Index> Inner<'_, I> {
    /// Checks that what a job depends on is as it was when the job began.
    pub(super) fn check_notes(&self, notes: &Notes) -> Result<(), CommandError> {
        if word(notes, 1) != version() {
            return Err(CommandError::OtherVersion);
        }
        let (is_known, model) = (word(notes, 3), word(notes, 4));
        for at in (HEAD..WORDS).step_by(2) {
            let (number, bits) = (word(notes, at), word(notes, at + 1));
            let setting = u16::try_from(number).ok().and_then(Setting::numbered);
            let before = Value::from_bits(bits.cast_signed());
            let Some(setting) = setting else { return Err(CommandError::OtherVersion) };
            let now = placed(self.machine.settings(), setting);
            if now != before {
                return Err(changed(setting, before, now));
            }
        }
        let is_empty = self.model.vertices().is_empty();
        let is_computed = is_known != 0 && !is_streamed(notes);
        if is_computed && !is_empty && model != self.model.checksum() {
            return Err(CommandError::OtherModel);
        }
        let is_homed = self.resumption.origin(self.machine.settings()).is_homed();
        if is_homed && !began_homed(notes) {
            return Err(CommandError::OtherOrigin);
        }
        Ok(())
    }
}

#[cfg(all(test, feature = "early-ink"))]
mod tests {
    use super::*;

    #[test]
    fn no_number_of_strokes_is_all_of_them_while_that_is_an_estimate() {
        for (done, all) in [(0, 10), (9, 10), (10, 11), (25, 26)] {
            assert_eq!(estimated_strokes(10, done), all, "{done}");
        }
    }
}
