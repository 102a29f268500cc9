//! Computes a job: runs the stages (the parts of the computation) one after the other.

#[cfg(feature = "convex")]
use super::super::solid;
use super::super::{PlotOptions, plan, title};
#[cfg(feature = "early-ink")]
use super::Unordered;
use super::{Job, Observer};
#[cfg(any(test, feature = "host"))]
use crate::drawing::Stored;
use crate::drawing::{StepsPerMillimetre, build_graph};
use crate::index::Index;
use crate::model::{Model, ModelError};
#[cfg(feature = "early-ink")]
use crate::order::FirstStrokes;
#[cfg(not(feature = "early-ink"))]
use crate::order::Leg;
#[cfg(feature = "early-ink")]
use crate::order::StrokeTime;
use crate::order::{self, TimeModel};
use crate::plotter::VisibilityMode;
use crate::protocol::CommandError;
use crate::stage::{Cancel, Stage};
use crate::view::{Camera, View};

/// The inputs of the computation of a job, and the working memory in which it takes place. Each
/// stage (each part of the computation) borrows it.
pub(in crate::plotter) struct Pipeline<'p, I> {
    /// The model, which is not changed.
    pub model: &'p Model<'p, I>,
    /// What is drawn and how.
    pub options: &'p PlotOptions,
    /// The steps per millimetre on the page, in which the drawing is measured.
    pub steps: StepsPerMillimetre,
    /// The speed of the machine and of the search for a better order, which determine how long the
    /// search pays.
    pub time_model: TimeModel,
    /// The durations of strokes, if some strokes are to be drawn before the order of the others is
    /// known.
    #[cfg(feature = "early-ink")]
    pub early: Option<StrokeTime>,
    /// The working memory. Each stage (each part of the computation) leaves its result at the
    /// front.
    pub words: &'p mut [u64],
    /// Called regularly to find out whether the user aborts the job.
    pub cancel: &'p mut dyn Cancel,
    /// Called with each line that will be drawn, for a preview.
    pub observer: &'p mut dyn Observer<I>,
}

/// The lines that a stage of the computation has left at the front of the working memory, and what
/// it left out.
#[derive(Debug, Default)]
pub(in crate::plotter) struct Found {
    /// Number of lines at the front of the working memory.
    pub lines: usize,
    /// Number of faces that were left out because they have no area.
    pub degenerate_faces: u32,
    /// Number of edges of a convex solid whose faces may be coplanar.
    pub joined_edges: usize,
}

impl<I: Index> Pipeline<'_, I> {
    /// Computes the job. The working memory then holds it.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with. The working memory then holds no job.
    #[cfg(not(feature = "early-ink"))]
    pub fn run(mut self) -> Result<Job<I>, CommandError> {
        let found = self.find()?;
        self.order(&found)
    }

    /// Computes the drawing, and chooses the strokes that are drawn before the order of the others
    /// is known. The job, which the working memory then holds, has no order yet.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with. The working memory then holds no job.
    #[cfg(feature = "early-ink")]
    pub fn begin(&mut self) -> Result<Job<I>, CommandError> {
        let found = self.find()?;
        self.graph(&found)
    }

    /// Makes one drawing of the lines, and chooses the strokes that are drawn first.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
    fn graph(&mut self, found: &Found) -> Result<Job<I>, CommandError> {
        let Self { options, steps, time_model, words, cancel, early, .. } = self;
        cancel.enter(Stage::Order);
        let stored = build_graph::<I>(words, found.lines, *cancel)?;
        let [legs, _] = stored.counts();
        if legs == 0 {
            return Err(CommandError::NothingToPlot);
        }
        let order = options.order(*steps, *time_model);
        let first = match early {
            &mut Some(time) => {
                let (points, segments, scratch) =
                    stored.split_mut(words).map_err(CommandError::DrawingTooLarge)?;
                order::choose_first(points, segments, order, time, scratch, *cancel)?
            }
            None => FirstStrokes::default(),
        };
        let Found { degenerate_faces, joined_edges, .. } = *found;
        let report = order::Report::default();
        let unordered = Some(Unordered::new(first, order));
        Ok(Job { stored, legs, report, unordered, degenerate_faces, joined_edges })
    }

    /// Computes the drawing without ordering its strokes. It then lies at the front of the working
    /// memory.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[cfg(any(test, feature = "host"))]
    pub fn draw(mut self) -> Result<Stored<I>, CommandError> {
        let found = self.find()?;
        Ok(build_graph(self.words, found.lines, self.cancel)?)
    }

    /// Finds the lines of the drawing, those of the title among them.
    #[inline(always)] // Adds no frame to the stack while the stages run.
    fn find(&mut self) -> Result<Found, CommandError> {
        self.check()?;
        let found = if self.model.is_plan() && self.options.shows_plans_flat() {
            plan::lay_out(self)?
        } else {
            match self.options.see {
                #[cfg(feature = "convex")]
                VisibilityMode::Vertices | VisibilityMode::Edges => solid::project(self)?,
                #[cfg(not(feature = "convex"))]
                VisibilityMode::Vertices | VisibilityMode::Edges => {
                    return Err(CommandError::NoConvexSolids);
                }
                VisibilityMode::Faces | VisibilityMode::Wire => self.find_visible_lines()?,
            }
        };
        let lines = title::write(self, found.lines)?;
        Ok(Found { lines, ..found })
    }

    /// Refuses what is known to fail before anything is computed.
    fn check(&self) -> Result<(), CommandError> {
        let is_empty = self.model.elements().corners().is_empty() && self.model.curves().is_empty();
        if is_empty && self.options.see != VisibilityMode::Vertices {
            return Err(CommandError::NothingToPlot);
        }
        if self.model.has_unfinished_curve() {
            return Err(CommandError::Model(ModelError::CurveUnfinished));
        }
        title::check(self.options, self.steps)
    }

    /// Makes one drawing of the lines and orders its strokes.
    #[cfg(not(feature = "early-ink"))]
    #[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
    fn order(self, found: &Found) -> Result<Job<I>, CommandError> {
        let Self { options, steps, time_model, words, cancel, .. } = self;
        cancel.enter(Stage::Order);
        let stored = build_graph(words, found.lines, cancel)?;
        let (drawing, mut rest) = stored.split(words).map_err(CommandError::DrawingTooLarge)?;
        let legs = drawing.segments.len();
        if legs == 0 {
            return Err(CommandError::NothingToPlot);
        }
        let tour = rest.take::<Leg<I>>(legs).map_err(CommandError::DrawingTooLarge)?;
        let report = order::order(drawing, options.order(steps, time_model), rest, cancel, tour)?;
        let Found { degenerate_faces, joined_edges, .. } = *found;
        Ok(Job { stored, legs, report, degenerate_faces, joined_edges })
    }

    /// The camera that the options choose, and the view of the model through it.
    ///
    /// # Errors
    /// [`CommandError::NothingToPlot`] if there is no vertex, [`CommandError::View`] if the camera
    /// cannot show the model, [`CommandError::Aborted`].
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn camera_view(&mut self) -> Result<(Camera, View), CommandError> {
        let Self { model, options, cancel, .. } = self;
        let model = *model;
        cancel.enter(Stage::View);
        let camera = options.camera(model).ok_or(CommandError::NothingToPlot)?;
        cancel.check()?;
        let view = View::new(&camera, model).map_err(CommandError::View)?;
        cancel.check()?;
        if !options.clip_behind {
            view.refuse_behind(model).map_err(CommandError::View)?;
        }
        Ok((camera, view))
    }
}
