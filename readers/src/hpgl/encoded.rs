//! The encoded polylines of HP-GL/2, `PE`: numbers in base 64 or 32, with flags between them.

use super::Plotter;

impl Plotter {
    /// Draws the encoded polyline of `PE`.
    pub(super) fn polyline(&mut self, data: &[u8]) -> Result<(), String> {
        let (mut is_up, mut is_absolute, mut base, mut fraction) = (false, false, 64u32, 0i64);
        let mut rest = data;
        let mut pair = Vec::new();
        let was_relative = std::mem::replace(&mut self.is_relative, true);
        self.is_down = true;
        while let [flag, after @ ..] = rest {
            rest = after;
            match flag {
                b'<' => is_up = true,
                b'=' => is_absolute = true,
                b'7' => base = 32,
                b':' | b'>' => {
                    let value = encoded(&mut rest, base).ok_or("PE ends within a number")?;
                    if *flag == b':' {
                        self.end_stroke();
                        self.pen = u32::try_from(value).unwrap_or(1).max(1);
                    } else {
                        fraction = value;
                    }
                }
                byte if byte.is_ascii_whitespace() => {}
                _ => {
                    let mut from = std::slice::from_ref(flag).to_vec();
                    from.extend_from_slice(rest);
                    let mut left = from.as_slice();
                    let value = encoded(&mut left, base).ok_or("PE ends within a number")?;
                    rest = &rest[rest.len() - left.len()..];
                    let value = value as f64 / 2f64.powi(i32::try_from(fraction).unwrap_or(0));
                    pair.push(value);
                    if pair.len() == 2 {
                        if is_up {
                            self.end_stroke();
                        }
                        self.is_down = !is_up;
                        self.is_relative = !is_absolute;
                        self.plot(&std::mem::take(&mut pair))?;
                        (is_up, is_absolute) = (false, false);
                    }
                }
            }
        }
        self.end_stroke();
        (self.is_relative, self.is_down) = (was_relative, false);
        if pair.is_empty() { Ok(()) } else { Err("PE ends within a pair".to_owned()) }
    }
}

/// Takes a number of `PE` from the beginning of `data`; `None` if it does not end.
fn encoded(data: &mut &[u8], base: u32) -> Option<i64> {
    let (mut value, mut place) = (0i64, 0u32);
    let (least, last) = if base == 64 { (63, 191) } else { (63, 95) };
    loop {
        let (&byte, rest) = data.split_first()?;
        *data = rest;
        let byte = byte & if base == 64 { 0xFF } else { 0x7F };
        if byte.is_ascii_whitespace() {
            continue;
        }
        let digit = i64::from(byte) - if byte >= last { i64::from(last) } else { least };
        if digit < 0 || place > 50 {
            return None;
        }
        value += digit << place;
        place += base.trailing_zeros();
        if byte >= last {
            let magnitude = value >> 1;
            return Some(if value & 1 == 1 { -magnitude } else { magnitude });
        }
    }
}
