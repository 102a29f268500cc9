//! What a board does that keeps how far jobs come.

use super::{Origin, Resumption};
use crate::checksum::Crc32;
use crate::index::Index;
use crate::machine::{Path, Setting, Settings, State, Value};
#[cfg(feature = "tiles")]
use crate::order::TimeModel;
#[cfg(feature = "tiles")]
use crate::plotter::Layout;
#[cfg(feature = "early-ink")]
use crate::plotter::NotStored;
#[cfg(feature = "tiles")]
use crate::plotter::listener::Listener;
use crate::plotter::listener::MeasuredStrokes;
use crate::plotter::{Board, Inner, Reply, records};
use crate::protocol::CommandError;
use crate::stage::Cancel;
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
const LAYOUT: u32 = u32::from_le_bytes(*b"run5");
/// The mark of the notes of a job that is sent while it is drawn.
const STREAMED: u32 = u32::from_le_bytes(*b"str4");
/// The mark of the notes of a drawing that is computed and drawn part by part. Its number of
/// strokes is not known when it begins.
#[cfg(feature = "tiles")]
const PARTS: u32 = u32::from_le_bytes(*b"prt4");
/// So many first strokes of a drawing in parts are noted one by one.
#[cfg(feature = "tiles")]
const ONE_BY_ONE: u32 = 1 << 14;
/// So many of the others are noted at once.
#[cfg(feature = "tiles")]
const LATER_AT_ONCE: u32 = 32;
/// The most bits of the log by which strokes of a drawing in parts are noted. The last one says
/// that the drawing is complete.
#[cfg(feature = "tiles")]
const MOST_NOTED: u32 = {
    let [log, _] = Layout::from(0, 0).logs;
    log.limit() - 1
};
/// The most strokes that are noted at once.
#[cfg(feature = "stream")]
const MOST_AT_ONCE: u32 = 1 << 12;
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

/// Set in the word that tells whether the model is known, if the number of strokes is an estimate
/// as long as the order is not kept.
const IS_ESTIMATE: u32 = 2;

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

/// A number that differs between versions of the firmware.
fn version() -> u32 {
    let mut digest = Crc32::new();
    digest.update(env!("CARGO_PKG_VERSION").as_bytes());
    digest.finalize()
}

/// The three words of notes that tell what a job was computed from: the checksums of the model
/// and of the options, if they are known.
fn words_of(contents: Option<[u32; 2]>) -> [u32; 3] {
    let [model, options] = contents.unwrap_or_default();
    [u32::from(contents.is_some()), model, options]
}

/// The word of notes with this index.
fn word(notes: &Notes, index: usize) -> u32 {
    notes.get(index).map_or(0, |word| u32::from_le_bytes(*word))
}

/// Returns the notes of a job of this many strokes, which is drawn from this origin. `layout` is
/// the mark of their layout, and `more` are three words that identify the job.
#[inline(never)] // It is called in several places, and its loop is unrolled.
fn begin_notes(
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

/// What `$resume` has found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) enum StoppedJob {
    /// The job lies in the working memory, and this much of it is drawn.
    Loaded(LogProgress),
    /// Its sender has the strokes. The plotter knows no more than that the pen is at the origin.
    Sent,
    /// The job is computed again part by part, and this much of it is drawn.
    #[cfg(feature = "tiles")]
    InParts(KeptParts),
}

/// A drawing in parts that goes on or is drawn again. The options are those with which it began.
#[cfg(feature = "tiles")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) struct KeptParts {
    /// By what the order of each part is chosen.
    pub time_model: TimeModel,
    /// The checksum of the model.
    pub model: u32,
    /// The checksum of the sources of the firmware that began it.
    pub sources: u32,
    /// The number of strokes that are drawn; `None` to begin anew.
    pub drawn: Option<u32>,
}

