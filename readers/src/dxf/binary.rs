//! The binary form of DXF, as the lines of its text form: a code and its value in turn.

use std::io::Write as _;

/// What is left of a file.
struct Rest<'b>(&'b [u8]);

impl<'b> Rest<'b> {
    fn bytes(&mut self, count: usize) -> Option<&'b [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    /// A text up to its byte 0.
    fn text(&mut self) -> Option<&'b [u8]> {
        let end = self.0.iter().position(|byte| *byte == 0)?;
        let text = self.bytes(end)?;
        self.bytes(1)?;
        Some(text)
    }

    /// A code: two bytes, or before release 13 one, and three from 255 on.
    fn code(&mut self, is_wide: bool) -> Option<i16> {
        if is_wide {
            return self.array().map(i16::from_le_bytes);
        }
        match self.array()? {
            [255] => self.array().map(i16::from_le_bytes),
            [code] => Some(code.into()),
        }
    }
}

/// The text form of the pairs behind the first line of a binary file; `None` if it is damaged.
pub(super) fn as_text(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut text = Vec::new();
    let mut rest = Rest(bytes);
    // The first pair is `0 SECTION`, whose code takes two bytes from release 13 on.
    let is_wide = bytes.get(1) == Some(&0);
    while !rest.0.is_empty() {
        let code = rest.code(is_wide)?;
        // Writing to a vector cannot fail.
        let _ = writeln!(text, "{code}");
        let value = match code {
            10..=59 | 110..=149 | 210..=239 | 460..=469 | 1010..=1059 => {
                f64::from_le_bytes(rest.array()?).to_string()
            }
            60..=79 | 170..=179 | 270..=289 | 370..=389 | 400..=409 | 1060..=1070 => {
                i16::from_le_bytes(rest.array()?).to_string()
            }
            90..=99 | 420..=429 | 440..=459 | 1071 => i32::from_le_bytes(rest.array()?).to_string(),
            160..=169 => i64::from_le_bytes(rest.array()?).to_string(),
            290..=299 => u8::from_le_bytes(rest.array()?).to_string(),
            310..=319 | 1004 => {
                let [length] = rest.array()?;
                // No chunk of bytes is drawn.
                rest.bytes(length.into())?;
                String::new()
            }
            _ => {
                text.extend(rest.text()?);
                String::new()
            }
        };
        text.extend(value.as_bytes());
        text.push(b'\n');
    }
    Some(text)
}
