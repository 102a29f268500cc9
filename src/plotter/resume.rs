//! Jobs that go on where a loss of power, a reset or a fault has stopped them: `$resume`.
//!
//! The strokes of a job are kept before the pen moves (`records`). While they are drawn, the
//! board keeps how many are done, and what the drawing depends on: the version of the firmware, the
//! settings that decide where ink falls, and the model. If one of these has changed, the job is not
//! continued, because its parts would not fit together.
//!
//! After a restart the machine does not know where the pen is. It must be homed, or the user puts
//! the pen at the origin by hand and says so.
//!
//! Without the feature `resume` nothing of this takes space in an image.

#[cfg(feature = "resume")]
use super::Reply;
use super::{Board, Inner};
use crate::index::Index;

/// What is known of the job that could go on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Resumption {
    /// How many strokes of the kept job are drawn, and how many there are; `None` if there is no
    /// job of which that is kept.
    #[cfg(feature = "resume")]
    progress: Option<[u32; 2]>,
    /// Whether the position of the pen is not known since the job stopped.
    #[cfg(feature = "resume")]
    is_lost: bool,
}

#[cfg(feature = "resume")]
mod with_feature {
    #[cfg(feature = "early-ink")]
    use super::super::NotStored;
    use super::{Board, Index, Inner, Reply, Resumption};
    use crate::checksum::Crc32;
    use crate::machine::{Path, Setting, Settings, State, Value};
    use crate::plotter::listener::MeasuredStrokes;
    use crate::plotter::records;
    use crate::protocol::CommandError;
    use crate::stage::Cancel;
    use crate::storage::Noted;

    /// The settings that decide where ink falls, so that they must be the same in all parts of a
    /// drawing.
    const PLACING: [Setting; 16] = [
        Setting::InvertDirections,
        Setting::HomingPullOff,
        Setting::StepsPerMmX,
        Setting::StepsPerMmY,
        Setting::PointDistance,
        Setting::DotLength,
        Setting::Kinematics,
        Setting::AnchorWidth,
        Setting::AnchorLeft,
        Setting::AnchorHeight,
        Setting::HomedBelt,
        Setting::BacklashX,
        Setting::BacklashY,
        Setting::StrokeOverlap,
        Setting::StrokeLead,
        Setting::StrokeTrail,
    ];

    /// A mark at the beginning of the notes; those with another layout have another mark.
    const LAYOUT: u32 = u32::from_le_bytes(*b"run2");
    /// Number of words before the settings: layout, version, strokes, whether the model is known,
    /// and the checksums of model and options.
    const HEAD: usize = 6;
    /// Size of the notes in words: each setting takes two.
    const WORDS: usize = HEAD + 2 * PLACING.len();
    const _: () = assert!(WORDS * size_of::<u32>() <= crate::storage::NOTE_BYTES);

    /// The notes that are kept with the progress of a job.
    type Notes = [[u8; 4]; WORDS];

    /// A number that differs between versions of the firmware.
    fn version() -> u32 {
        let mut digest = Crc32::new();
        digest.update(env!("CARGO_PKG_VERSION").as_bytes());
        digest.finalize()
    }

    /// The notes of a job of so many strokes. `contents` are the checksums of the model and of the
    /// options from which it was computed, if they are known.
    fn begin_notes(settings: &Settings, strokes: u32, contents: Option<[u32; 2]>) -> Notes {
        let [model, options] = contents.unwrap_or_default();
        let head = [LAYOUT, version(), strokes, u32::from(contents.is_some()), model, options];
        let settings = PLACING.into_iter().flat_map(|setting| {
            [setting.info().number.into(), settings.get(setting).to_bits().cast_unsigned()]
        });
        let mut notes: Notes = [[0; 4]; WORDS];
        for (slot, word) in notes.iter_mut().zip(head.into_iter().chain(settings)) {
            *slot = word.to_le_bytes();
        }
        notes
    }

    impl Resumption {
        /// How many strokes of a job that has stopped are drawn, and how many there are.
        pub(in crate::plotter) fn stopped(&self, state: State) -> Option<[u32; 2]> {
            let is_over = !matches!(state, State::Run | State::Hold { .. } | State::Abort);
            self.progress.filter(|[done, all]| is_over && done < all)
        }

        /// Whether the board keeps how far the job comes.
        #[cfg(feature = "early-ink")]
        pub(in crate::plotter) fn keeps(&self) -> bool {
            self.progress.is_some()
        }

        /// Whether the position of the pen is not known since the job stopped.
        pub(in crate::plotter) fn lose_position(&mut self) {
            self.is_lost = true;
        }

        /// The machine has been homed.
        pub(in crate::plotter) fn find_position(&mut self) {
            self.is_lost = false;
        }

        /// Reports a job that has stopped, if there is one.
        pub(in crate::plotter) fn report<B: Board>(&self, state: State, board: &mut B) {
            let Some([done, all]) = self.stopped(state) else { return };
            Reply(board).line(format_args!(
                "[MSG:a job stopped at stroke {} of {all}: $resume goes on]",
                done + 1
            ));
        }
    }

