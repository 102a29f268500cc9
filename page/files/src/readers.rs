//! Reads files and arranges plans, by the readers that the client uses.

use crate::{Reading, arrangement};
use penup_readers::SourceFile;
use wasm_bindgen::prelude::wasm_bindgen;

/// Reads a file that the user calls `name`, and arranges its plan by `options`, a JSON array of
/// pairs of name and value. Returns a [`Reading`] as JSON.
///
/// # Errors
/// A sentence for the user that says what is wrong with the file or an option.
#[wasm_bindgen]
pub fn read(name: &str, bytes: Vec<u8>, options: &str) -> Result<Vec<u8>, String> {
    let options: Vec<(String, String)> =
        serde_json::from_str(options).map_err(|error| error.to_string())?;
    let arrangement = arrangement(&options)?;
    let file = SourceFile::arranged(name.to_owned(), bytes, &arrangement);
    let file = file.map_err(|error| error.to_string())?;
    serde_json::to_vec(&Reading::of(&file)).map_err(|error| error.to_string())
}

/// The formats that are read, with their extensions, for people.
#[wasm_bindgen]
pub fn file_names() -> String {
    penup_readers::list()
}

/// The extensions of the files that are read, each with its dot, with commas between them.
#[wasm_bindgen]
pub fn file_extensions() -> String {
    let dotted = penup_readers::extensions().map(|extension| format!(".{extension}"));
    dotted.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup_readers::Arrangement;
    use penup_readers::lines::Lines as _;

    const SVG: &[u8] = b"<svg xmlns='http://www.w3.org/2000/svg' width='40mm' height='30mm' \
                         viewBox='0 0 40 30'>\n<path d='M5 5H35V25' stroke='black' fill='none'/>\n\
                         <text>never drawn</text></svg>";

    fn reading(options: &str) -> Result<Reading, String> {
        let json = read("a.svg", SVG.to_vec(), options)?;
        serde_json::from_slice(&json).map_err(|error| error.to_string())
    }

    #[test]
    fn a_reading_has_what_the_reader_has() {
        let file = SourceFile::arranged("a.svg".into(), SVG.to_vec(), &Arrangement::default());
        let file = file.expect("an SVG");
        let reading = reading("[]").expect("read");
        assert_eq!(reading.notes(), file.notes());
        assert_eq!(reading.pages(), (file.page(), file.sheet()));
        assert_eq!(reading.bounds(), file.bounds());
        let lines = reading.into_lines("a.svg");
        assert_eq!(lines.count(), file.count());
        for index in 0..=file.count() {
            assert_eq!(lines.line(index), file.line(index), "line {index}");
        }
    }

    #[test]
    fn plans_are_arranged_and_wrong_values_are_refused_by_name() {
        let bounds = |options| reading(options).map(|reading| reading.bounds());
        assert_eq!(bounds("[]"), Ok(Some([[5.0, 5.0], [35.0, 25.0]])));
        let scaled = r#"[["scale","0.5"],["landscape","always"],["page","100x200"]]"#;
        assert_eq!(bounds(scaled), Ok(Some([[12.5, 10.0], [27.5, 20.0]])));
        let page = reading(scaled).expect("read").pages().1;
        assert_eq!((page.width, page.height), (200.0, 100.0));
        let refused = bounds(r#"[["hatch","nought"]]"#).expect_err("refused");
        assert!(refused.starts_with("--hatch: "), "{refused}");
        let refused = bounds(r#"[["pens","one"],["layer-order","1"]]"#).expect_err("refused");
        assert!(refused.contains("leave out --layer-order, or --pens one"), "{refused}");
        assert!(bounds(r#"[["pens","auto"],["layer-order","1"]]"#).is_ok());
    }
}
