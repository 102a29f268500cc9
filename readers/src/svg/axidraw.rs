//! The names of layers by which AxiDraw is controlled: `%` first for a layer that is not plotted,
//! `!` for a pause before it, a number, and then `+S`, `+H` and `+D` with numbers of their own
//! (<https://wiki.evilmadscientist.com/AxiDraw_Layer_Control>).

/// The instructions to an AxiDraw in the name of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Control {
    /// The layer is not plotted.
    pub(super) is_documentation: bool,
    /// The machine pauses before the layer.
    pub(super) pauses: bool,
    /// The number of the layer, up to 1000.
    pub(super) number: Option<u32>,
    /// The speed of the lowered pen, in percent.
    pub(super) speed: Option<u32>,
    /// The height of the lowered pen, in percent.
    pub(super) height: Option<u32>,
    /// The wait before the layer, in ms.
    pub(super) delay: Option<u32>,
}

impl Control {
    /// Reads the name of a layer. What is no code of AxiDraw, and all behind it, is the user's
    /// text.
    pub(super) fn of(name: &str) -> Self {
        let mut control = Self::default();
        let mut rest = name.trim_start();
        if let Some(after) = rest.strip_prefix('%') {
            (control.is_documentation, rest) = (true, after);
        } else if let Some(after) = rest.strip_prefix('!') {
            (control.pauses, rest) = (true, after);
        }
        let (number, after) = number(rest.trim_start());
        if let Some(number) = number.filter(|number| *number <= 1000) {
            (control.number, rest) = (Some(number), after);
        }
        loop {
            let code = rest.trim_start();
            let mut letters = code.chars();
            if letters.next() != Some('+') {
                return control;
            }
            let letter = letters.next().map(|letter| letter.to_ascii_uppercase());
            let (value, after) = self::number(letters.as_str());
            // The last of several codes of one kind counts, and one out of its range does not.
            match (letter, value) {
                (Some('S'), Some(value)) => {
                    control.speed =
                        Some(value).filter(|it| (1..=110).contains(it)).or(control.speed);
                }
                (Some('H'), Some(value)) => {
                    control.height = Some(value).filter(|it| *it <= 100).or(control.height);
                }
                (Some('D'), Some(value)) => {
                    control.delay = Some(value).filter(|it| *it > 0).or(control.delay);
                }
                _ => return control,
            }
            rest = after;
        }
    }

    /// Returns the codes that a plotter of penup does not obey.
    pub(super) fn not_obeyed(self) -> Vec<String> {
        let codes = [("+S", self.speed), ("+H", self.height), ("+D", self.delay)];
        let code = |(code, value): (&str, Option<u32>)| Some(format!("{code}{}", value?));
        codes.into_iter().filter_map(code).collect()
    }
}

/// The number at the beginning of `text`, and what follows it.
fn number(text: &str) -> (Option<u32>, &str) {
    let end = text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len());
    let (digits, after) = text.split_at(end);
    (digits.parse().ok(), after)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_stand_before_the_text_of_the_user() {
        let usual = Control::default();
        for (name, expected) in [
            ("5 red", Control { number: Some(5), ..usual }),
            ("red 5", usual),
            ("% notes", Control { is_documentation: true, ..usual }),
            ("  %", Control { is_documentation: true, ..usual }),
            ("!3", Control { pauses: true, number: Some(3), ..usual }),
            ("!", Control { pauses: true, ..usual }),
            (
                "12+s40+H70 +d500 blue+S9",
                Control {
                    number: Some(12),
                    speed: Some(40),
                    height: Some(70),
                    delay: Some(500),
                    ..usual
                },
            ),
            ("+S20", Control { speed: Some(20), ..usual }),
            ("1+S20+S30", Control { number: Some(1), speed: Some(30), ..usual }),
            ("1+S200+H101", Control { number: Some(1), ..usual }),
            ("1001", usual),
            ("1+X5+S20", Control { number: Some(1), ..usual }),
            ("", usual),
        ] {
            assert_eq!(Control::of(name), expected, "{name}");
        }
        let codes = Control::of("12+S40+D5").not_obeyed();
        assert_eq!(codes, ["+S40", "+D5"]);
    }
}
