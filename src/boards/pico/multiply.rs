//! Multiplication of 64 bits. A Cortex-M0+ multiplies 32 bits and keeps only the lower 32 bits of
//! the product.
//!
//! The symbol has the name by which the compiler calls the multiplication. It takes 27 cycles with
//! the return, where the compiler's own takes 55. The search for hidden lines multiplies more than
//! anything else.

core::arch::global_asm!(
    ".section .text.__aeabi_lmul, \"ax\"",
    ".balign 4",
    ".global __aeabi_lmul",
    ".type __aeabi_lmul, %function",
    ".thumb_func",
    "__aeabi_lmul:",
    // The cross products go into the upper half, modulo 2^32.
    "muls r1, r2",
    "muls r3, r0",
    "adds r1, r3",
    "mov r12, r1",
    // The product of the lower halves is computed in full, as four products of 16 bits.
    "push {{r4}}",
    "lsrs r1, r2, #16",
    "lsrs r4, r0, #16",
    "uxth r3, r0",
    "uxth r2, r2",
    "mov r0, r3",
    "muls r0, r2", // low, low
    "muls r3, r1", // low, high
    "muls r1, r4", // high, high
    "muls r2, r4", // high, low
    "lsls r4, r3, #16",
    "lsrs r3, r3, #16",
    "adds r0, r4",
    "adcs r1, r3",
    "lsls r4, r2, #16",
    "lsrs r2, r2, #16",
    "adds r0, r4",
    "adcs r1, r2",
    "add r1, r12",
    "pop {{r4}}",
    "bx lr",
);
