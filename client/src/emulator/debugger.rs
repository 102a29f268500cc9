//! The part of GDB's remote protocol that reads and writes the memory of QEMU's board.
//!
//! A packet consists of `$`, the text, `#` and two hexadecimal digits of the checksum. Each packet
//! is acknowledged with `+`.

use std::io::{self, BufRead, BufReader, Write};
use std::net::TcpStream;

/// The number of bytes of memory in a packet; QEMU accepts about two thousand.
const CHUNK: usize = 1024;

/// A debugger connection to QEMU, whose processor is stopped except after [`Debugger::run`].
#[derive(Debug)]
pub struct Debugger {
    stream: BufReader<TcpStream>,
}

impl Debugger {
    /// Takes over `stream`, the connection that QEMU's option `-gdb` opened.
    pub fn new(stream: TcpStream) -> Self {
        Self { stream: BufReader::new(stream) }
    }

    /// Writes `bytes` to memory, starting at `address`.
    pub fn write(&mut self, address: u32, bytes: &[u8]) -> io::Result<()> {
        for (at, chunk) in (address..).step_by(CHUNK).zip(bytes.chunks(CHUNK)) {
            let digits: String = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
            self.send(&format!("M{at:x},{:x}:{digits}", chunk.len()))?;
            if self.hear()? != "OK" {
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        Ok(())
    }

    /// Reads `count` bytes of memory, starting at `address`.
    pub fn read(&mut self, address: u32, count: usize) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(count);
        while bytes.len() < count {
            let chunk = CHUNK.min(count - bytes.len());
            self.send(&format!("m{:x},{chunk:x}", address as usize + bytes.len()))?;
            let digits = self.hear()?;
            let read = digits.as_bytes().chunks(2).map_while(|two| {
                std::str::from_utf8(two).ok().and_then(|two| u8::from_str_radix(two, 16).ok())
            });
            let before = bytes.len();
            bytes.extend(read);
            if bytes.len() - before != chunk {
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        Ok(bytes)
    }

    /// Starts the processor.
    pub fn run(&mut self) -> io::Result<()> {
        self.send("c")
    }

    /// Stops the processor.
    pub fn stop(&mut self) -> io::Result<()> {
        self.stream.get_mut().write_all(b"\x03")?;
        self.hear().map(drop)
    }

    /// Sends one packet, with its checksum.
    fn send(&mut self, text: &str) -> io::Result<()> {
        let sum = text.bytes().fold(0u8, u8::wrapping_add);
        self.stream.get_mut().write_all(format!("+${text}#{sum:02x}").as_bytes())
    }

    /// Reads the text of the next packet.
    fn hear(&mut self) -> io::Result<String> {
        self.stream.skip_until(b'$')?;
        let mut text = Vec::new();
        self.stream.read_until(b'#', &mut text)?;
        // A packet without its end means that the connection was closed.
        if text.pop() != Some(b'#') {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        String::from_utf8(text).map_err(|_| io::ErrorKind::InvalidData.into())
    }
}
