//! Whether a job has come to its end, once the machine is idle.

use super::Sender;
use crate::error::Error;
use penup_job::protocol::Status;

/// Whether strokes or ink are left according to a report.
pub(super) fn is_left(status: &Status) -> bool {
    [status.strokes, status.ink].into_iter().flatten().any(|(done, all)| done < all)
}

/// Whether more ink is left according to a report than its lengths are rounded by; where nothing
/// has a length, whether strokes are.
pub(super) fn is_ink_left(status: &Status) -> bool {
    match status.ink {
        Some((done, all)) if all > 0 => done.saturating_add(1 + all / 1000) < all,
        _ => status.strokes.is_some_and(|(done, all)| done < all),
    }
}

impl Sender<'_> {
    /// Fails if the last job of an idle machine, which has this `status`, has not come to its end.
    /// Returns the status, also where a program of G-code has ended since a job stopped.
    ///
    /// # Errors
    /// [`Error::JobStopped`] or [`Error::JobUnfinished`], or as [`Sender::join`].
    pub fn fail_if_unfinished(&mut self, status: Status) -> Result<Status, Error> {
        let is_of_job =
            |status: &Status| is_left(status) || status.strokes.is_none_or(|(_, all)| all == 0);
        if status.stopped.is_some() && is_of_job(&status) {
            return self.fail_if_stopped();
        }
        self.fail_if(status, is_ink_left)
    }

    /// Fails if the drawing `is_unfinished` according to this status and those that follow: reports
    /// have no checksum.
    pub(super) fn fail_if(
        &mut self,
        mut status: Status,
        is_unfinished: impl Fn(&Status) -> bool,
    ) -> Result<Status, Error> {
        for _ in 0..2 {
            if is_unfinished(&status) {
                status = self.find_state()?;
            }
        }
        match is_unfinished(&status) {
            true => Err(Error::JobUnfinished { drawn: status.strokes.filter(|(_, all)| *all > 0) }),
            false => Ok(status),
        }
    }

    /// Returns the status, in which no job has stopped that could go on.
    pub(super) fn fail_if_stopped(&mut self) -> Result<Status, Error> {
        let status = self.settled_status()?;
        match status.stopped {
            Some((done, all)) => Err(Error::JobStopped { done, all }),
            None => Ok(status),
        }
    }

    /// The numbers of strokes that are drawn, and of all, of a job that has stopped and could go
    /// on; `None` if there is none. The second is 0 if it is not known.
    ///
    /// # Errors
    /// As [`Sender::join`].
    pub fn stopped_job(&mut self) -> Result<Option<(u64, u64)>, Error> {
        Ok(self.settled_status()?.stopped)
    }

    /// The status of a machine at rest. The plotter notes the last stroke a moment after it is at
    /// rest, so it is asked again while a job seems to have stopped.
    fn settled_status(&mut self) -> Result<Status, Error> {
        let mut status = self.find_state()?;
        for _ in 0..2 {
            if status.stopped.is_some() {
                status = self.find_state()?;
            }
        }
        Ok(status)
    }
}