/// The checksum of the settings that decide where a homed machine has its origin.
#[inline(never)] // It is called in several places, and its loop is unrolled.
fn origin_settings(settings: &Settings) -> u32 {
    let mut digest = Crc32::new();
    for setting in ORIGIN {
        digest.update(&placed(settings, setting).to_bits().to_le_bytes());
    }
    digest.finalize()
}

impl Origin {
    /// Whether the machine has been homed.
    const fn is_homed(self) -> bool {
        matches!(self, Self::Homed(_))
    }
}

impl Resumption {
    /// How many strokes of a job that has stopped are drawn, and how many there are.
    pub(in crate::plotter) fn stopped(&self, state: State) -> Option<[u32; 2]> {
        let is_over = !matches!(state, State::Run | State::Hold { .. } | State::Abort);
        self.progress.filter(|[done, all]| is_over && done < all)
    }

    /// Another job has taken the place of the one that has stopped.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) fn forget(&mut self) {
        self.progress = None;
    }

    /// The job has this many strokes, which was an estimate before.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) const fn count_strokes(&mut self, strokes: u32) {
        if let Some([_, all]) = &mut self.progress {
            *all = strokes;
        }
    }

    /// Whether the board keeps how far the job comes.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) fn keeps(&self) -> bool {
        self.progress.is_some()
    }

    /// How the plotter knows where the pen is. Where the settings have changed with which it was
    /// homed, homing would find another origin, so that it does not.
    fn origin(&self, settings: &Settings) -> Origin {
        match self.origin {
            Origin::Homed(with) if with != origin_settings(settings) => Origin::Lost,
            origin => origin,
        }
    }

    /// What is known when a job begins: nothing but the origin. A user who draws where nobody has
    /// told the plotter where the pen is takes that place for known.
    fn anew(&self, settings: &Settings) -> Self {
        let origin = match self.origin(settings) {
            Origin::Lost => Origin::ByHand,
            known => known,
        };
        Self { origin, ..Self::default() }
    }

    /// The position of the pen is not known any more.
    pub(in crate::plotter) fn lose_position(&mut self) {
        self.origin = Origin::Lost;
    }

    /// The machine has been homed with these settings.
    pub(in crate::plotter) fn find_position(&mut self, settings: &Settings) {
        self.origin = Origin::Homed(origin_settings(settings));
    }

    /// Reports a job that has stopped, if there is one.
    pub(in crate::plotter) fn report<B: Board>(&self, state: State, board: &mut B) {
        let Some([done, all]) = self.stopped(state) else { return };
        let mut reply = Reply(board);
        reply.part(format_args!("[MSG:a job stopped at stroke {}", done.saturating_add(1)));
        if all != u32::MAX {
            reply.part(format_args!(" of {all}"));
        }
        reply.line(format_args!(": $resume goes on]"));
    }

    /// The number of all strokes of a drawing in parts has become known.
    #[cfg(feature = "tiles")]
    pub(in crate::plotter) fn end_parts(&mut self, strokes: u32) {
        if let Some([_, all]) = &mut self.progress {
            *all = strokes.saturating_add(self.drawn_before);
        }
    }
}

