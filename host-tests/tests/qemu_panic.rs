//! Tests what the LM3S6965 reports after a panic. No input makes the firmware panic, so the test
//! modifies an image: its serial interrupt goes directly to the panic handler.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::fs;
use std::time::Duration;

use object::{Object, ObjectSection, ObjectSymbol};
use penup_client::emulator::{EmulatedBoard, Emulator, Options, image_path};

type TestResult<T = ()> = Result<T, Box<dyn Error>>;

/// The offset of UART0's handler in the vector table: it follows the 16 exceptions of the core and
/// five ports.
const UART0_VECTOR: u64 = 4 * (16 + 5);

/// Creates the image whose serial interrupt causes a panic.
fn panicking_image() -> TestResult<Vec<u8>> {
    let mut bytes = fs::read(image_path("lm3s6965"))?;
    let elf = object::File::parse(&*bytes)?;
    let handler = elf
        .symbols()
        .find(|symbol| symbol.name().is_ok_and(|name| name.contains("rust_begin_unwind")))
        .ok_or("the image has no panic handler")?;
    let vectors = elf.section_by_name(".vector_table").ok_or("the image has no vectors")?;
    let (start, _) = vectors.file_range().ok_or("the vectors are not in the file")?;
    let index = usize::try_from(start + UART0_VECTOR)?;
    // Bit 0 says that it is Thumb code, as all of it is.
    let address = u32::try_from(handler.address())? | 1;
    bytes[index..index + 4].copy_from_slice(&address.to_le_bytes());
    Ok(bytes)
}

/// The output of the board until `end` arrives or nothing more does.
fn heard_until(emulator: &mut Emulator, end: &str) -> TestResult<String> {
    let mut heard = Vec::new();
    while !heard.ends_with(end.as_bytes()) {
        let mut buffer = [0; 1];
        if emulator.receive(&mut buffer, Duration::from_secs(10))? == 0 {
            return Err(format!("heard only {:?}", String::from_utf8_lossy(&heard)).into());
        }
        heard.extend_from_slice(&buffer);
    }
    Ok(String::from_utf8_lossy(&heard).into_owned())
}

#[test]
fn a_panic_tells_from_where_it_was_called_and_ctrl_x_resets() -> TestResult {
    let image = std::env::temp_dir().join(format!("penup-panic-{}.elf", std::process::id()));
    fs::write(&image, panicking_image()?)?;
    let mut emulator = Emulator::start(&image, Options::default())?;
    heard_until(&mut emulator, "for help]\r\n")?;
    fs::remove_file(&image)?;
    emulator.send(b"x")?;
    let report = heard_until(&mut emulator, "]\r\n")?;
    let calls = report
        .trim()
        .strip_prefix("[MSG:stopped by a fault, ctrl-X resets: panic, called from ")
        .and_then(|calls| calls.strip_suffix(']'))
        .ok_or_else(|| report.clone())?;
    // The core itself called the handler; what it interrupted was called from `main`, in flash.
    let calls: Vec<u32> = calls
        .split(' ')
        .map(|call| u32::from_str_radix(call.trim_start_matches("0x"), 16))
        .collect::<Result<_, _>>()?;
    let [_, interrupted @ ..] = &calls[..] else { return Err(report.into()) };
    assert!(
        !interrupted.is_empty() && interrupted.iter().all(|call| *call < 256 << 10),
        "{report}"
    );
    emulator.send(b"\x18")?;
    heard_until(&mut emulator, "for help]\r\n")?;
    Ok(())
}
