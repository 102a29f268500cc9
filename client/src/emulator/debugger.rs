//! GDB's remote protocol, as much of it as reads and writes QEMU's memory.
//!
//! A packet is `$`, text, `#` and two hexadecimal digits of its sum; each is answered by `+`.

use std::io::{self, BufRead, BufReader, Write};
use std::net::TcpStream;

/// Bytes of memory in a packet; QEMU takes some two thousand.
const CHUNK: usize = 1024;

/// A QEMU whose processor stands still, but for [`Debugger::run`].
#[derive(Debug)]
pub struct Debugger {
    stream: BufReader<TcpStream>,
}

impl Debugger {
    /// At the other end of QEMU's `-gdb`.
    pub fn new(stream: TcpStream) -> Self {
        Self { stream: BufReader::new(stream) }
    }

    /// Writes `bytes` to memory from `address` on.
    pub fn write(&mut self, address: u32, bytes: &[u8]) -> io::Result<()> {
        for (at, chunk) in (address..).step_by(CHUNK).zip(bytes.chunks(CHUNK)) {
            let digits: String = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
            self.tell(&format!("M{at:x},{:x}:{digits}", chunk.len()))?;
            if self.hear()? != "OK" {
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        Ok(())
    }

    /// Reads `count` bytes of memory from `address` on.
    pub fn read(&mut self, address: u32, count: usize) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(count);
        while bytes.len() < count {
            let chunk = CHUNK.min(count - bytes.len());
            self.tell(&format!("m{:x},{chunk:x}", address as usize + bytes.len()))?;
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

    /// Lets the processor run.
    pub fn run(&mut self) -> io::Result<()> {
        self.tell("c")
    }

    /// Stops it again.
    pub fn stop(&mut self) -> io::Result<()> {
        self.stream.get_mut().write_all(b"\x03")?;
        self.hear().map(drop)
    }

    fn tell(&mut self, text: &str) -> io::Result<()> {
        let sum = text.bytes().fold(0u8, u8::wrapping_add);
        self.stream.get_mut().write_all(format!("+${text}#{sum:02x}").as_bytes())
    }

    /// The text of the next packet.
    fn hear(&mut self) -> io::Result<String> {
        self.stream.skip_until(b'$')?;
        let mut text = Vec::new();
        self.stream.read_until(b'#', &mut text)?;
        // Without it the connection has ended.
        if text.pop() != Some(b'#') {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        String::from_utf8(text).map_err(|_| io::ErrorKind::InvalidData.into())
    }
}
