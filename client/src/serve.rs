//! Serves the page to a browser on this computer.
//!
//! The server listens on the loopback address alone, and every address of the page begins with a
//! random token, which only the person who started it knows. A request for another host, as a page
//! of the web could cause by its own name server, or from another origin, is refused. Nothing but
//! the files of the page, and the file to draw, can be read from the disk. The page may hand over
//! a file to be read in the fonts of this computer. If there is a [`Bridge`], it may ask for a
//! WebSocket to the plotter. For both it must say its origin.

mod read;

use crate::bridge::Bridge;
use crate::error::Error;
use crate::files;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;
use tungstenite::handshake::derive_accept_key;

/// What a browser may load and do: everything from this server, and nothing from elsewhere.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; \
                      img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; \
                      object-src 'none'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// The type of a text for people.
const TEXT: &str = "text/plain; charset=utf-8";
/// The longest time that a connection may say nothing.
const TIMEOUT: Duration = Duration::from_secs(5);
/// The most bytes of the head of a request.
const LONGEST_HEAD: usize = 16 << 10;
/// The most bytes of the file to draw. It is as much as the page opens, which is far more than any
/// plotter holds.
const LARGEST_FILE: u64 = 64 << 20;
/// The path of the WebSocket to the plotter.
const PLOTTER: &str = "plotter";
/// The path to which the page posts a file that is to be read.
const READ: &str = "read";

/// A served page.
#[derive(Debug)]
pub struct PageServer {
    listener: TcpListener,
    /// The hosts by which a browser may ask for it, with the port.
    hosts: [String; 2],
    token: String,
    /// The contents by their paths behind the token.
    files: BTreeMap<String, Vec<u8>>,
    /// The path of the file to draw, if there is one.
    given: Option<String>,
    bridge: Option<Bridge>,
}

/// A request of a browser: its path, and the headers that say where it comes from.
#[derive(Debug, Clone, Copy, Default)]
struct Request<'a> {
    method: &'a str,
    url: &'a str,
    host: Option<&'a str>,
    origin: Option<&'a str>,
    /// The key with which it asks for a WebSocket.
    key: Option<&'a str>,
    /// The number of bytes behind its head.
    length: Option<u64>,
}

/// An answer: the status, the type of the content, and the content.
type Answer<'a> = (u16, &'static str, Cow<'a, [u8]>);

