//! Reads Harrison's tapes of single motor steps as plans.
//!
//! A tape does not say how long a step is: it is that of a plotter with default settings, whose
//! tapes `penup tape encode` writes. The reader refuses codes that are no instruction.

use super::arrange::Arrangement;
use super::counted;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::Plan;
use penup::drawing::PagePoint;
use penup::machine::Setting;
use penup::step::tape::{BadCode, Decoder, TapeLines};

/// The format itself.
#[derive(Debug)]
pub(super) struct Tape;

impl Format for Tape {
    fn name(&self) -> &'static str {
        "Harrison's tape"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["tape"]
    }

    /// Nothing distinguishes a tape from other bytes.
    fn recognises(&self, _: &[u8]) -> bool {
        false
    }

    fn may_be_binary(&self, _: &[u8]) -> bool {
        true
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let refused = |reason| ReadError::Content { file: file.clone(), reason };
        let mut decoder = Decoder::new(bytes.iter().copied());
        let instructions: Vec<_> = decoder.by_ref().collect();
        if let Some(BadCode { row, code }) = decoder.damage() {
            return Err(refused(format!(
                "row {row} of the tape holds {code}, which is no instruction"
            )));
        }
        let step = 1.0 / Setting::StepsPerMmX.info().default.to_num::<f64>();
        let mm = |point: PagePoint| [point.x, point.y].map(|steps| f64::from(steps) * step);
        let mut plan = Plan::new(file.clone());
        plan.begin(1, "the tape");
        let mut at = PagePoint::default();
        let mut stroke: Vec<[f64; 2]> = Vec::new();
        for (end, pen_down) in TapeLines::new(at, instructions.into_iter()) {
            if pen_down {
                if stroke.is_empty() {
                    stroke.push(mm(at));
                }
                stroke.push(mm(end));
            } else if !stroke.is_empty() {
                plan.draw(std::mem::take(&mut stroke), None, 1);
            }
            at = end;
        }
        if !stroke.is_empty() {
            plan.draw(stroke, None, 1);
        }
        if plan.is_empty() {
            return Err(refused("the pen is never down on this tape".to_owned()));
        }
        Ok(plan.contents(None, end_note(&bytes).into_iter().collect()))
    }
}

/// Says what of a tape is missing or not drawn, because it has no stop, or more behind one.
///
/// ```
/// assert_eq!(penup_readers::end_note(&[0x33, 0xB0]), None);
/// assert!(penup_readers::end_note(&[0x33]).is_some());
/// ```
pub fn end_note(tape: &[u8]) -> Option<String> {
    let mut decoder = Decoder::new(tape.iter().copied());
    decoder.by_ref().for_each(drop);
    if decoder.damage().is_some() {
        return None;
    }
    if !decoder.has_stopped() {
        return Some(
            "the tape has no stop at its end: if it was cut off, a part is missing, so copy or \
             record it again"
                .to_owned(),
        );
    }
    let behind = decoder.count_rest();
    (behind > 0).then(|| {
        let instructions = counted(behind, ["instruction is", "instructions are"]);
        format!(
            "{instructions} not drawn, behind the stop of the tape: if tapes were joined, draw \
             each by itself"
        )
    })
}

#[cfg(test)]
mod tests {
    use crate::tests::{notes, sent};

    /// Tapes of which a part is lost, or that were joined.
    #[test]
    fn a_tape_without_its_stop_and_what_is_behind_one_are_told() {
        let whole = [0xA0, 0x00, 0x33, 0x23, 0xB0, 0x00];
        assert_eq!(notes("a.tape", &whole), [""; 0]);
        let cut = "the tape has no stop at its end: if it was cut off, a part is missing, so copy \
                   or record it again";
        assert_eq!(notes("a.tape", whole.get(..4).expect("bytes")), [cut]);
        let behind = |count: &str| {
            format!(
                "{count} not drawn, behind the stop of the tape: if tapes were joined, draw \
                 each by itself"
            )
        };
        assert_eq!(notes("a.tape", &[&whole[..], &whole].concat()), [behind("5 instructions are")]);
        assert_eq!(notes("a.tape", &[&whole[..], &[3, 0]].concat()), [behind("1 instruction is")]);
    }

    #[test]
    fn runs_of_steps_are_lines_of_a_plan() {
        // Pen down, right 2, up right, right, pen up.
        let lines = sent("a.tape", &[0xA0, 0x00, 0x33, 0x23, 0xB0, 0x00]);
        let lines = lines.expect("a tape");
        assert_eq!(lines.first().map(String::as_str), Some("usemtl pen1"));
        assert_eq!(lines.get(1).map(String::as_str), Some("v 0 0 0"));
        assert!(lines.contains(&"v 0.05 0.013 0".to_owned()), "{lines:?}");
        let error = sent("a.tape", &[0xF0]).expect_err("refused");
        assert!(error.contains("row 0 of the tape holds 15"), "{error}");
        let error = sent("a.tape", &[0x33]).expect_err("refused");
        assert!(error.contains("the pen is never down"), "{error}");
    }
}
