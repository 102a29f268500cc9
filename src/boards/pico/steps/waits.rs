//! How the time of a long wait is divided among the words of the ring.
//!
//! A word's time is fixed once it is handed over, so each should be short. But none may be shorter
//! than what the state machine takes for a word at all. The host's tests compile this file, too.

/// The greatest number of words of a wait.
pub const WAIT_WORDS: u32 = 64;

/// The ticks of each word of a wait that takes this many ticks in all. None is longer than
/// `longest`, unless that would take more than [`WAIT_WORDS`] words. If there are two or more, none
/// is shorter than half of `longest`.
pub fn parts(ticks: u32, longest: u32) -> impl Iterator<Item = u32> {
    let part = if ticks <= longest {
        ticks
    } else if ticks < 2 * longest {
        // What is left behind one word of the greatest length could be a single tick.
        ticks / 2
    } else {
        (ticks / WAIT_WORDS).max(longest)
    };
    let mut left = ticks;
    core::iter::from_fn(move || {
        let next = if left < 2 * part { left } else { part };
        left -= next;
        Some(next).filter(|ticks| *ticks > 0)
    })
}

#[cfg(test)]
mod tests {
    use super::{WAIT_WORDS, parts};

    #[test]
    fn the_words_of_a_wait_take_all_of_its_time_and_none_is_too_short() {
        let longest = 50_000;
        let far = [WAIT_WORDS * longest, 1 << 22, (1 << 24) - 1];
        let around = far.into_iter().flat_map(|ticks| ticks - 70..=((1 << 24) - 1).min(ticks + 70));
        for ticks in (1..400_000).chain(around) {
            let words: Vec<u32> = parts(ticks, longest).collect();
            assert_eq!(words.iter().sum::<u32>(), ticks);
            assert!(words.len() <= WAIT_WORDS as usize, "{ticks}: {}", words.len());
            let least = if ticks <= longest { ticks } else { longest / 2 };
            assert!(words.iter().all(|word| *word >= least), "{ticks}: {words:?}");
            let is_short = ticks < WAIT_WORDS * longest;
            let most = if is_short { 2 * longest - 1 } else { 2 * (ticks / WAIT_WORDS) };
            assert!(words.iter().all(|word| *word <= most), "{ticks}: {words:?}");
        }
        assert_eq!(parts(0, longest).count(), 0);
    }
}
