//! Builds the page as static files, for any web server: the programs from the images that cargo
//! has compiled, and the front end beside them. `cargo xtask page` runs it.
//!
//!     penup-page-builder ROOT FOLDER IMAGE…
//!
//! ROOT is the checkout, and FOLDER what is written, instead of all that it held. The first IMAGE
//! is loaded with the page, the others when they are needed.

use anyhow::{Context, Result, ensure};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use wasm_bindgen_cli_support::Bindgen;

/// The examples that the page offers.
const EXAMPLES: [&str; 6] = ["notched", "lattice3", "interpen", "lblock", "gears", "isobars"];

/// The most bytes, compressed, that a browser loads before the page can be used.
const FIRST_LOAD_LIMIT: usize = 500_000;

/// The most bytes, compressed, of all that a browser ever loads, without the examples.
const WHOLE_LIMIT: usize = 1_000_000;

fn main() -> Result<()> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [root, folder, images @ ..] = &arguments[..] else {
        anyhow::bail!("penup-page-builder ROOT FOLDER IMAGE…: `cargo xtask page` runs it");
    };
    // Files of an earlier build must not stay.
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    fs::create_dir_all(folder)?;
    for image in images {
        let mut bindgen = Bindgen::new();
        bindgen.input_path(image).typescript(false).remove_name_section(true);
        bindgen.remove_producers_section(true).web(true)?;
        bindgen.generate(folder)?;
    }
    copy(&root.join("page/www"), folder)?;
    let examples = folder.join("scenes");
    fs::create_dir_all(&examples)?;
    for name in EXAMPLES {
        let file = format!("{name}.obj");
        fs::copy(root.join("scenes").join(&file), examples.join(&file))?;
    }
    let files = files_below(folder)?;
    for script in files.iter().filter(|file| file.ends_with(".js") || file.ends_with(".css")) {
        let script = folder.join(script);
        fs::write(&script, without_comments(&fs::read_to_string(&script)?))?;
    }
    // The list of what the page keeps, so that it also works without a network.
    let list: Vec<String> = files.iter().map(|file| format!("\"{file}\"")).collect();
    let worker = folder.join("offline.js");
    let text = fs::read_to_string(&worker)?;
    ensure!(text.contains("/* FILES */"), "offline.js has no place for the list of files");
    let stamp = format!("{:x}", checksum(folder, &files)?);
    let text = text.replace("/* FILES */", &list.join(", ")).replace("/* STAMP */", &stamp);
    fs::write(&worker, text)?;
    let later: Vec<String> = (images.iter().skip(1))
        .filter_map(|image| Some(image.file_stem()?.to_string_lossy().into_owned()))
        .collect();
    report(folder, &files, &later)
}

/// Copies the files of a folder, and those of the folders in it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

/// A script or a style sheet without the lines that are comments and without indentation, which a
/// browser need not load. No text in quotes may go over several lines.
fn without_comments(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut is_comment = false;
    for line in text.split_inclusive('\n') {
        let words = line.trim();
        is_comment |= words.starts_with("/*");
        let ends = is_comment && words.ends_with("*/");
        if !is_comment && !words.starts_with("//") {
            kept.push_str(line.trim_start_matches([' ', '\t']));
        }
        is_comment &= !ends;
    }
    kept
}

/// The paths of all files below `folder`, sorted, with `/` between their parts.
fn files_below(folder: &Path) -> Result<Vec<String>> {
    let mut files = Vec::new();
    let mut folders = vec![(folder.to_owned(), String::new())];
    while let Some((folder, prefix)) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if entry.file_type()?.is_dir() {
                folders.push((entry.path(), format!("{name}/")));
            } else {
                files.push(name);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// A checksum of the files (FNV-1a), which names this build of the page.
fn checksum(folder: &Path, files: &[String]) -> Result<u64> {
    let mut sum: u64 = 0xcbf2_9ce4_8422_2325;
    for file in files {
        for byte in fs::read(folder.join(file))? {
            sum = (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    Ok(sum)
}

/// Prints the sizes, and refuses a page that takes too long to load. Files whose names begin like
/// those of a program in `later` are loaded when they are needed.
fn report(folder: &Path, files: &[String], later: &[String]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let (mut first, mut whole) = (0, 0);
    for file in files {
        let bytes = fs::read(folder.join(file))?;
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&bytes)?;
        let compressed = encoder.finish()?.len();
        let is_example = file.starts_with("scenes/");
        if !is_example {
            whole += compressed;
        }
        if !is_example && !later.iter().any(|program| file.starts_with(program)) {
            first += compressed;
        }
        writeln!(out, "{:>9} {compressed:>9} gzip  {file}", bytes.len())?;
    }
    for (what, size, limit) in
        [("first load", first, FIRST_LOAD_LIMIT), ("in all", whole, WHOLE_LIMIT)]
    {
        writeln!(out, "{what}: {size} bytes compressed, of {limit}")?;
        ensure!(size <= limit, "the page has {size} bytes compressed ({what}), above {limit}");
    }
    writeln!(out, "the page is in {}: serve it with `penup page`", folder.display())?;
    Ok(())
}
