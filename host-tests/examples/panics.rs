//! Lists the calls of panic functions that are left in the boards' images, by file.

use penup_client::emulator::image_path;
use penup_host_tests::panic_calls::panic_calls;
use std::collections::BTreeMap;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for board in ["lm3s6965", "pico"] {
        let calls = panic_calls(&std::fs::read(image_path(board))?)?;
        println!("{board}: {} calls of panic functions", calls.len());
        let mut files: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for call in &calls {
            let function = call.function.rsplit("::").next().unwrap_or_default();
            files.entry(&call.file).or_default().push(format!("{}: {function}", call.line));
        }
        for (file, lines) in files {
            println!("  {} {file}", lines.len());
            for line in lines {
                println!("      {line}");
            }
        }
    }
    Ok(())
}
