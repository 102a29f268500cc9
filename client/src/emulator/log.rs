//! Decodes the board's log, which consists of defmt frames, with the table in the image.

use std::io::Read;

use defmt_decoder::{DecodeError, Table};

use super::EmulatorError;

/// Reads the log table of `image`, the bytes of an ELF file; `None` if the firmware logs nothing.
pub fn table(image: &[u8]) -> Result<Option<Table>, EmulatorError> {
    Table::parse(image).map_err(|error| EmulatorError::BadImage { reason: format!("{error:#}") })
}

/// Decodes the frames from `input` until it ends, and passes each as text to `line`.
pub fn decode(table: &Table, mut input: impl Read, mut line: impl FnMut(String)) {
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 1024];
    while let Ok(count) = input.read(&mut buffer)
        && count > 0
    {
        decoder.received(&buffer[..count]);
        loop {
            match decoder.decode() {
                Ok(frame) => line(frame.display(false).to_string()),
                Err(DecodeError::UnexpectedEof) => break,
                // The decoder has already skipped the frame.
                Err(DecodeError::Malformed) => line("(a malformed log frame)".to_owned()),
            }
        }
    }
}