    impl<I: Index> Inner<'_, I> {
        /// The order of the job has become known, and with it the number of strokes. `kept` says
        /// whether the flash has taken it.
        #[cfg(feature = "early-ink")]
        #[inline(never)] // Keeps its frame off the stack while the stages run.
        pub(in crate::plotter) fn order_kept<B: Board>(
            &mut self,
            strokes: u32,
            kept: Result<(), NotStored>,
            board: &mut B,
        ) {
            if kept.is_err() {
                self.machine.end_log();
                self.resumption.progress = None;
                return refuse(board);
            }
            if let Some([_, all]) = &mut self.resumption.progress {
                *all = strokes;
            }
        }

        /// Looks for a job that the last run of the firmware did not finish.
        #[inline(never)] // Keeps its frame off the stack while the stages run.
        pub(in crate::plotter) fn find_stopped<B: Board>(&mut self, board: &mut B) {
            self.resumption.progress =
                read(board).map(|(notes, noted)| [noted.parts, all_strokes(&notes, board)]);
            self.resumption.is_lost = true;
        }

        /// Begins to keep how far the job comes that has just begun. `contents` as for
        /// [`begin_notes`].
        #[inline(never)] // Keeps its frame off the stack while the stages run.
        pub(in crate::plotter) fn keep_progress<B: Board>(
            &mut self,
            contents: Option<[u32; 2]>,
            board: &mut B,
        ) {
            self.resumption = Resumption::default();
            if self.machine.state() != State::Run || !board.keeps_progress() {
                return;
            }
            let strokes = self.machine.status().job.strokes;
            let notes = begin_notes(self.machine.settings(), strokes, contents);
            if board.begin_progress(notes.as_flattened(), strokes).is_err() {
                return refuse(board);
            }
            self.machine.log_strokes(0);
            self.resumption.progress = Some([0, strokes]);
        }

        /// Keeps that a stroke has been drawn, or that a point within one has been passed, if the
        /// pins have just done so and stand.
        #[inline(always)] // It is called in every turn of the main loop.
        pub(in crate::plotter) fn note_progress<B: Board>(&mut self, board: &mut B) {
            if let Some(points) = self.machine.point_to_note() {
                self.note_point(points, board);
            }
            if self.machine.may_note_stroke()
                && let Some(strokes) = self.machine.stroke_to_note()
            {
                self.note_stroke(strokes, board);
            }
        }

        /// Keeps that so many strokes have been drawn.
        #[inline(never)] // Inlined, it would take room in the main loop.
        fn note_stroke<B: Board>(&mut self, strokes: u32, board: &mut B) {
            if board.note_progress(strokes).is_err() {
                self.machine.end_log();
                self.resumption.progress = None;
                return refuse(board);
            }
            self.machine.stroke_noted();
            if let Some([done, _]) = &mut self.resumption.progress {
                *done = strokes;
            }
        }

        /// Keeps that so many points within strokes have been passed.
        #[inline(never)] // Inlined, it would take room in the main loop.
        fn note_point<B: Board>(&mut self, points: u32, board: &mut B) {
            let kept = board.note_point(points);
            self.machine.point_noted();
            if kept.is_err() {
                self.machine.end_log();
                self.resumption.progress = None;
                refuse(board);
            }
        }

        /// Loads the job that has stopped, and returns how much of it is drawn. With `at_origin`
        /// the user has put the pen at the origin.
        ///
        /// # Errors
        /// [`CommandError::NothingToResume`] if no job has stopped, or the reason why it cannot go
        /// on. The job stays kept.
        #[inline(never)] // Keeps its frame off the stack while the stages run.
        pub(in crate::plotter) fn load_stopped<B: Board>(
            &mut self,
            at_origin: bool,
            board: &mut B,
        ) -> Result<Noted, CommandError> {
            let (notes, noted) = read(board).ok_or(CommandError::NothingToResume)?;
            let all = all_strokes(&notes, board);
            if noted.parts >= all {
                return Err(CommandError::NothingToResume);
            }
            self.check_notes(&notes)?;
            if self.resumption.is_lost && !at_origin {
                return Err(CommandError::PositionUnknown);
            }
            self.copy_words = 0;
            self.job = Default::default();
            self.cursor = Default::default();
            self.job = records::load_job(self.machine.settings(), self.words, board)?;
            if at_origin {
                self.machine.declare_origin()?;
            }
            self.resumption = Resumption { progress: Some([noted.parts, all]), is_lost: false };
            Ok(noted)
        }

