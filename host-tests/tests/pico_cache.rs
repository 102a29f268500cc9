//! Tests the emulator's model of the cache in front of the Pico's flash in isolation.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::process::Command;

const MODEL: &str = include_str!("../../client/src/emulator/pico/xip_cache.mjs");

/// Reads the addresses in order on a chip without flash. Returns the wait cycles of each read.
const READS: &str = "
const chip = { core: {}, flash16: new Uint16Array(1 << 20) };
const cache = new XipCache(chip);
const waited = [];
for (const at of process.argv.at(-1).split(' ')) {
  cache.stalled = 0;
  if (at === 'flush') cache.flush();
  else if (at.startsWith('wide:')) {
    chip.flash16[(Number(at.slice(5)) & 0xffffff) >> 1] = 0xf000;
    cache.fetch(Number(at.slice(5)));
  } else if (at.startsWith('code:')) cache.fetch(Number(at.slice(5)));
  else cache.read(Number(at));
  waited.push(cache.stalled);
}
console.log(waited.join(' '));
";

fn waits(reads: &str) -> Result<String, Box<dyn Error>> {
    let script = format!("{MODEL}{READS}");
    let node = Command::new("node")
        .args(["--input-type=module", "--eval", &script, "--", reads])
        .output()?;
    assert!(node.status.success(), "{}", String::from_utf8_lossy(&node.stderr));
    Ok(String::from_utf8(node.stdout)?.trim().to_owned())
}

#[test]
fn lines_are_held_in_two_ways_until_flushed() -> Result<(), Box<dyn Error>> {
    // A line of 8 bytes.
    assert_eq!(waits("0x10000000 0x10000004 0x10000007 0x10000008")?, "50 0 0 50");
    // 8 KiB further lies the same set: the third drives out what was used longest ago.
    let three = "0x10000000 0x10002000 0x10000000 0x10004000 0x10000000 0x10002000";
    assert_eq!(waits(three)?, "50 50 0 50 0 50");
    assert_eq!(waits("0x10000000 flush 0x10000000")?, "50 0 50");
    Ok(())
}

#[test]
fn the_other_aliases_look_and_fill_as_the_data_sheet_says() -> Result<(), Box<dyn Error>> {
    // 0x11: looks, does not fill; 0x12: does not look, fills; 0x13: neither.
    assert_eq!(waits("0x11000000 0x10000000 0x11000000")?, "50 50 0");
    assert_eq!(waits("0x12000000 0x12000000 0x10000000")?, "50 50 0");
    assert_eq!(waits("0x13000000 0x10000000 0x13000000")?, "50 50 50");
    Ok(())
}

#[test]
fn code_waits_for_flash_alone_and_for_both_lines_of_a_long_instruction()
-> Result<(), Box<dyn Error>> {
    assert_eq!(waits("code:0x20000000 code:0x00000100 code:0x10000006")?, "0 0 50");
    assert_eq!(waits("wide:0x10000006 code:0x10000008")?, "100 0");
    Ok(())
}
