//! Measures the deepest use of a board's stack, by painting it with a pattern and looking for the
//! bytes that no longer contain it.
//!
//! The whole stack, which is at the start of RAM on every board, is painted before the first
//! instruction.

use object::{Object, ObjectSection};

use super::EmulatorError;

/// The address of the start of RAM, and of the lower end of the stack, on every board.
pub const RAM: u32 = 0x2000_0000;
/// The value of an unused byte of the stack.
pub const PAINT: u8 = 0xA5;

/// The size of a stack and its maximum use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stack {
    /// The size in bytes.
    pub size: usize,
    /// The number of bytes from the stack's beginning to the deepest byte that was written.
    pub deepest: usize,
}

impl Stack {
    /// Measures a stack from its contents, the lowest address first.
    pub fn of(bytes: &[u8]) -> Self {
        let untouched = bytes.iter().take_while(|&&byte| byte == PAINT).count();
        Self { size: bytes.len(), deepest: bytes.len() - untouched }
    }
}

/// Reads the size of the stack from an ELF image: the first word of the vector table is the initial
/// stack pointer.
pub fn size(elf: &[u8]) -> Result<usize, EmulatorError> {
    let bad = |reason: String| EmulatorError::BadImage { reason };
    let elf = object::File::parse(elf).map_err(|error| bad(error.to_string()))?;
    let vectors = elf.section_by_name(".vector_table");
    let vectors = vectors.and_then(|section| section.data().ok()).unwrap_or(&[]);
    let begin = vectors.first_chunk().map(|word| u32::from_le_bytes(*word));
    begin
        .and_then(|begin| begin.checked_sub(RAM))
        .map(|size| size as usize)
        .ok_or_else(|| bad("it says nothing of its stack".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_painted_is_used() {
        assert_eq!(Stack::of(&[PAINT; 8]), Stack { size: 8, deepest: 0 });
        let used = [PAINT, PAINT, 0, PAINT, 1];
        assert_eq!(Stack::of(&used), Stack { size: 5, deepest: 3 });
    }
}