impl<I: Index> Inner<'_, I> {
    /// Records that the order of the job has become known, and with it the number of strokes.
    /// `kept` says whether the flash has stored it.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn order_kept<B: Board>(
        &mut self,
        strokes: u32,
        kept: Result<(), NotStored>,
        board: &mut B,
    ) {
        if kept.is_err() {
            return self.end_notes(board);
        }
        if let Some([_, all]) = &mut self.resumption.progress {
            *all = strokes;
        }
    }

    /// Looks for a job that the last run of the firmware did not finish.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn find_stopped<B: Board>(&mut self, board: &mut B) {
        let found = read(board);
        self.resumption.progress =
            found.map(|(notes, noted)| [done(&notes, noted), all_strokes(&notes, noted, board)]);
        self.resumption.lose_position();
    }

    /// Begins to keep how far the job comes that has just begun. `contents` as for
    /// [`begin_notes`].
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_progress<B: Board>(
        &mut self,
        contents: Option<[u32; 2]>,
        board: &mut B,
    ) {
        // A job that is only checked (`$C`) replaces no job that has stopped.
        if self.machine.state() != State::Run {
            return;
        }
        self.resumption = self.resumption.anew(self.machine.settings());
        if !board.keeps_progress() {
            return;
        }
        let strokes = self.machine.status().job.strokes;
        let mut more = words_of(contents);
        #[cfg(feature = "early-ink")]
        if self.job.unordered().is_some() {
            more[0] |= IS_ESTIMATE;
        }
        let origin = self.resumption.origin;
        let notes = begin_notes(self.machine.settings(), LAYOUT, strokes, more, origin);
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

    /// Records in flash that this many strokes have been drawn.
    #[inline(never)] // Inlined, it would take room in the main loop.
    fn note_stroke<B: Board>(&mut self, strokes: u32, board: &mut B) {
        let at_once = self.resumption.more_at_once.saturating_add(1);
        let strokes = strokes.saturating_add(self.resumption.drawn_before);
        let is_end = self.resumption.progress.is_some_and(|[_, all]| strokes == all);
        // The last few strokes count as soon as all of them are drawn.
        let parts = if is_end { strokes.div_ceil(at_once) } else { strokes / at_once };
        #[cfg(feature = "tiles")]
        let parts = match self.resumption.in_parts {
            false => parts,
            true if is_end => u32::MAX,
            true => noted_in_parts(strokes),
        };
        if board.note_progress(parts).is_err() {
            return self.end_notes(board);
        }
        self.machine.stroke_noted();
        #[cfg(feature = "early-ink")]
        let is_estimate = self.pending.is_some();
        #[cfg(not(feature = "early-ink"))]
        let is_estimate = false;
        if let Some([done, all]) = &mut self.resumption.progress {
            *done = strokes;
            if is_estimate {
                *all = (*all).max(strokes.saturating_add(1));
            }
        }
    }

    /// Records in flash that this many points within strokes have been passed.
    #[inline(never)] // Inlined, it would take room in the main loop.
    fn note_point<B: Board>(&mut self, points: u32, board: &mut B) {
        let kept = board.note_point(points);
        self.machine.point_noted();
        if kept.is_err() {
            self.end_notes(board);
        }
    }

    /// The flash takes no more of how far the job comes: says what `$resume` will do after a loss
    /// of power, because what has been noted before stays there.
    #[inline(never)] // It is called in several places.
    fn end_notes<B: Board>(&mut self, board: &mut B) {
        self.machine.end_log();
        let Some([done, _]) = self.resumption.progress.take() else { return };
        Reply(board).line(format_args!(
            "[MSG:the flash takes no more notes of this job: after a loss of power $resume draws \
             it again from stroke {} on]",
            done.saturating_add(1)
        ));
    }

    /// Loads the job that has stopped, and returns how much of it is drawn. With `at_origin`
    /// the user has put the pen at the origin, because nobody knows where it is.
    ///
    /// # Errors
    /// [`CommandError::NothingToResume`] if no job has stopped, or the reason why it cannot go
    /// on. The job stays kept.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn load_stopped<B: Board>(
        &mut self,
        at_origin: bool,
        board: &mut B,
    ) -> Result<StoppedJob, CommandError> {
        let (notes, noted) = read(board).ok_or(CommandError::NothingToResume)?;
        let all = all_strokes(&notes, noted, board);
        if done(&notes, noted) >= all {
            return Err(CommandError::NothingToResume);
        }
        self.check_notes(&notes)?;
        if is_streamed(&notes) {
            Reply(board).line(format_args!(
                "[MSG:the job was sent while it was drawn: its sender sends the rest]"
            ));
            if !at_origin {
                return Err(CommandError::NothingToResume);
            }
            if self.resumption.origin(self.machine.settings()) != Origin::Lost {
                return Err(CommandError::PositionKnown);
            }
            self.machine.declare_origin()?;
            self.resumption.origin = Origin::ByHand;
            return Ok(StoppedJob::Sent);
        }
        let is_lost = self.resumption.origin(self.machine.settings()) == Origin::Lost;
        match (is_lost, at_origin) {
            (true, false) => return Err(CommandError::PositionUnknown),
            (false, true) => return Err(CommandError::PositionKnown),
            _ => {}
        }
        #[cfg(feature = "tiles")]
        if is_in_parts(&notes) {
            let kept = self.kept_parts(board)?.ok_or(CommandError::NoJobKept)?;
            // Another build may compute other strokes, or divide them otherwise.
            if kept.sources != records::SOURCES {
                return Err(CommandError::OtherVersion);
            }
            if at_origin {
                self.machine.declare_origin()?;
                self.resumption.origin = Origin::ByHand;
            }
            let drawn = Some(done(&notes, noted));
            return Ok(StoppedJob::InParts(KeptParts { drawn, ..kept }));
        }
        // Other sources may compute another order, in which others of the strokes come first.
        #[cfg(feature = "early-ink")]
        if is_without_order(&notes, board) && word(&notes, 6) != records::SOURCES {
            return Err(CommandError::OtherVersion);
        }
        self.copy_words = 0;
        self.job = Default::default();
        self.cursor = Default::default();
        self.job = records::load_job(self.machine.settings(), self.words, board)?;
        if at_origin {
            self.machine.declare_origin()?;
        }
        let progress = Some([noted.parts, all]);
        self.resumption = Resumption { progress, ..self.resumption.anew(self.machine.settings()) };
        Ok(StoppedJob::Loaded(noted))
    }

    /// Returns what the last job is computed from if it is a drawing in parts, to draw it anew;
    /// otherwise `None`. A model that is still coming is completed.
    ///
    /// # Errors
    /// [`CommandError::OtherModel`] if the flash holds another model or none, or the reason why
    /// the model in flash cannot be used.
    #[cfg(feature = "tiles")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn kept_parts<B: Board>(
        &mut self,
        board: &mut B,
    ) -> Result<Option<KeptParts>, CommandError> {
        let Some(kept) = records::load_parts(None, board) else { return Ok(None) };
        if !self.is_in_flash() || self.whole_model(board)?.checksum() != kept.model {
            return Err(CommandError::OtherModel);
        }
        Ok(Some(kept))
    }

    /// Draws a drawing in parts once more, or its rest, with its own options. They stay in force
    /// if the machine begins to draw.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[cfg(feature = "tiles")]
    #[inline(never)] // Keeps its frame off the stack while other jobs are computed.
    pub(in crate::plotter) fn plot_kept<B: Board>(
        &mut self,
        kept: KeptParts,
        listener: &mut Listener<'_, B>,
    ) -> Result<(), CommandError> {
        let before = self.options;
        let _ = records::load_parts(Some(&mut self.options), listener.board);
        let begun = self.plot_stored(Some(kept), listener);
        if begun.is_err() || self.machine.state() == State::Check {
            self.options = before;
        }
        begun
    }

    /// Nothing is left to draw of a drawing in parts. If it was `kept`, the power went just behind
    /// its end, which is noted now.
    ///
    /// # Errors
    /// [`CommandError::NothingToPlot`] if nothing was drawn before, either.
    #[cfg(feature = "tiles")]
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(in crate::plotter) fn nothing_left<B: Board>(
        &mut self,
        kept: Option<KeptParts>,
        board: &mut B,
    ) -> Result<(), CommandError> {
        self.parts.end();
        kept.and_then(|kept| kept.drawn).ok_or(CommandError::NothingToPlot)?;
        if board.note_progress(u32::MAX).is_err() {
            refuse(board);
        }
        self.resumption = self.resumption.anew(self.machine.settings());
        Reply(board).line(format_args!("[MSG:nothing is left to draw: the drawing is complete]"));
        Ok(())
    }

    /// Begins to keep how far a drawing in parts comes that has just begun, of the model with this
    /// checksum, or goes on with what is kept of it. Nothing may move yet.
    #[cfg(feature = "tiles")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_parts<B: Board>(
        &mut self,
        model: u32,
        time_model: TimeModel,
        kept: Option<KeptParts>,
        board: &mut B,
    ) {
        self.resumption = self.resumption.anew(self.machine.settings());
        if !board.keeps_progress() {
            return;
        }
        let drawn = kept.and_then(|kept| kept.drawn);
        if drawn.is_none() {
            let origin = self.resumption.origin;
            let notes = begin_notes(self.machine.settings(), PARTS, u32::MAX, [0; 3], origin);
            // The rest of what another build has kept would be refused.
            let is_saved = kept.is_some_and(|kept| kept.sources == records::SOURCES);
            if !is_saved && !records::save_parts(&self.options, time_model, model, board) {
                return;
            }
            if board.begin_progress(notes.as_flattened(), 0).is_err() {
                return refuse(board);
            }
        }
        self.machine.log_strokes(0);
        let drawn = drawn.unwrap_or(0);
        self.resumption.progress = Some([drawn, u32::MAX]);
        (self.resumption.drawn_before, self.resumption.in_parts) = (drawn, true);
    }

    /// Checks that what a job depends on is as it was when the job began.
    fn check_notes(&self, notes: &Notes) -> Result<(), CommandError> {
        if word(notes, 1) != version() {
            return Err(CommandError::OtherVersion);
        }
        let (is_known, model) = (word(notes, 3), word(notes, 4));
        for at in (HEAD..WORDS).step_by(2) {
            let (number, bits) = (word(notes, at), word(notes, at + 1));
            let setting = u16::try_from(number).ok().and_then(Setting::numbered);
            let before = Value::from_bits(bits.cast_signed());
            match setting {
                Some(setting) if placed(self.machine.settings(), setting) == before => {}
                Some(setting) => return Err(CommandError::OtherSetting { setting, before }),
                None => return Err(CommandError::OtherVersion),
            }
        }
        let is_empty = self.model.vertices().is_empty();
        let is_computed = is_known != 0 && !is_streamed(notes);
        if is_computed && !is_empty && model != self.model.checksum() {
            return Err(CommandError::OtherModel);
        }
        let is_homed = self.resumption.origin(self.machine.settings()).is_homed();
        if is_homed && word(notes, 7) == 0 {
            return Err(CommandError::OtherOrigin);
        }
        Ok(())
    }

    /// Hands the rest of the job to the machine. `drawn` is the part that has been drawn
    /// already.
    ///
    /// # Errors
    /// The machine's refusal, or [`CommandError::Aborted`].
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn begin_rest(
        &mut self,
        drawn: LogProgress,
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
            let LogProgress { parts, points: passed, .. } = drawn;
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

impl<I: Index> Inner<'_, I> {
    /// Begins to keep how far a job comes that is sent while it is drawn, and that its sender
    /// knows by the number `id`. If it is the rest of the job that has stopped, goes on with
    /// what is kept of that. Nothing may move yet.
    #[cfg(feature = "stream")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn keep_streamed<B: Board>(&mut self, id: u32, board: &mut B) {
        let stopped = self.resumption.progress;
        self.resumption = self.resumption.anew(self.machine.settings());
        if self.machine.state() != State::Run || !board.keeps_progress() {
            return;
        }
        let strokes = self.machine.status().job.strokes;
        // The sender names the rest of a job by the number of the whole job.
        let is_rest = |[done, all]: &[u32; 2]| done < all && strokes == all - done;
        if let Some([drawn, all]) = stopped.filter(is_rest)
            && let Some((notes, _)) = read(board)
            && is_streamed(&notes)
            && word(&notes, 4) == id
            && self.check_notes(&notes).is_ok()
            // All of it may be drawn anew, from another origin.
            && (drawn > 0 || self.resumption.origin.is_homed() == (word(&notes, 7) != 0))
        {
            self.machine.log_strokes(0);
            self.resumption = Resumption {
                progress: Some([drawn, all]),
                more_at_once: word(&notes, 3).saturating_sub(1),
                drawn_before: drawn,
                ..self.resumption
            };
            return;
        }
        // This job replaces the one that `$again` would draw, which is no longer the last one.
        if records::save_streamed(id, board).is_err() {
            return refuse(board);
        }
        for power in 0..=MOST_AT_ONCE.ilog2() {
            let at_once = 1 << power;
            let more = [at_once, id, 0];
            let origin = self.resumption.origin;
            let notes = begin_notes(self.machine.settings(), STREAMED, strokes, more, origin);
            let parts = strokes.div_ceil(at_once);
            if board.begin_progress(notes.as_flattened(), parts).is_ok() {
                self.machine.log_strokes(0);
                self.resumption.more_at_once = at_once - 1;
                self.resumption.progress = Some([0, strokes]);
                return;
            }
        }
        refuse(board);
    }

    /// Says how far a job has come that was sent while it was drawn and has stopped, so that
    /// its sender can go on: the number by which it knows the job, how many strokes are drawn
    /// and how many there are, and whether the position of the pen is unknown since then.
    /// Returns whether there is such a job.
    ///
    /// # Errors
    /// What the job depends on has changed.
    #[cfg(feature = "stream")]
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn report_stopped_stream<B: Board>(
        &self,
        board: &mut B,
    ) -> Result<bool, CommandError> {
        let Some([drawn, all]) = self.resumption.stopped(self.machine.state()) else {
            return Ok(false);
        };
        let Some((notes, _)) = read(board).filter(|(notes, _)| is_streamed(notes)) else {
            return Ok(false);
        };
        self.check_notes(&notes)?;
        let id = word(&notes, 4);
        let origin = self.resumption.origin(self.machine.settings());
        let is_lost = u8::from(origin == Origin::Lost);
        Reply(board).line(format_args!("[STOPPED:{id},{drawn},{all},{is_lost}]"));
        Ok(true)
    }
}