/// A refusal in words.
const fn refused(status: u16, said: &'static str) -> Answer<'static> {
    (status, TEXT, Cow::Borrowed(said.as_bytes()))
}

impl PageServer {
    /// Reads the page from `folder`, and the file to draw, and begins to listen at `port`, or at
    /// any that is free if it is 0. A page may join the plotter of `bridge`, which has a name.
    ///
    /// # Errors
    /// The page is not built, the file cannot be read or is too large, or the port is in use.
    pub fn new(
        folder: &Path,
        given: Option<&Path>,
        port: u16,
        bridge: Option<(String, Bridge)>,
    ) -> Result<Self, Error> {
        let mut contents = BTreeMap::new();
        collect(folder, "", &mut contents).ok();
        if !contents.contains_key("index.html") {
            return Err(Error::PageNotBuilt { folder: folder.to_owned() });
        }
        let given = match given {
            None => None,
            Some(path) => {
                let bytes = files::bytes_up_to(path, LARGEST_FILE + 1)?;
                if bytes.len() as u64 > LARGEST_FILE {
                    let file = files::name(path);
                    return Err(Error::PageFileTooLarge { file, limit: LARGEST_FILE });
                }
                let name = files::name(path);
                let name = Path::new(&name).file_name().unwrap_or_default();
                let name = name.to_string_lossy().into_owned();
                contents.insert("given".to_owned(), bytes);
                Some(name)
            }
        };
        let (name, bridge) = bridge.unzip();
        let plotter = serde_json::json!({ "plotter": name });
        contents.insert(format!("{PLOTTER}.json"), plotter.to_string().into_bytes());
        let not_served = |reason: String| Error::PageNotServed { reason };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let listener = listener.map_err(|error| not_served(error.to_string()))?;
        let port = listener.local_addr().map_or(port, |address| address.port());
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(|e| not_served(e.to_string()))?;
        Ok(Self {
            listener,
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
            token: random.iter().map(|byte| format!("{byte:02x}")).collect(),
            files: contents,
            given,
            bridge,
        })
    }

    /// The address to open in a browser.
    pub fn address(&self) -> String {
        let given = self.given.as_deref().map(|name| format!("#given={}", percent_encoded(name)));
        format!("http://{}/{}/{}", self.hosts[0], self.token, given.unwrap_or_default())
    }

    /// Answers requests until the process ends.
    pub fn run(&self) {
        std::thread::scope(|scope| {
            for connection in self.listener.incoming().flatten() {
                // A connection that says nothing must not keep others waiting. One that breaks is
                // the browser's loss; it asks again.
                scope.spawn(move || self.serve(connection));
            }
        });
    }

    /// Answers the request of one connection, and closes it.
    fn serve(&self, mut connection: TcpStream) -> io::Result<()> {
        connection.set_read_timeout(Some(TIMEOUT))?;
        connection.set_write_timeout(Some(TIMEOUT))?;
        let mut head = Vec::new();
        let (answer, with_content) = loop {
            let mut part = [0; 4096];
            let count = connection.read(&mut part)?;
            head.extend_from_slice(part.get(..count).unwrap_or_default());
            let mut headers = [httparse::EMPTY_HEADER; 64];
            let mut parsed = httparse::Request::new(&mut headers);
            match parsed.parse(&head) {
                Ok(httparse::Status::Partial) if count > 0 && head.len() < LONGEST_HEAD => {}
                Ok(httparse::Status::Complete(length)) => {
                    let request = Request::of(&parsed);
                    if let Some((bridge, key)) = self.joined(&request) {
                        let key = derive_accept_key(key.as_bytes());
                        let tail = head.get(length..).unwrap_or_default().to_vec();
                        write!(
                            connection,
                            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\
                             Connection: Upgrade\r\nSec-WebSocket-Accept: {key}\r\n\r\n"
                        )?;
                        return bridge.serve(connection, tail);
                    }
                    if let Some(size) = self.size_to_read(&request) {
                        let begun = head.get(length..).unwrap_or_default().to_vec();
                        break (self.read(&mut connection, begun, size)?, true);
                    }
                    break (self.answer(&request), request.method != "HEAD");
                }
                _ => break (refused(400, "This is no request.\n"), true),
            }
        };
        let (status, kind, content) = answer;
        let length = content.len();
        write!(
            connection,
            "HTTP/1.1 {status} \r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\
             Connection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: {POLICY}\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\r\n"
        )?;
        if with_content {
            connection.write_all(&content)?;
        }
        // What is still coming is read, so that closing does not take the answer away.
        connection.shutdown(Shutdown::Write)?;
        io::copy(&mut connection.take(LONGEST_HEAD as u64), &mut io::sink()).map(drop)
    }

    /// The bridge that a request may use, and the key with which it asks for a WebSocket. `None` if
    /// it asks for something else, or may not.
    fn joined<'a>(&self, request: &Request<'a>) -> Option<(&Bridge, &'a str)> {
        let bridge = self.bridge.as_ref()?;
        // A browser always says the origin of a WebSocket.
        let is_own = request.origin.is_some() && self.refusal(request).is_none();
        let is_plotter =
            is_own && request.method == "GET" && self.name_of(request) == Some(PLOTTER);
        Some((bridge, request.key.filter(|_| is_plotter)?))
    }

    /// Why a request is refused, wherever it leads.
    fn refusal(&self, request: &Request<'_>) -> Option<Answer<'_>> {
        let is_own = |host: &str| self.hosts.iter().any(|own| own == host);
        if !request.host.is_some_and(is_own) {
            let said = "This server answers to the address that penup printed alone.\n";
            return Some(refused(403, said));
        }
        let from_own = |origin: &str| origin.strip_prefix("http://").is_some_and(is_own);
        if request.origin.is_some_and(|origin| !from_own(origin)) {
            return Some(refused(403, "Pages from elsewhere may not use this server.\n"));
        }
        if self.name_of(request).is_none() {
            let said = "The address lacks its token: open the one that penup printed.\n";
            return Some(refused(403, said));
        }
        None
    }

    /// The path of a request behind the token; `None` if it does not begin with the token.
    fn name_of<'a>(&self, request: &Request<'a>) -> Option<&'a str> {
        let path = request.url.split(['?', '#']).next().unwrap_or_default();
        path.strip_prefix('/')?.strip_prefix(&self.token)?.strip_prefix('/')
    }

    /// Decides about a request.
    fn answer(&self, request: &Request<'_>) -> Answer<'_> {
        if let Some(refusal) = self.refusal(request) {
            return refusal;
        }
        if !matches!(request.method, "GET" | "HEAD") {
            return refused(405, "This server only shows a page, and reads files for it.\n");
        }
        let name = self.name_of(request).unwrap_or_default();
        let name = if name.is_empty() { "index.html" } else { name };
        match self.files.get(name) {
            Some(content) => (200, kind_of(name), Cow::Borrowed(content)),
            None => refused(404, "The page has no such file.\n"),
        }
    }
}

