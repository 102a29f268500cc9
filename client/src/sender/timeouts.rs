//! How long a sender waits.

use std::time::Duration;

/// The timeouts of a sender.
#[derive(Debug, Clone, Copy)]
pub struct Timeouts {
    /// The longest time without any byte from the plotter while it should answer.
    pub silence: Duration,
    /// The longest time without progress while the plotter still answers status queries.
    pub lost: Duration,
    /// The total time to wait for the greeting after an abort, retries included.
    pub greeting: Duration,
    /// The time to wait for the reply to a line before the sender asks for the number of the last
    /// accepted line.
    pub reply: Duration,
    /// The time between two status queries.
    pub query: Duration,
    /// The time for which a machine may stay in feed hold if the user cannot be asked.
    pub hold: Duration,
}

impl Timeouts {
    /// The timeouts for a plotter in this process, by its own clock. It never falls silent, and a
    /// computation takes none of its time.
    pub fn simulated() -> Self {
        let hour = Duration::from_secs(3600);
        let query = Duration::from_secs(20);
        Self { silence: hour, lost: hour, query, ..Self::default() }
    }
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            silence: Duration::from_secs(5),
            lost: Duration::from_secs(15),
            greeting: Duration::from_secs(3),
            reply: Duration::from_millis(300),
            query: Duration::from_millis(100),
            hold: Duration::from_secs(60),
        }
    }
}
