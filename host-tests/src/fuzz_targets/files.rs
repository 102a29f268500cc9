//! Files that a user gives to the client.

use penup_client::files::parse;
use penup_readers::Arrangement;
use penup_readers::lines::Lines as _;

/// The names under which an input is read. The extension decides the format; of an unknown one,
/// the content does.
const NAMES: [&str; 3] = ["fuzz.obj", "fuzz.svg", "fuzz"];

/// Reads the input as a file of every format. A file that is refused is refused in a sentence, and
/// a line that is sent to the plotter is one line without control characters.
pub fn fuzz(input: &[u8]) {
    for name in NAMES {
        match parse(name.to_owned(), input.to_vec(), &Arrangement::default()) {
            Err(error) => assert!(!error.to_string().is_empty()),
            Ok(file) => {
                for line in file.in_order() {
                    assert!(!line.sent.contains(['\n', '\r', '\0']), "{:?}", line.sent);
                }
            }
        }
    }
}
