//! Reads files for the page: it has no fonts for the texts of an SVG, and this computer has some.
//!
//! The page posts a line of JSON with the name of the file and the options that arrange plans, and
//! behind it the contents. The answer is a [`Reading`] as JSON, or a text: the sentence that says
//! what is wrong with the file. (A status of failure would stand in the browser's console.)
//! Nothing is written, and no file is opened but those of fonts.

use super::{Answer, LARGEST_FILE, PageServer, READ, Request, TEXT, refused};
use crate::files;
use penup_page_files::{Reading, arrangement};
use serde::Deserialize;
use std::borrow::Cow;
use std::io::{self, Read};

/// The most bytes of the line before the contents.
const LONGEST_LINE: u64 = 16 << 10;

/// The parts of a request that come before the contents of a file.
#[derive(Deserialize)]
struct Asked {
    name: String,
    /// Pairs of name and value.
    options: Vec<(String, String)>,
}

impl PageServer {
    /// The number of bytes that follow a request to read a file; `None` if it asks for something
    /// else, or may not.
    pub(super) fn size_to_read(&self, request: &Request<'_>) -> Option<u64> {
        // A browser always says the origin of what it posts.
        let is_own = request.origin.is_some() && self.refusal(request).is_none();
        let is_read = request.method == "POST" && self.name_of(request) == Some(READ);
        request.length.filter(|_| is_own && is_read)
    }

    /// Reads the file that comes over `connection`, `size` bytes with the line before it, of which
    /// those in `begun` have come already.
    ///
    /// # Errors
    /// The connection breaks before all has come.
    pub(super) fn read(
        &self,
        connection: &mut impl Read,
        begun: Vec<u8>,
        size: u64,
    ) -> io::Result<Answer<'static>> {
        if size > LARGEST_FILE + LONGEST_LINE {
            return Ok(refused(413, "The file is too large.\n"));
        }
        let mut bytes = begun;
        let missing = size.saturating_sub(bytes.len() as u64);
        connection.take(missing).read_to_end(&mut bytes)?;
        if bytes.len() as u64 != size {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(match reading(bytes) {
            Ok(json) => (200, "application/json", Cow::Owned(json)),
            Err(reason) => (200, TEXT, Cow::Owned(reason.into_bytes())),
        })
    }
}

/// Reads a file in the fonts of this computer.
fn reading(mut bytes: Vec<u8>) -> Result<Vec<u8>, String> {
    let line = bytes.iter().position(|byte| *byte == b'\n');
    let contents = bytes.split_off(line.map_or(bytes.len(), |end| end + 1));
    let Asked { name, options } =
        serde_json::from_slice(&bytes).map_err(|error| error.to_string())?;
    let arrangement = arrangement(&options)?;
    let file = files::parse(name, contents, &arrangement).map_err(|error| error.to_string())?;
    serde_json::to_vec(&Reading::of(&file)).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::tests::server;
    use super::*;

    const SVG: &str = "<svg xmlns='http://www.w3.org/2000/svg' width='40mm' height='30mm' \
                       viewBox='0 0 40 30'><path d='M5 5H35V25' stroke='black' fill='none'/></svg>";

    /// The answer to a posted file: its type, and what it says.
    fn answer(line: &str, contents: &str, begun: usize) -> (&'static str, String) {
        let posted = format!("{line}\n{contents}");
        let (begun, rest) = posted.as_bytes().split_at(begun);
        let size = posted.len() as u64;
        let (status, kind, said) =
            server().read(&mut &rest[..], begun.to_vec(), size).expect("an answer");
        assert_eq!(status, 200);
        (kind, String::from_utf8(said.into_owned()).expect("text"))
    }

    #[test]
    fn a_file_is_read_as_the_program_reads_it() {
        let line = r#"{"name":"a.svg","options":[["scale","0.5"]]}"#;
        for begun in [0, 7, line.len() + 20] {
            let (kind, json) = answer(line, SVG, begun);
            assert_eq!(kind, "application/json", "{json}");
            let arrangement = arrangement(&[("scale".into(), "0.5".into())]).expect("options");
            let file = files::parse("a.svg".into(), SVG.into(), &arrangement).expect("an SVG");
            assert_eq!(json, serde_json::to_string(&Reading::of(&file)).expect("JSON"));
            let reading: Reading = serde_json::from_str(&json).expect("a reading");
            let [low, high] = reading.bounds().expect("a plan");
            assert_eq!([high[0] - low[0], high[1] - low[1]], [15.0, 10.0], "half as large");
        }
    }

    #[test]
    fn what_is_wrong_is_said_in_a_sentence() {
        for (line, contents, reason) in [
            (r#"{"name":"a.svg","options":[]}"#, "<svg", "a.svg"),
            (r#"{"name":"a.svg","options":[["hatch","no"]]}"#, SVG, "--hatch"),
            ("nothing", SVG, "expected"),
            ("", "", "EOF"),
        ] {
            let (kind, said) = answer(line, contents, 0);
            assert_eq!(kind, TEXT, "{said}");
            assert!(said.contains(reason), "{said}");
        }
        let size = LARGEST_FILE + LONGEST_LINE + 1;
        let (status, ..) = server().read(&mut io::empty(), Vec::new(), size).expect("an answer");
        assert_eq!(status, 413);
        assert!(server().read(&mut io::empty(), Vec::new(), 9).is_err(), "it came in part only");
    }

    #[test]
    fn only_the_own_page_has_files_read() {
        let server = server();
        let host = server.hosts[0].clone();
        let own = format!("http://{host}");
        let url = format!("/{}/{READ}", server.token);
        let size = |method, url: &str, origin: Option<&str>| {
            let host = Some(host.as_str());
            server.size_to_read(&Request { method, url, host, origin, key: None, length: Some(9) })
        };
        assert_eq!(size("POST", &url, Some(&own)), Some(9));
        assert_eq!(size("POST", &url, None), None);
        assert_eq!(size("POST", &url, Some("http://evil.example")), None);
        assert_eq!(size("GET", &url, Some(&own)), None);
        assert_eq!(size("POST", "/read", Some(&own)), None);
        assert_eq!(size("POST", &format!("/{}/other", server.token), Some(&own)), None);
    }
}
