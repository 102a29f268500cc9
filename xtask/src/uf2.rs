//! Converts images to UF2, for a boot ROM that shows a drive. A UF2 file consists of
//! blocks of 512 bytes, each with its address in flash. The format is that of Microsoft's UF2
//! specification.

use anyhow::{Result, ensure};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, elf};

/// Bytes of the image in each block.
const PAYLOAD: usize = 256;
const MAGIC: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const MAGIC_END: u32 = 0x0AB1_6F30;
/// The flag that the header contains the family number.
const FAMILY_PRESENT: u32 = 0x2000;

/// The UF2 image of an ELF file for chips of a `family`, whose flash begins at `start`. It contains
/// everything from there to the last byte that the file loads.
///
/// # Errors
/// The file is not a valid ELF file, or it loads something outside the flash, or nothing.
pub fn of_elf(image: &[u8], start: u64, family: u32) -> Result<Vec<u8>> {
    let header = elf::FileHeader32::<Endianness>::parse(image)?;
    let endian = header.endian()?;
    let mut flash = Vec::new();
    for segment in header.program_headers(endian, image)? {
        let bytes = segment.data(endian, image).unwrap_or_default();
        if segment.p_type(endian) != elf::PT_LOAD || bytes.is_empty() {
            continue;
        }
        let address = u64::from(segment.p_paddr(endian));
        ensure!(address >= start, "a segment at {address:#010x} lies before the flash");
        let offset = usize::try_from(address - start)?;
        let end = offset + bytes.len();
        ensure!(end <= 1 << 24, "a segment at {address:#010x} lies behind the flash");
        flash.resize(end.max(flash.len()), 0xFF);
        flash[offset..end].copy_from_slice(bytes);
    }
    ensure!(!flash.is_empty(), "the image has nothing for the flash");
    Ok(blocks(&flash, u32::try_from(start)?, family))
}

/// The blocks with the content of the flash from `start` on.
fn blocks(flash: &[u8], start: u32, family: u32) -> Vec<u8> {
    let count = flash.len().div_ceil(PAYLOAD) as u32;
    let mut blocks = Vec::new();
    for (number, payload) in (0..).zip(flash.chunks(PAYLOAD)) {
        let address = start + number * PAYLOAD as u32;
        let [magic, second] = MAGIC;
        let words = [magic, second, FAMILY_PRESENT, address, PAYLOAD as u32, number, count, family];
        let begin = blocks.len();
        blocks.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        blocks.extend(payload);
        blocks.resize(begin + 512 - size_of::<u32>(), 0);
        blocks.extend(MAGIC_END.to_le_bytes());
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_and_a_byte_are_two_blocks() {
        let flash: Vec<u8> = (0..=255).chain([7]).collect();
        let image = blocks(&flash, 0x1000_0000, 0xE48B_FF56);
        assert_eq!(image.len(), 1024);
        let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().unwrap());
        for (block, address) in [(0, 0x1000_0000), (512, 0x1000_0100)] {
            assert_eq!([word(block), word(block + 4)], MAGIC);
            assert_eq!((word(block + 12), word(block + 16)), (address, 256));
            assert_eq!((word(block + 20), word(block + 24)), (block as u32 / 512, 2));
            assert_eq!((word(block + 28), word(block + 508)), (0xE48B_FF56, MAGIC_END));
        }
        assert_eq!(image[32..288], flash[..256]);
        assert_eq!((image[512 + 32], image[512 + 33]), (7, 0));
    }
}
