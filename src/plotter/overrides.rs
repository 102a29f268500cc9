//! The changes of the overrides that real-time bytes ask for.

use crate::protocol::RealTime;

/// What becomes of the overrides of the speeds. While a job is computed, the requests are collected
/// here, until the machine can be told.
#[derive(Clone, Copy, Default)]
pub(super) struct OverrideChange {
    /// Whether the feed override is first reset to 100 %.
    resets_feed: bool,
    /// By how many percent the feed override then changes.
    feed: i16,
    /// The new override of moves with the pen up, in percent.
    rapid: Option<u8>,
}

impl OverrideChange {
    /// Adds what these requests ask for.
    pub(super) fn add(&mut self, requests: RealTime) {
        if requests.has(RealTime::FEED_RESET) {
            (self.resets_feed, self.feed) = (true, 0);
        }
        for (request, change) in [
            (RealTime::FEED_PLUS_10, 10),
            (RealTime::FEED_MINUS_10, -10),
            (RealTime::FEED_PLUS_1, 1),
            (RealTime::FEED_MINUS_1, -1),
        ] {
            if requests.has(request) {
                self.feed = self.feed.saturating_add(change);
            }
        }
        for (request, percent) in [
            (RealTime::RAPID_RESET, 100),
            (RealTime::RAPID_HALF, 50),
            (RealTime::RAPID_QUARTER, 25),
        ] {
            if requests.has(request) {
                self.rapid = Some(percent);
            }
        }
    }

    /// The feed override after the change, in percent, if it was `percent` before: 10 to 200.
    pub(super) fn feed_after(self, percent: u8) -> u8 {
        let before = if self.resets_feed { 100 } else { i16::from(percent) };
        before.saturating_add(self.feed).clamp(10, 200) as u8
    }

    /// The override of moves with the pen up after the change, if it was `percent` before.
    pub(super) fn rapid_after(self, percent: u8) -> u8 {
        self.rapid.unwrap_or(percent)
    }
}
