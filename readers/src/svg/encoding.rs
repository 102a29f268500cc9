//! The text of an SVG: compressed or not, in UTF-8, UTF-16, or if the file says so in Latin-1 or
//! Windows-1252.

/// The bytes with which a file begins that gzip has compressed.
pub(super) const GZIP: &[u8] = b"\x1F\x8B";

/// The letters of Windows-1252 from 0x80 on, which Latin-1 leaves to control characters. Browsers
/// take files in Latin-1 for Windows-1252, too. Those that neither has stay as they are.
const WINDOWS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8D}', 'Ž', '\u{8F}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9D}', 'ž', 'Ÿ',
];

/// The letter of a byte in Windows-1252.
fn letter(byte: u8) -> char {
    let special = byte.checked_sub(0x80).and_then(|index| WINDOWS.get(usize::from(index)));
    special.copied().unwrap_or(char::from(byte))
}

/// The text in `bytes`, the contents of a file.
///
/// # Errors
/// The reason why they are no text, as a sentence.
pub(super) fn text(mut bytes: Vec<u8>) -> Result<String, String> {
    if bytes.starts_with(GZIP) {
        bytes = uncompressed(&bytes)
            .ok_or("this compressed SVG is damaged or not whole: copy or download it again")?;
    }
    let utf16 = |to_number: fn([u8; 2]) -> u16| {
        let (pairs, _) = bytes.as_chunks();
        String::from_utf16(&pairs.iter().map(|pair| to_number(*pair)).collect::<Vec<_>>())
    };
    let decoded = match bytes.as_slice() {
        [0xFF, 0xFE, ..] => utf16(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => utf16(u16::from_be_bytes),
        _ => {
            return String::from_utf8(bytes).or_else(|error| latin1(error.as_bytes()));
        }
    };
    decoded.map_err(|_| "this UTF-16 text is damaged: save it as UTF-8".to_owned())
}

/// What gzip has compressed; `None` if it is damaged.
#[cfg(feature = "svgz")]
fn uncompressed(bytes: &[u8]) -> Option<Vec<u8>> {
    usvg::decompress_svgz(bytes).ok()
}

/// Whoever leaves the feature out uncompresses files before they are read.
#[cfg(not(feature = "svgz"))]
fn uncompressed(_: &[u8]) -> Option<Vec<u8>> {
    None
}

/// The text in bytes that are no UTF-8, if the file says that they are Latin-1 or nearly so.
fn latin1(bytes: &[u8]) -> Result<String, String> {
    let head = String::from_utf8_lossy(bytes.get(..200).unwrap_or(bytes)).to_lowercase();
    let declaration = head.split("?>").next().unwrap_or_default();
    let is_said =
        ["iso-8859-1", "latin1", "windows-1252"].iter().any(|it| declaration.contains(it));
    match is_said {
        true => Ok(bytes.iter().map(|byte| letter(*byte)).collect()),
        false => Err("this is not UTF-8 text: save it as UTF-8".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letters_are_those_of_windows_1252() {
        for byte in 0..=u8::MAX {
            let bytes = [byte];
            let (text, ..) = encoding_rs::WINDOWS_1252.decode(&bytes);
            assert_eq!(text.chars().next(), Some(letter(byte)), "{byte:#x}");
        }
    }
}
