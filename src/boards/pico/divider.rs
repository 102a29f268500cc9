//! Division by the chip's 32-bit divider, because a Cortex-M0+ has no division instruction.
//!
//! The symbols have the names by which the compiler calls division. A handler that divides, itself
//! or in what it calls, must restore the divider afterwards: see [`keep_during`]. `cargo xtask
//! build` checks on the image that every handler does.
//!
//! 64 bits are divided by 32 in two digits of 16 bits (Knuth's algorithm D). This takes 120 cycles,
//! where the compiler's own routine takes 390. Greater divisors are left to that routine.

use super::registers::{Get, Put, SIO};

/// Runs the work of a handler and then restores the divider. The handler may have interrupted a
/// division of the main loop, and it may divide itself.
///
/// It costs some 50 cycles.
#[inline(never)] // `cargo xtask build` recognises it by its name.
pub fn keep_during(work: impl FnOnce()) {
    // A division takes 8 cycles, and entering a handler takes 15, so the division is finished.
    let operands = (SIO.div_udividend().get(), SIO.div_udivisor().get());
    let results = (SIO.div_remainder().get(), SIO.div_quotient().get());
    work();
    // Writing an operand starts a division, and writing a result ends it.
    SIO.div_udividend().put(operands.0);
    SIO.div_udivisor().put(operands.1);
    SIO.div_remainder().put(results.0);
    SIO.div_quotient().put(results.1);
}

core::arch::global_asm!(
    ".macro penup_divide name, other, dividend, divisor",
    ".global \\name",
    ".global \\other",
    ".type \\name, %function",
    ".type \\other, %function",
    ".thumb_func",
    "\\other:",
    ".thumb_func",
    "\\name:",
    "movs r2, #0xD0",
    "lsls r2, r2, #24",
    "str r0, [r2, #\\dividend]",
    "str r1, [r2, #\\divisor]",
    // The result takes 8 cycles, which four branches of 2 cycles fill.
    "b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: ldr r1, [r2, #0x74]", // remainder
    "ldr r0, [r2, #0x70]",    // quotient
    "bx lr",
    ".endm",
    ".section .text.__aeabi_uidivmod, \"ax\"",
    ".balign 4",
    "penup_divide __aeabi_uidivmod, __aeabi_uidiv, 0x60, 0x64",
    "penup_divide __aeabi_idivmod, __aeabi_idiv, 0x68, 0x6C",
);

core::arch::global_asm!(
    // Computes one digit. In: r1, which is less than r2; r2, whose top bit is set; r5, the upper
    // half of r2; the upper half of r0. The dividend is r1 followed by the upper half of r0, and
    // the divisor is r2. Out: the quotient in r3 and the remainder in r1. r0 is shifted up by one
    // digit.
    ".macro penup_digit",
    "str r1, [r7, #0x60]",
    "str r5, [r7, #0x64]",
    "lsrs r4, r0, #16",
    "lsls r0, r0, #16",
    "b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: ldr r1, [r7, #0x74]",
    "ldr r3, [r7, #0x70]",
    "lsls r1, r1, #16",
    "orrs r1, r4",
    "uxth r4, r2",
    "muls r4, r3", // at most 65537 times 65535
    "subs r1, r1, r4",
    "bhs 1f",
    // The digit is too great by 1 or 2.
    "subs r3, #1",
    "adds r1, r1, r2",
    "bcs 1f",
    "subs r3, #1",
    "adds r1, r1, r2",
    "1:",
    ".endm",
    // Shifts r2 up by `bits` if its top `bits` bits are 0, and adds the shift to r6.
    ".macro penup_shift_up bits",
    "lsrs r3, r2, #(32 - \\bits)",
    "bne 1f",
    "adds r6, #\\bits",
    "lsls r2, r2, #\\bits",
    "1:",
    ".endm",
    // Divides r1 by r2: quotient in r3, remainder in r1.
    ".macro penup_short_digit",
    "str r1, [r7, #0x60]",
    "str r2, [r7, #0x64]",
    "b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: ldr r1, [r7, #0x74]",
    "ldr r3, [r7, #0x70]",
    ".endm",
    ".section .text.__aeabi_uldivmod, \"ax\"",
    ".balign 4",
    "6: push {{r4, lr}}",
    "sub sp, #16",
    "add r4, sp, #8",
    "str r4, [sp]",
    "bl __udivmoddi4",
    "ldr r2, [sp, #8]",
    "ldr r3, [sp, #12]",
    "add sp, #16",
    "pop {{r4, pc}}",
    ".global __aeabi_uldivmod",
    ".type __aeabi_uldivmod, %function",
    ".thumb_func",
    "__aeabi_uldivmod:",
    "cmp r3, #0",
    "bne 6b",
    "push {{r4-r7, lr}}",
    "movs r7, #0xD0",
    "lsls r7, r7, #24",
    "cmp r1, #0",
    "beq 5f",
    "cmp r1, r2",
    "blo 2f",
    "penup_short_digit",
    "2: mov r12, r3", // the upper half of the quotient
    "movs r6, #0",
    "lsrs r3, r2, #16",
    "beq 4f",
    "penup_shift_up 8",
    "penup_shift_up 4",
    "penup_shift_up 2",
    "penup_shift_up 1",
    "lsls r1, r6",
    "movs r3, #32",
    "subs r3, r3, r6",
    "movs r4, r0",
    "lsrs r4, r3",
    "orrs r1, r4",
    "lsls r0, r6",
    "lsrs r5, r2, #16",
    "penup_digit",
    "mov lr, r3",
    "penup_digit",
    "3: mov r0, lr",
    "lsls r0, r0, #16",
    "adds r0, r0, r3",
    "movs r2, r1",
    "lsrs r2, r6",
    "mov r1, r12",
    "movs r3, #0",
    "pop {{r4-r7, pc}}",
    // With a divisor below 2^16, its remainders can take one more digit unshifted.
    "4: lsls r1, r1, #16",
    "lsrs r4, r0, #16",
    "orrs r1, r4",
    "penup_short_digit",
    "mov lr, r3",
    "lsls r1, r1, #16",
    "uxth r0, r0",
    "orrs r1, r0",
    "penup_short_digit",
    "b 3b",
    "5: movs r1, r0",
    "penup_short_digit",
    "movs r0, r3",
    "movs r2, r1",
    "movs r1, #0",
    "movs r3, #0",
    "pop {{r4-r7, pc}}",
);
