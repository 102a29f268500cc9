//! 32-bit division by the chip's divider: a Cortex-M0+ has none.
//!
//! The names are those by which the compiler calls division. The handlers divide nothing, so the
//! divider's state needs no saving.

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
    // The result takes 8 cycles: four branches of 2.
    "b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: b 1f",
    "1: ldr r1, [r2, #0x74]", // remainder
    "ldr r0, [r2, #0x70]",    // quotient
    "bx lr",
    ".endm",
    ".section .text.penup_divide, \"ax\"",
    ".balign 4",
    "penup_divide __aeabi_uidivmod, __aeabi_uidiv, 0x60, 0x64",
    "penup_divide __aeabi_idivmod, __aeabi_idiv, 0x68, 0x6C",
);
