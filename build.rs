//! Picks the board's memory map and passes the link arguments.
//!
//! The arguments stand here and not in `.cargo/config.toml`, where a `RUSTFLAGS` in the environment
//! would replace them and the image would link empty.

use std::path::PathBuf;
use std::{env, fs, io};

#[path = "src/board_table.rs"]
#[allow(dead_code, reason = "it needs only the names of the boards and how they are linked")]
mod table;

use table::{BOARDS, BoardRow};

/// The machine on which instructions are counted. It is no board, but has a feature and a memory
/// map like one.
const BENCH: &str = "mps2";

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=boards");
    println!("cargo::rerun-if-changed=src/board_table.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }
    let names = BOARDS.map(|board| board.name).into_iter().chain([BENCH]);
    let chosen = names
        .clone()
        .filter(|board| env::var_os(format!("CARGO_FEATURE_{}", board.to_uppercase())).is_some());
    let [board] = chosen.collect::<Vec<_>>()[..] else {
        println!(
            "cargo::error=choose one board: --features with one of {:?}",
            names.collect::<Vec<_>>()
        );
        return Ok(());
    };
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::copy(format!("boards/{board}.x"), out_dir.join("board.x"))?;
    println!("cargo::rustc-link-search={}", out_dir.display());
    let binaries: &[&str] = if board == BENCH { &["bench", "bench-motion"] } else { &["firmware"] };
    for binary in binaries {
        println!("cargo::rustc-link-arg-bin={binary}=-Tlink.x");
        println!("cargo::rustc-link-arg-bin={binary}=--nmagic");
        if board != BENCH {
            println!("cargo::rustc-link-arg-bin={binary}=-Tdefmt.x");
        }
        if BoardRow::named(board).is_none_or(|board| board.folds_functions) {
            // Functions with the same instructions are stored once: flash is short.
            println!("cargo::rustc-link-arg-bin={binary}=--icf=all");
        }
    }
    Ok(())
}
