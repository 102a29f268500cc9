//! Where the power is cut: the points of a record, and those of them that are tried.

use super::Effort;
use crate::random::Random;
use penup_client::emulator::FlashOperation;

/// Where the records begin in the flash. Before them lies a model that is too large for the memory.
const RECORDS: u32 = 1760 << 10;

/// A point of a record at which the power goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerCut {
    /// Between two operations: so many are done.
    Between(u32),
    /// When so many bytes of an operation have changed, and those bits of the next one that are in
    /// the mask.
    Within(u32, u32, u8),
    /// When each bit that an operation changes has changed with a probability of so many in 256,
    /// by a seed.
    Scattered(u32, u8, u32),
}

impl PowerCut {
    /// The number of operations that are done.
    pub(super) fn done(self) -> u32 {
        let (Self::Between(done) | Self::Within(done, ..) | Self::Scattered(done, ..)) = self;
        done
    }
}

/// The cuts within an operation: of a page before each `step`th byte, and within some of them; of a
/// sector before some bytes; and of both with bits at random. What a model in flash consists of is
/// cut at few bytes, because it is many pages, of which none counts before the record at `front`
/// does.
pub(super) fn cuts_within(
    number: u32,
    operation: &FlashOperation,
    front: u32,
    effort: Effort,
    random: &mut Random,
) -> Vec<PowerCut> {
    /// In a sector one byte is like the others.
    const SELDOM: u32 = 97;
    let is_content = operation.offset < RECORDS && operation.offset != front;
    let last = operation.changes.checked_sub(1);
    let mut bytes: Vec<u32> = if is_content {
        let some = random.below(u64::from(operation.changes).max(1)) as u32;
        if operation.is_erasure { vec![0, some] } else { vec![some] }
    } else {
        let step = effort.bytes * if operation.is_erasure { SELDOM } else { 1 };
        (0..operation.changes).step_by(step as usize).collect()
    };
    if !is_content || operation.is_erasure {
        bytes.extend(last);
    }
    bytes.dedup();
    let mut cuts = Vec::new();
    for byte in bytes {
        cuts.push(PowerCut::Within(number, byte, 0));
        if random.once_in(8) {
            cuts.push(PowerCut::Within(number, byte, 1 + random.below(255) as u8));
        }
    }
    let scattered = if is_content { effort.scattered.min(1) } else { effort.scattered };
    for share in [128, 4, 252, 64, 192].into_iter().take(scattered) {
        cuts.push(PowerCut::Scattered(number, share, random.below(1 << 24) as u32));
    }
    cuts
}

/// What is written there.
pub(super) fn name_of(operation: &FlashOperation) -> &'static str {
    const SECTOR: u32 = 4096;
    let job = RECORDS + 2 * SECTOR;
    let parameters = job + 2 * ((128 << 10) + SECTOR);
    let logs = parameters + 2 * SECTOR;
    match (operation.offset, operation.is_erasure) {
        (..RECORDS, true) => "model: sectors",
        (..RECORDS, false) => "model: pages",
        (at, true) if at < job => "settings: sectors",
        (at, false) if at < job => "settings: pages",
        (at, true) if at < parameters => "jobs: sectors",
        (at, false) if at < parameters => "jobs: pages",
        (at, true) if at < logs => "parameters: sectors",
        (at, false) if at < logs => "parameters: pages",
        (_, true) => "logs: sectors",
        (_, false) if operation.changes > 1 => "logs: fronts",
        (_, false) => "logs: strokes and points",
    }
}