/// Whether the notes are those of a job that is sent while it is drawn.
fn is_streamed(notes: &Notes) -> bool {
    word(notes, 0) == STREAMED
}

/// Whether the notes are those of a drawing in parts.
#[cfg(feature = "tiles")]
fn is_in_parts(notes: &Notes) -> bool {
    word(notes, 0) == PARTS
}

/// The number of bits of the log that say that so many strokes of a drawing in parts are drawn.
#[cfg(feature = "tiles")]
fn noted_in_parts(strokes: u32) -> u32 {
    let noted = strokes.min(ONE_BY_ONE) + strokes.saturating_sub(ONE_BY_ONE) / LATER_AT_ONCE;
    noted.min(MOST_NOTED)
}

/// The number of strokes of a drawing in parts of which so many bits of the log say that they are
/// drawn.
#[cfg(feature = "tiles")]
fn drawn_in_parts(noted: u32) -> u32 {
    noted.min(ONE_BY_ONE) + noted.saturating_sub(ONE_BY_ONE) * LATER_AT_ONCE
}

/// Returns the number of strokes of a job with these notes that are drawn, according to its
/// log.
fn done(notes: &Notes, noted: LogProgress) -> u32 {
    let (strokes, at_once) = (word(notes, 2), word(notes, 3));
    #[cfg(feature = "tiles")]
    if is_in_parts(notes) {
        return if noted.is_closed { u32::MAX } else { drawn_in_parts(noted.parts) };
    }
    if is_streamed(notes) { noted.parts.saturating_mul(at_once).min(strokes) } else { noted.parts }
}