        /// Checks that what a job depends on is as it was when the job began.
        fn check_notes(&self, notes: &Notes) -> Result<(), CommandError> {
            let [_, found_version, _, is_known, model, _, settings @ ..] =
                notes.map(u32::from_le_bytes);
            if found_version != version() {
                return Err(CommandError::OtherVersion);
            }
            for pair in settings.as_chunks::<2>().0 {
                let [number, bits] = *pair;
                let setting = u16::try_from(number).ok().and_then(Setting::numbered);
                let before = Value::from_bits(bits.cast_signed());
                match setting {
                    Some(setting) if self.machine.settings().get(setting) == before => {}
                    Some(setting) => return Err(CommandError::OtherSetting { setting, before }),
                    None => return Err(CommandError::OtherVersion),
                }
            }
            let is_empty = self.model.vertices().is_empty();
            if is_known != 0 && !is_empty && model != self.model.checksum() {
                return Err(CommandError::OtherModel);
            }
            Ok(())
        }

        /// Hands the rest of the job to the machine, of which so much is `drawn`.
        ///
        /// # Errors
        /// The machine's refusal, or [`CommandError::Aborted`].
        #[inline(never)] // Keeps its frame off the stack while the stages run.
        pub(in crate::plotter) fn begin_rest(
            &mut self,
            drawn: Noted,
            cancel: &mut dyn Cancel,
        ) -> Result<(), CommandError> {
            let ends = self.machine.stroke_ends();
            let strokes = self.job.strokes(self.words, &mut self.cursor, ends);
            let mut strokes = MeasuredStrokes { strokes, cancel, targets: 0, aborted: false };
            let whole = self.machine.measure_whole(&mut strokes)?;
            if strokes.aborted {
                return Err(CommandError::Aborted);
            }
            if !strokes.strokes.begin_at(drawn.parts) {
                return Err(CommandError::NoJobKept);
            }
            let (mut points, distance) = (0, self.machine.point_distance());
            if drawn.points > 0 && distance > 0 {
                let length = |ends| self.machine.length(ends);
                let Noted { parts, points: passed } = drawn;
                points = strokes.strokes.begin_at_point(parts, passed, distance, &length);
            }
            self.machine.start_rest(&mut strokes, whole)?;
            if strokes.aborted {
                self.machine.abort();
                return Err(CommandError::Aborted);
            }
            strokes.strokes.rewind();
            if self.machine.state() == State::Run {
                self.machine.log_strokes(points);
            }
            Ok(())
        }
    }

    /// Reads the notes of the kept job, and how much of it is drawn.
    fn read<B: Board>(board: &mut B) -> Option<(Notes, Noted)> {
        let mut notes: Notes = [[0; 4]; WORDS];
        let (length, noted) = board.progress(notes.as_flattened_mut())?;
        let [layout, ..] = notes.map(u32::from_le_bytes);
        (length == size_of::<Notes>() && layout == LAYOUT).then_some((notes, noted))
    }

    /// The number of strokes of the kept job. Of a job that began before its order was known, the
    /// notes have an estimate, and the order the number.
    fn all_strokes<B: Board>(notes: &Notes, board: &mut B) -> u32 {
        #[cfg(feature = "early-ink")]
        if let Some(strokes) = records::strokes_of_added_order(board) {
            return strokes;
        }
        let _ = board;
        strokes(notes)
    }

    /// The number of strokes of a job, as its notes have it.
    fn strokes(notes: &Notes) -> u32 {
        let [_, _, strokes, ..] = notes.map(u32::from_le_bytes);
        strokes
    }

    /// Tells the user that a job cannot go on after a loss of power.
    fn refuse<B: Board>(board: &mut B) {
        Reply(board).line(format_args!(
            "[MSG:$resume will not go on with this: the flash does not take how far it comes]"
        ));
    }
}

/// Without the feature, no job goes on.
#[cfg(not(feature = "resume"))]
mod without_feature {
    use super::{Board, Index, Inner, Resumption};
    use crate::machine::State;

    impl Resumption {
        /// How many strokes of a job that has stopped are drawn, and how many there are: none.
        pub(in crate::plotter) const fn stopped(&self, _: State) -> Option<[u32; 2]> {
            None
        }

        /// The position of the pen is not known.
        pub(in crate::plotter) const fn lose_position(&mut self) {}

        /// The machine has been homed.
        pub(in crate::plotter) const fn find_position(&mut self) {}

        /// Reports a job that has stopped: there is none.
        pub(in crate::plotter) const fn report<B: Board>(&self, _: State, _: &mut B) {}
    }

    impl<I: Index> Inner<'_, I> {
        /// Looks for a job that has stopped: there is none.
        pub(in crate::plotter) const fn find_stopped<B: Board>(&mut self, _: &mut B) {}

        /// Keeps how far the job comes: it is not kept.
        pub(in crate::plotter) const fn keep_progress<B: Board>(
            &mut self,
            _: Option<[u32; 2]>,
            _: &mut B,
        ) {
        }

        /// Keeps that a stroke has been drawn: it is not kept.
        pub(in crate::plotter) const fn note_progress<B: Board>(&mut self, _: &mut B) {}
    }
}
