//! Without the feature `pen-overlap`, the pen moves only while the machine is at rest. These
//! functions take the place of those in `pen.rs`, and nearly all do nothing.

use super::{PathSpeed, Progress, Runner};
use crate::motion::{EventQueue, StepEvent};

/// The pen does nothing beside the motion.
#[derive(Debug)]
pub(super) struct PenTiming;

impl PenTiming {
    /// The pen does nothing.
    pub(super) const fn new() -> Self {
        Self
    }

    /// Does nothing.
    #[inline(always)]
    pub(super) const fn pass(&mut self, _: u32) {}

    /// The pen is never due on the way.
    #[inline(always)]
    pub(super) const fn is_due(&self) -> bool {
        false
    }

    /// The pen is never told to go down on the way.
    #[inline(always)]
    pub(super) const fn is_lowering(&self) -> bool {
        false
    }

    /// The greatest speed of the travel in work: the one in force.
    #[inline(always)]
    pub(super) const fn travel_top(&self, travel: PathSpeed) -> PathSpeed {
        travel
    }
}

#[allow(clippy::unnecessary_wraps, reason = "with the feature they tell the queue's errors")]
impl Runner<'_> {
    /// A plan has been made.
    #[inline(always)]
    pub(super) const fn planned(
        &mut self,
        _inked: bool,
        _at_rest: bool,
        _queue: &mut dyn EventQueue,
    ) -> Result<Progress, StepEvent> {
        Ok(Progress::More)
    }

    /// The pen goes down at rest.
    #[inline(always)]
    pub(super) const fn lower_while_moving(
        &mut self,
        _queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        Ok(())
    }

    /// The pen was not told on the way.
    #[inline(always)]
    pub(super) const fn lowered_while_moving(&mut self, _down: bool) -> Option<u32> {
        None
    }

    /// The machine waits for all of the dwell.
    #[inline(always)]
    pub(super) const fn begin_rising(&mut self, dwell: u32) -> u32 {
        dwell
    }

    /// There is nothing to wait for.
    #[inline(always)]
    pub(super) const fn wait_for_rising(
        &mut self,
        _queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        Ok(false)
    }

    /// There is nothing to forget.
    #[inline(always)]
    pub(super) const fn forget_timing(&mut self) {}
}
