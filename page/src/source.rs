//! Reads files by the readers that the client uses, too, with the formats that are small enough
//! to be loaded with the page.

use penup_readers::SourceFile;
use penup_readers::lines::Lines;
use std::rc::Rc;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::words::for_page;

/// Reads a file that the user calls `name`.
///
/// # Errors
/// A sentence for the user that says what is wrong with the file, and where.
pub fn read(name: &str, bytes: Vec<u8>) -> Result<Rc<dyn Lines>, String> {
    let file = SourceFile::new(name.to_owned(), bytes);
    let file = file.map_err(|error| for_page(&error.to_string()))?;
    Ok(Rc::new(file))
}

/// The formats that are read, with their extensions, for people.
#[wasm_bindgen]
pub fn file_names() -> String {
    penup_readers::list()
}

/// The extensions of the files that are read, each with its dot, with commas between them.
#[wasm_bindgen]
pub fn file_extensions() -> String {
    penup_readers::extensions()
        .map(|extension| format!(".{extension}"))
        .collect::<Vec<_>>()
        .join(",")
}