impl<'a> Request<'a> {
    fn of(parsed: &httparse::Request<'_, 'a>) -> Self {
        let value = |name: &str| {
            let mut own = parsed.headers.iter();
            let header = own.find(|header| header.name.eq_ignore_ascii_case(name))?;
            // What is no text is no host and no origin of this server either.
            Some(std::str::from_utf8(header.value).unwrap_or_default())
        };
        Self {
            method: parsed.method.unwrap_or_default(),
            url: parsed.path.unwrap_or_default(),
            host: value("Host"),
            origin: value("Origin"),
            key: value("Sec-WebSocket-Key"),
            length: value("Content-Length").and_then(|length| length.parse().ok()),
        }
    }
}

/// Reads the files below `folder` by their paths, which begin with `prefix`.
fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            collect(&entry.path(), &format!("{name}/"), files)?;
        } else {
            files.insert(name, std::fs::read(entry.path())?);
        }
    }
    Ok(())
}

/// The type of a file's content, for a browser.
fn kind_of(name: &str) -> &'static str {
    match name.rsplit('.').next().unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "wasm" => "application/wasm",
        "svg" => "image/svg+xml",
        "json" | "webmanifest" => "application/json",
        _ => "application/octet-stream",
    }
}

/// A name with all bytes but letters, digits, `.`, `-` and `_` as `%` and two hexadecimal digits.
fn percent_encoded(name: &str) -> String {
    let encoded = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'.' | b'-' | b'_' => {
            char::from(byte).to_string()
        }
        _ => format!("%{byte:02X}"),
    };
    name.bytes().map(encoded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn server() -> PageServer {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("index.html"), "the page").expect("written");
        std::fs::write(folder.path().join("a b.obj"), "v 0 0 0").expect("written");
        let file = folder.path().join("a b.obj");
        PageServer::new(folder.path(), Some(&file), 0, None).expect("a free port")
    }

    #[test]
    fn the_address_has_a_token_and_names_the_file() {
        let (one, other) = (server(), server());
        assert_ne!(one.token, other.token);
        assert!(one.address().starts_with("http://127.0.0.1:"), "{}", one.address());
        assert!(one.address().ends_with(&format!("/{}/#given=a%20b.obj", one.token)));
    }

    #[test]
    fn only_the_owner_is_served() {
        let server = server();
        let (host, token) = (server.hosts[0].clone(), server.token.clone());
        let page = format!("/{token}/");
        let own = format!("http://{host}");
        let answer = |method: &str, url: &str, host: Option<&str>, origin: Option<&str>| {
            let (status, _, content) =
                server.answer(&Request { method, url, host, origin, key: None, length: None });
            (status, content.to_vec())
        };
        let status = |method: &str, url: &str, host: Option<&str>, origin: Option<&str>| {
            answer(method, url, host, origin).0
        };
        let get = "GET";
        assert_eq!(answer(get, &page, Some(&host), None).1, b"the page");
        assert_eq!(answer(get, &format!("/{token}/given"), Some(&host), None).1, b"v 0 0 0");
        assert_eq!(status(get, &page, Some(&host), Some(&own)), 200);
        for (url, host, origin, expected) in [
            // No token, a wrong one, and one that only begins right.
            ("/", Some(host.as_str()), None, 403),
            ("/0123456789abcdef0123456789abcdef/", Some(&host), None, 403),
            (&format!("/{token}0/"), Some(&host), None, 403),
            (&format!("/{token}"), Some(&host), None, 403),
            // Another name of this computer, which a name server of the web may give.
            (&page, Some("evil.example:80"), None, 403),
            (&page, Some("127.0.0.1"), None, 403),
            (&page, None, None, 403),
            (&page, Some(&host), Some("http://evil.example"), 403),
            (&page, Some(&host), Some("null"), 403),
            (&page, Some(&host), Some(&format!("https://{host}")), 403),
            // Nothing but its own files.
            (&format!("/{token}/../../etc/passwd"), Some(&host), None, 404),
            (&format!("/{token}/%2e%2e/x"), Some(&host), None, 404),
        ] {
            assert_eq!(status(get, url, host, origin), expected, "{url} {host:?} {origin:?}");
        }
        assert_eq!(status("POST", &page, Some(&host), None), 405);
    }

    #[test]
    fn a_page_that_is_not_built_is_an_error_that_says_so() {
        let folder = tempfile::tempdir().expect("a folder");
        let error = PageServer::new(folder.path(), None, 0, None).map(drop).expect_err("refused");
        assert!(error.to_string().contains("cargo xtask page"), "{error}");
    }
}
