//! The deepest stack of a board, by the pattern that its boot does not find there any more.
//!
//! All of the stack, which lies at the start of RAM on every board, is painted before the first instruction.

use object::{Object, ObjectSection};

use super::EmulatorError;

/// Where RAM begins, on every board, and with it the stack.
pub const RAM: u32 = 0x2000_0000;
/// What an unused byte of the stack is painted with.
pub const PAINT: u8 = 0xA5;

/// How much of a stack is in use at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stack {
    /// Its bytes.
    pub size: usize,
    /// From its beginning to the deepest byte that was written.
    pub deepest: usize,
}

impl Stack {
    /// By what all of it holds, the lowest address first.
    pub fn of(bytes: &[u8]) -> Self {
        let untouched = bytes.iter().take_while(|&&byte| byte == PAINT).count();
        Self { size: bytes.len(), deepest: bytes.len() - untouched }
    }
}

/// The size of the stack of an ELF image: the first word of its vectors is where it begins.
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
