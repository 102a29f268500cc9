use super::*;
use crate::link::Answer;
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::sync::atomic::AtomicUsize;
use std::time::Instant;

/// What the plotter of a test has got, and how often its line was opened.
#[derive(Debug, Default)]
struct Seen {
    bytes: Mutex<Vec<u8>>,
    opened: AtomicUsize,
    breaks: AtomicBool,
}

/// A plotter that answers each byte `?` with a status.
struct Answers {
    seen: Arc<Seen>,
    waiting: Vec<u8>,
}

impl Link for Answers {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        locked(&self.seen.bytes).extend_from_slice(bytes);
        for _ in bytes.iter().filter(|byte| **byte == b'?') {
            self.waiting.extend(b"<Run>\n");
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.seen.breaks.swap(false, Ordering::SeqCst) {
            return Err(io::Error::other("the device has been lost"));
        }
        let count = self.waiting.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.waiting[..count]);
        self.waiting.drain(..count);
        if count == 0 {
            thread::sleep(timeout);
        }
        Ok(count)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn ask_to_resume(&mut self, _: bool) -> io::Result<Answer> {
        Ok(Answer::Nobody)
    }
}

/// A bridge to such a plotter, at an address.
fn bridge() -> (Arc<Seen>, String) {
    let seen = Arc::new(Seen::default());
    let far = Arc::clone(&seen);
    let bridge = Bridge::new(Box::new(move || {
        far.opened.fetch_add(1, Ordering::SeqCst);
        Ok(FarEnd::Port(Box::new(Answers { seen: Arc::clone(&far), waiting: Vec::new() })))
    }));
    let bridge = Arc::new(bridge.expect("a line"));
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let bridge = Arc::clone(&bridge);
            thread::spawn(move || bridge.serve(stream, Vec::new()));
        }
    });
    (seen, address)
}

/// A page at the bridge. The request for the WebSocket is the server's to answer.
fn page(address: &str) -> WebSocket<TcpStream> {
    let stream = TcpStream::connect(address).expect("connected");
    stream.set_read_timeout(Some(Duration::from_secs(10))).expect("set");
    WebSocket::from_raw_socket(stream, Role::Client, None)
}

/// Waits for the close of the page's connection. Returns its code and reason.
fn closed(page: &mut WebSocket<TcpStream>) -> (u16, String) {
    loop {
        match page.read() {
            Ok(Message::Close(Some(frame))) => {
                return (frame.code.into(), frame.reason.to_string());
            }
            Ok(_) => {}
            Err(error) => panic!("no reason: {error}"),
        }
    }
}

/// A page that holds the plotter. The place of the page before is free as soon as the bridge has
/// noticed that it has gone.
fn let_in(address: &str) -> WebSocket<TcpStream> {
    let began = Instant::now();
    loop {
        let mut page = page(address);
        page.send(Message::binary(&b"?"[..])).expect("sent");
        match page.read() {
            Ok(Message::Binary(_)) => return page,
            _ => assert!(began.elapsed() < Duration::from_secs(30), "the place stays taken"),
        }
    }
}

/// Checks that the plotter answers this page.
fn answers(page: &mut WebSocket<TcpStream>) {
    page.send(Message::binary(&b"?"[..])).expect("sent");
    assert_eq!(page.read().expect("an answer"), Message::binary(&b"<Run>\n"[..]));
}

#[test]
fn bytes_pass_in_both_directions_and_a_page_that_comes_back_rejoins() {
    let (seen, address) = bridge();
    let mut first = page(&address);
    answers(&mut first);
    first.close(None).expect("closed");
    drop(first);
    let_in(&address);
    assert_eq!(seen.opened.load(Ordering::SeqCst), 1, "the line stayed open");
}

#[test]
fn a_second_page_is_refused_with_a_reason_and_the_first_goes_on() {
    let (_, address) = bridge();
    let mut first = page(&address);
    answers(&mut first);
    let (code, reason) = closed(&mut page(&address));
    assert_eq!(code, TAKEN);
    assert!(reason.contains("Another page"), "{reason}");
    answers(&mut first);
}

#[test]
fn what_is_no_message_of_a_page_is_refused_whole_and_the_plotter_unharmed() {
    let (seen, address) = bridge();
    let long = vec![b'v'; 1 << 20];
    let messages = [
        (Message::binary(long), 1009, "too long"),
        (Message::binary(&b"!\0\x01garbage\x18"[..]), 1003, "no lines"),
        (Message::text("{\"pen\":\"all\"}"), 1003, "no order"),
        (Message::text("garbage"), 1003, "no order"),
    ];
    for (message, expected, said) in messages {
        let mut page = let_in(&address);
        page.send(message).expect("sent");
        let (code, reason) = closed(&mut page);
        assert_eq!(code, expected, "{reason}");
        assert!(reason.contains(said), "{reason}");
    }
    assert!(locked(&seen.bytes).iter().all(|byte| *byte == b'?'), "{:?}", seen.bytes);
    assert_eq!(seen.opened.load(Ordering::SeqCst), 1);
}

#[test]
fn two_hundred_megabytes_and_bytes_that_are_no_frames_are_refused() {
    let (seen, address) = bridge();
    // The head of a masked frame of 200 MB, and of one with a code that there is not.
    let huge = [&[0x82, 0xFF][..], &(200u64 << 20).to_be_bytes(), &[0; 4]].concat();
    for (bytes, expected) in [(huge, 1009), (vec![0xF3, 0x81, 0, 0, 0, 0, 7], 1002)] {
        let mut page = let_in(&address);
        let raw = page.get_mut();
        raw.write_all(&bytes).expect("sent");
        let mut head = [0; 4];
        raw.read_exact(&mut head).expect("a close frame");
        assert_eq!(head[0], 0x88, "a close frame");
        assert_eq!(u16::from_be_bytes([head[2], head[3]]), expected);
    }
    let_in(&address);
    assert_eq!(seen.opened.load(Ordering::SeqCst), 1);
}

#[test]
fn a_line_that_broke_is_told_and_opened_again() {
    let (seen, address) = bridge();
    let mut first = page(&address);
    answers(&mut first);
    seen.breaks.store(true, Ordering::SeqCst);
    let (code, reason) = closed(&mut first);
    assert_eq!(code, BROKEN);
    assert!(reason.contains("has been lost"), "{reason}");
    drop(first);
    let_in(&address);
    assert_eq!(seen.opened.load(Ordering::SeqCst), 2);
}
