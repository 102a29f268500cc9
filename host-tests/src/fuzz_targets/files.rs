//! Files that a user gives to the client.

use penup_client::files::parse_or_panic;
use penup_client::fit::fit_obj;
use penup_client::operate::SavedSettings;
use penup_readers::files::Files;
use penup_readers::lines::Lines as _;
use penup_readers::page::Page;
use penup_readers::{
    Arrangement, PLAN_OPTIONS, ReadError, SourceFile, Turn, extensions_of_formats,
};
use std::panic::resume_unwind;

/// What separates a file from the bytes that choose its arrangement.
const MARK: &[u8] = b"\0arranged:";

/// The tolerance of fitted curves, in mm.
const TOLERANCE: f64 = 0.1;

/// Reads the input as a file of every format, once as it is and once arranged, fits curves to its
/// polylines, and reads it as a file of settings. A file that is refused is refused in a sentence,
/// and a line that is sent to the plotter is one line without control characters.
///
/// The bytes behind the last `MARK` choose the arrangement; see `arrangement`. Of an input
/// without a mark, the first bytes do.
///
/// # Panics
/// A reader panics, also one on a stack of its own, or a promise is broken.
pub fn fuzz(input: &[u8]) {
    let (file, choices) = divide(input);
    let arrangement = arrangement(file, choices);
    for name in names() {
        check(&name, file, &Arrangement::default());
        check(&name, file, &arrangement);
    }
    if let Ok(polylines) = read("fuzz.obj", file, &Arrangement::default())
        && let Err(error) = fit_obj(&polylines, file.len(), TOLERANCE, &mut |_, _| {})
    {
        assert!(!error.to_string().is_empty());
    }
    if let Ok(text) = std::str::from_utf8(file)
        && let Err(error) = SavedSettings::parse(text)
    {
        assert!(!error.to_string().is_empty());
    }
}

/// Names by which each reader is chosen, whatever the content is, and a name that leaves the choice
/// to the content.
pub fn names() -> impl Iterator<Item = String> {
    let chosen = extensions_of_formats().filter_map(|extensions| extensions.first());
    chosen.map(|extension| format!("fuzz.{extension}")).chain(["fuzz".to_owned()])
}

/// Reads a file, and checks its lines, or the words with which it is refused.
///
/// # Panics
/// A reader panics, also one on a stack of its own, or a promise is broken.
pub fn check(name: &str, file: &[u8], arrangement: &Arrangement) {
    match read(name, file, arrangement) {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(file) => {
            assert!(file.notes().iter().all(|note| !note.is_empty()), "{:?}", file.notes());
            for line in file.in_order() {
                assert!(!line.sent.contains(['\n', '\r', '\0']), "{:?}", line.sent);
            }
        }
    }
}

/// Whether the file in this input is accepted under this name.
pub fn is_accepted(name: &str, input: &[u8]) -> bool {
    read(name, divide(input).0, &Arrangement::default()).is_ok()
}

/// Reads a file. A panic of a reader on a stack of its own, which the client takes for a file that
/// cannot be read, goes on here.
fn read(name: &str, file: &[u8], arrangement: &Arrangement) -> Result<SourceFile, ReadError> {
    match parse_or_panic(name.to_owned(), file.to_vec(), arrangement) {
        Ok(read) => read,
        Err(panic) => resume_unwind(panic),
    }
}

/// Divides the input into a file and the bytes that choose its arrangement.
fn divide(input: &[u8]) -> (&[u8], &[u8]) {
    let at = input.windows(MARK.len()).rposition(|bytes| bytes == MARK);
    at.map_or((input, input), |at| (&input[..at], &input[at + MARK.len()..]))
}

/// An arrangement that these bytes choose: the page, how it is turned, its margin, whether the plan
/// is scaled to it, and then for each option of the table whether it is given, and its value. What
/// an option refuses is not given. A file to which this one refers has the same content.
fn arrangement(file: &[u8], choices: &[u8]) -> Arrangement {
    let mut choices = Choices(choices);
    let page = ["", "A4", "A6", "Letter", "1x1", "8000x3"][choices.below(6)];
    let turn = [Turn::AsItIs, Turn::Landscape, Turn::Automatic][choices.below(3)];
    let margin = [None, Some(0.0), Some(7.5), Some(1000.0)][choices.below(4)];
    let mut chosen = Arrangement::on(Page::parse(page).ok(), turn, margin);
    let title = [None, Some(""), Some("fuzz")][choices.below(3)];
    if let Some(title) = title {
        chosen = chosen.fitted(title, 5.0);
    }
    for option in PLAN_OPTIONS {
        if choices.below(2) == 0 {
            continue;
        }
        let value = match choices.below(5) {
            0 => "page".to_owned(),
            1 => choices.name(),
            numbers => {
                // One, two or four.
                let numbers = (0..[1, 2, 4][numbers - 2]).map(|_| choices.number());
                numbers.collect::<Vec<_>>().join(",")
            }
        };
        if let Err(refusal) = chosen.set(option.name, &value) {
            assert!(!refusal.is_empty());
        }
    }
    let file = file.to_vec();
    chosen.with_files(Files::read_by(move |_| Some(file.clone())))
}

/// The bytes that choose, of which each serves once. Behind the last, the first of all choices
/// is taken.
struct Choices<'i>(&'i [u8]);

impl Choices<'_> {
    /// A number below `bound`, which is at most 256.
    fn below(&mut self, bound: usize) -> usize {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        usize::from(*first) % bound
    }

    /// A number as text: tenths from -12.8 to 12.7, or one that is hardly ever meant.
    fn number(&mut self) -> String {
        let byte = self.below(256);
        match byte {
            0 => "0.001".to_owned(),
            1 => "1000000".to_owned(),
            2 => "90".to_owned(),
            3 => "nan".to_owned(),
            _ => format!("{:.1}", (byte as f64 - 128.0) / 10.0),
        }
    }

    /// The name of a layer or the names of some.
    fn name(&mut self) -> String {
        ["1", "2", "1,2", "2,1", "0", "fuzz", ",", "*"][self.below(8)].to_owned()
    }
}
