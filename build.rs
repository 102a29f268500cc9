//! Picks the board's memory map and passes the link arguments.
//!
//! The arguments stand here and not in `.cargo/config.toml`, where a `RUSTFLAGS` in the environment
//! would replace them and the image would link empty.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
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
    println!("cargo::rerun-if-changed=src");
    let mut digest = DefaultHasher::new();
    for folder in ["src", "boards"] {
        sources(Path::new(folder))?.hash(&mut digest);
    }
    // The versions of what it is built with decide about strokes, too. A package has no such file
    // of its own where another one depends on it.
    if let Ok(versions) = fs::read("Cargo.lock") {
        println!("cargo::rerun-if-changed=Cargo.lock");
        versions.hash(&mut digest);
    }
    println!("cargo::rustc-env=PENUP_SOURCES={:08x}", digest.finish() as u32);
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

/// Returns a number that differs between sources, of which this folder is the root: a firmware that
/// computes a drawing again asks whether it computes the same strokes.
fn sources(folder: &Path) -> io::Result<u32> {
    let mut digest = DefaultHasher::new();
    let entries: io::Result<Vec<_>> = fs::read_dir(folder)?.collect();
    let mut paths: Vec<PathBuf> = entries?.into_iter().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        path.hash(&mut digest);
        if path.is_dir() {
            sources(&path)?.hash(&mut digest);
        } else {
            fs::read(&path)?.hash(&mut digest);
        }
    }
    Ok(digest.finish() as u32)
}