/// Reads the notes of the kept job, and how much of it is drawn.
fn read<B: Board>(board: &mut B) -> Option<(Notes, LogProgress)> {
    let mut notes: Notes = [[0; 4]; WORDS];
    let (length, noted) = board.progress(notes.as_flattened_mut())?;
    let layout = word(&notes, 0);
    let is_known = layout == LAYOUT || layout == STREAMED;
    #[cfg(feature = "tiles")]
    let is_known = is_known || layout == PARTS;
    (length == size_of::<Notes>() && is_known).then_some((notes, noted))
}

/// The number of strokes of the kept job. Of a job that began before its order was known, the
/// notes have an estimate, and the order the number.
fn all_strokes<B: Board>(notes: &Notes, noted: LogProgress, board: &mut B) -> u32 {
    #[cfg(feature = "early-ink")]
    if word(notes, 0) == LAYOUT
        && let Some(strokes) = records::strokes_of_added_order(board)
    {
        return strokes;
    }
    let _ = board;
    strokes_without_order(notes, done(notes, noted))
}

/// Whether the order of the job with these notes has to be computed again.
#[cfg(feature = "early-ink")]
fn is_without_order<B: Board>(notes: &Notes, board: &mut B) -> bool {
    word(notes, 0) == LAYOUT
        && word(notes, 3) & IS_ESTIMATE != 0
        && records::strokes_of_added_order(board).is_none()
}

