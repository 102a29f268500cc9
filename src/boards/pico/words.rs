//! The two loops over the words of the steps, in assembly, because the compiler would keep half of
//! their counters on the stack.
//!
//! They are in RAM, with their callers, so that the cache of the flash has room for the planner.

use core::sync::atomic::AtomicU32;

use penup::motion::StepTrain;

core::arch::global_asm!(
    ".section .data.penup_words, \"ax\"",
    ".balign 4",
    // In: r0, the train; r1, the words; r2, their end. It takes 15 cycles for a straight step and
    // 17 for a diagonal one.
    ".global penup_write_train",
    ".type penup_write_train, %function",
    ".thumb_func",
    "penup_write_train:",
    "push {{r0, r4-r7, lr}}",
    "mov r4, r8",
    "mov r5, r9",
    "mov r6, r10",
    "mov r7, r11",
    "push {{r4-r7}}",
    "ldm r0!, {{r3-r7}}",
    "mov r8, r4",  // interval
    "mov r11, r7", // straight
    "movs r4, r5", // before
    "movs r5, r6", // event
    "ldm r0!, {{r6, r7}}",
    "mov r12, r6", // diagonal
    "movs r6, r7", // balance
    "ldm r0!, {{r7}}",
    "mov r9, r7", // gain
    "ldm r0!, {{r7}}",
    "rsbs r7, r7, #0",
    "mov r10, r7", // loss, negative
    "ldr r7, [r0]",
    "mov lr, r7", // diagonals
    "1: lsrs r0, r3, #{fraction_bits}",
    "add r3, r8",
    "subs r7, r0, r4",
    "movs r4, r0",
    "lsls r7, r7, #8",
    "adds r7, r7, r5",
    "stm r1!, {{r7}}",
    "cmp r6, #0",
    "bgt 2f",
    "add r6, r9",
    "mov r5, r11",
    "cmp r1, r2",
    "bne 1b",
    "b 3f",
    "2: add r6, r10",
    "mov r5, r12",
    "movs r0, #1",
    "add lr, r0",
    "cmp r1, r2",
    "bne 1b",
    "3: ldr r0, [sp, #16]",
    "str r3, [r0]",
    "str r4, [r0, #8]",
    "str r5, [r0, #12]",
    "str r6, [r0, #24]",
    "mov r1, lr",
    "str r1, [r0, #36]",
    "pop {{r4-r7}}",
    "mov r8, r4",
    "mov r9, r5",
    "mov r10, r6",
    "mov r11, r7",
    "pop {{r0, r4-r7, pc}}",
    // In: r0, the words; r1, their end; r2, the table of what each pulse adds; r3, the sums. It
    // takes 14 cycles per word.
    ".global penup_count_pulses",
    ".type penup_count_pulses, %function",
    ".thumb_func",
    "penup_count_pulses:",
    "push {{r3-r7, lr}}",
    "ldm r3!, {{r4, r5}}",
    "1: ldm r0!, {{r6}}",
    "uxtb r7, r6",
    "subs r7, #{pulse}",
    "blo 2f",
    "lsls r7, r7, #2",
    "ldr r7, [r2, r7]",
    "adds r4, r4, r7",
    "lsrs r6, r6, #8",
    "adds r5, r5, r6",
    "cmp r0, r1",
    "bne 1b",
    "b 3f",
    "2: subs r0, #4",
    "3: pop {{r3}}",
    "stm r3!, {{r4, r5}}",
    "pop {{r4-r7, pc}}",
    fraction_bits = const StepTrain::FRACTION_BITS,
    pulse = const super::steps::PULSE,
);

// SAFETY: the instructions above define these functions, with these arguments and results.
unsafe extern "C" {
    /// Writes the next steps of a train to the words from `words` up to, but not including, `end`.
    /// See [`write_train`].
    fn penup_write_train(train: *mut StepTrain, words: *mut u32, end: *mut u32);
    /// Counts the pulses from `words` on, until a word is no pulse or `end` is reached. Returns the
    /// address of the first word that was not counted. See [`count_pulses`].
    fn penup_count_pulses(
        words: *const u32,
        end: *const u32,
        moves: *const u32,
        sums: *mut [u32; 2],
    ) -> *const u32;
}

/// Writes the next steps of the train, one into each of the `words`.
pub fn write_train(train: &mut StepTrain, words: &[AtomicU32]) {
    if words.is_empty() {
        return;
    }
    let words = words.as_ptr_range();
    // SAFETY: it reads and writes the ten fields of the train, in their order (`repr(C)`), and it
    // writes the words. The words are atomic and so may change, and there is at least one.
    unsafe {
        penup_write_train(
            train,
            words.start.cast::<u32>().cast_mut(),
            words.end.cast::<u32>().cast_mut(),
        );
    }
}

/// Counts the pulses up to the first word that is no pulse, and returns their number. For each
/// pulse it adds the entry of `moves` for its levels to the first of the `sums`, and its ticks to
/// the second.
pub fn count_pulses(words: &[AtomicU32], moves: &[u32; 32], sums: &mut [u32; 2]) -> usize {
    if words.is_empty() {
        return 0;
    }
    let words = words.as_ptr_range();
    let start = words.start.cast::<u32>();
    // SAFETY: it reads the words, of which there is at least one. Of the 32 moves it reads that of
    // the five level bits, because a pulse has no other bits set but its mark. It adds to the two
    // sums.
    let counted =
        unsafe { penup_count_pulses(start, words.end.cast::<u32>(), moves.as_ptr(), sums) };
    (counted as usize - start as usize) / size_of::<u32>()
}
