//! Serves the page to a browser on this computer.
//!
//! The server listens on the loopback address alone, and every address of the page begins with a
//! random token, which only the person who started it knows. A request for another host, as a page
//! of the web could cause by its own name server, or from another origin, is refused. Nothing but
//! the files of the page, and the file to draw, can be read.

use crate::error::Error;
use std::collections::BTreeMap;
use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

/// What a browser may load and do: everything from this server, and nothing from elsewhere.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; \
                      img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; \
                      object-src 'none'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// The type of a text for people.
const TEXT: &str = "text/plain; charset=utf-8";
/// The longest time that a connection may say nothing.
const PATIENCE: Duration = Duration::from_secs(5);
/// The most bytes of the head of a request.
const LONGEST_HEAD: usize = 16 << 10;

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
}

/// An answer: the status, the type of the content, and the content.
type Answer<'a> = (u16, &'static str, &'a [u8]);

impl PageServer {
    /// Reads the page from `folder`, and the file to draw, and begins to listen at `port`, or at
    /// any that is free if it is 0.
    ///
    /// # Errors
    /// The page is not built, the file cannot be read, or the port is in use.
    pub fn new(folder: &Path, given: Option<&Path>, port: u16) -> Result<Self, Error> {
        let mut files = BTreeMap::new();
        collect(folder, "", &mut files).ok();
        if !files.contains_key("index.html") {
            return Err(Error::PageNotBuilt { folder: folder.to_owned() });
        }
        let given = match given {
            None => None,
            Some(path) => {
                let unreadable = |source| Error::File { file: path.display().to_string(), source };
                let bytes = std::fs::read(path).map_err(unreadable)?;
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                files.insert("given".to_owned(), bytes);
                Some(name)
            }
        };
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
            files,
            given,
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
        connection.set_read_timeout(Some(PATIENCE))?;
        connection.set_write_timeout(Some(PATIENCE))?;
        let mut head = Vec::new();
        let (status, kind, content, with_content) = loop {
            let mut part = [0; 4096];
            let count = connection.read(&mut part)?;
            head.extend_from_slice(part.get(..count).unwrap_or_default());
            let mut headers = [httparse::EMPTY_HEADER; 64];
            let mut request = httparse::Request::new(&mut headers);
            match request.parse(&head) {
                Ok(httparse::Status::Partial) if count > 0 && head.len() < LONGEST_HEAD => {}
                Ok(httparse::Status::Complete(_)) => {
                    let value = |name: &str| {
                        let mut own = request.headers.iter();
                        let header = own.find(|header| header.name.eq_ignore_ascii_case(name))?;
                        Some(String::from_utf8_lossy(header.value).into_owned())
                    };
                    let (host, origin) = (value("Host"), value("Origin"));
                    let method = request.method.unwrap_or_default();
                    let url = request.path.unwrap_or_default();
                    let (status, kind, content) =
                        self.answer(method, url, host.as_deref(), origin.as_deref());
                    break (status, kind, content, method != "HEAD");
                }
                _ => break (400, TEXT, b"This is no request.\n".as_slice(), true),
            }
        };
        let length = content.len();
        write!(
            connection,
            "HTTP/1.1 {status} \r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\
             Connection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: {POLICY}\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\r\n"
        )?;
        if with_content {
            connection.write_all(content)?;
        }
        // What is still coming is read, so that closing does not take the answer away.
        connection.shutdown(Shutdown::Write)?;
        io::copy(&mut connection.take(LONGEST_HEAD as u64), &mut io::sink()).map(drop)
    }

    /// Decides about a request by its method, its path, and the headers that say where it comes
    /// from.
    fn answer(
        &self,
        method: &str,
        url: &str,
        host: Option<&str>,
        origin: Option<&str>,
    ) -> Answer<'_> {
        let is_own = |host: &str| self.hosts.iter().any(|own| own == host);
        if !host.is_some_and(is_own) {
            return (403, TEXT, b"This server answers to the address that penup printed alone.\n");
        }
        let from_own = |origin: &str| origin.strip_prefix("http://").is_some_and(is_own);
        if origin.is_some_and(|origin| !from_own(origin)) {
            return (403, TEXT, b"Pages from elsewhere may not use this server.\n");
        }
        if !matches!(method, "GET" | "HEAD") {
            return (405, TEXT, b"This server only shows a page.\n");
        }
        let path = url.split(['?', '#']).next().unwrap_or_default();
        let behind = path.strip_prefix('/').and_then(|path| path.strip_prefix(&self.token));
        let Some(name) = behind.and_then(|rest| rest.strip_prefix('/')) else {
            return (403, TEXT, b"The address lacks its token: open the one that penup printed.\n");
        };
        let name = if name.is_empty() { "index.html" } else { name };
        match self.files.get(name) {
            Some(content) => (200, kind_of(name), content),
            None => (404, TEXT, b"The page has no such file.\n"),
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

    fn server() -> PageServer {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("index.html"), "the page").expect("written");
        std::fs::write(folder.path().join("a b.obj"), "v 0 0 0").expect("written");
        let file = folder.path().join("a b.obj");
        PageServer::new(folder.path(), Some(&file), 0).expect("a free port")
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
        let status = |method: &str, url: &str, host: Option<&str>, origin: Option<&str>| {
            server.answer(method, url, host, origin).0
        };
        let get = "GET";
        assert_eq!(server.answer(get, &page, Some(&host), None).2, b"the page");
        assert_eq!(server.answer(get, &format!("/{token}/given"), Some(&host), None).2, b"v 0 0 0");
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
        let error = PageServer::new(folder.path(), None, 0).map(drop).expect_err("refused");
        assert!(error.to_string().contains("cargo xtask page"), "{error}");
    }
}