/// The number of strokes of a job whose order was not added to it. If it is an estimate, it is more
/// than those that are `done`, because the job is not complete.
fn strokes_without_order(notes: &Notes, done: u32) -> u32 {
    let is_estimate = word(notes, 0) == LAYOUT && word(notes, 3) & IS_ESTIMATE != 0;
    strokes(notes).max(if is_estimate { done.saturating_add(1) } else { 0 })
}

/// The number of strokes of a job, as its notes have it.
fn strokes(notes: &Notes) -> u32 {
    word(notes, 2)
}

/// Tells the user that a job that begins cannot go on after a loss of power.
fn refuse<B: Board>(board: &mut B) {
    Reply(board).line(format_args!(
        "[MSG:$resume will not go on with this: the flash does not take how far it comes]"
    ));
}

#[cfg(all(test, feature = "tiles"))]
mod tests {
    use super::*;

    #[test]
    fn no_more_strokes_of_a_drawing_in_parts_are_noted_than_are_drawn() {
        for (drawn, noted) in [
            (0, 0),
            (1, 1),
            (16_384, 16_384),
            (16_415, 16_384),
            (16_416, 16_416),
            (16_500, 16_480),
            (229_343, 229_312),
            (229_344, 229_344),
            (u32::MAX - 1, 229_344),
        ] {
            assert_eq!(drawn_in_parts(noted_in_parts(drawn)), noted, "{drawn}");
            // The log's last bit says that the drawing is complete.
            assert!(noted_in_parts(drawn) < 23_040, "{drawn}");
        }
    }

    #[test]
    fn no_number_of_strokes_is_all_of_them_while_that_is_an_estimate() {
        let settings = Settings::default();
        for (known, done, all) in [
            (1, 9, 10),
            (1, 10, 10),
            (1 | IS_ESTIMATE, 9, 10),
            (1 | IS_ESTIMATE, 10, 11),
            (IS_ESTIMATE, 25, 26),
        ] {
            let notes = begin_notes(&settings, LAYOUT, 10, [known, 7, 8], Origin::Homed(0));
            assert_eq!(strokes_without_order(&notes, done), all, "{known}: {done}");
        }
        // In other notes the word is something else.
        let notes = begin_notes(&settings, STREAMED, 10, [3, 7, 8], Origin::Homed(0));
        assert_eq!(strokes_without_order(&notes, 10), 10);
    }
}
