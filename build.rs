//! Picks the board's memory map and passes the link arguments.
//!
//! The arguments stand here and not in `.cargo/config.toml`, where a `RUSTFLAGS` in the environment
//! would replace them and the image would link empty.

use std::path::PathBuf;
use std::{env, fs, io};

/// Every board: its cargo feature, and the name of its map in `boards/`.
const BOARDS: [&str; 3] = ["lm3s6965", "pico", "mps2"];

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=boards");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }
    let chosen = BOARDS
        .into_iter()
        .filter(|board| env::var_os(format!("CARGO_FEATURE_{}", board.to_uppercase())).is_some());
    let [board] = chosen.collect::<Vec<_>>()[..] else {
        println!("cargo::error=choose one board: --features with one of {BOARDS:?}");
        return Ok(());
    };
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::copy(format!("boards/{board}.x"), out_dir.join("board.x"))?;
    println!("cargo::rustc-link-search={}", out_dir.display());
    let binaries: &[&str] =
        if board == "mps2" { &["bench", "bench-motion"] } else { &["firmware"] };
    for binary in binaries {
        println!("cargo::rustc-link-arg-bin={binary}=-Tlink.x");
        println!("cargo::rustc-link-arg-bin={binary}=--nmagic");
        if board != "mps2" {
            println!("cargo::rustc-link-arg-bin={binary}=-Tdefmt.x");
        }
        if board != "pico" {
            // Functions with the same instructions are stored once: flash is short.
            println!("cargo::rustc-link-arg-bin={binary}=--icf=all");
        }
    }
    Ok(())
}
