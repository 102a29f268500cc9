//! The heights of the pen that an emulated board is told, so that its pins say whether the pen is
//! down.

use penup_job::pins::PenHeights;

/// The most bytes of a line that are looked at.
const LONGEST_LINE: usize = 256;

/// The heights of the pen, as the lines say them that are sent to a board.
#[derive(Debug, Default)]
pub(super) struct ToldHeights {
    heights: PenHeights,
    /// The line that is being sent.
    line: Vec<u8>,
}

impl ToldHeights {
    /// The heights that the board has once it has read all that was sent.
    pub(super) fn heights(&self) -> PenHeights {
        self.heights
    }

    /// Takes bytes that are sent to the board.
    pub(super) fn hear(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if matches!(byte, b'\n' | b'\r') {
                self.line_ends();
            } else if self.line.len() < LONGEST_LINE {
                self.line.push(byte);
            }
        }
    }

    fn line_ends(&mut self) {
        let line = String::from_utf8_lossy(&self.line).into_owned();
        self.line.clear();
        // A line may have a number before the setting, and a checksum behind it.
        let value = |setting: &str| -> Option<u8> {
            let (_, value) = line.split_once(setting)?;
            let end = value.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(value.len());
            value.get(..end)?.parse().ok().filter(|height| *height <= 127)
        };
        if line.contains("$RST=$") || line.contains("$RST=*") {
            self.heights = PenHeights::default();
        }
        let PenHeights { up, down } = self.heights;
        self.heights.up = value("$210=").unwrap_or(up);
        self.heights.down = value("$211=").unwrap_or(down);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_those_of_the_lines_that_were_sent() {
        let mut told = ToldHeights::default();
        for (sent, up, down) in [
            ("$210=100", 0, 127),
            ("\n", 100, 127),
            ("N7 $211=20*33\r\nG0 X1\n", 100, 20),
            ("$211=300\n$212=5\n$210\n", 100, 20),
            ("$RST=$\n", 0, 127),
        ] {
            told.hear(sent.as_bytes());
            assert_eq!(told.heights(), PenHeights { up, down }, "{sent}");
        }
    }
}
