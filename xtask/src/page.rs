//! Builds the page as static files, and tests it in a browser.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use crate::command::{cargo, run};
use crate::firmware;
use crate::set_up::{self, WEB_ASSEMBLY};
use crate::table::LM3S6965;

/// The packages of the page's programs. The first is loaded with the page, the other when it is
/// needed.
const PROGRAMS: [&str; 2] = ["penup-page", "penup-page-files"];

/// The level at which the library is compiled for the other program. Only the first one draws
/// frames, and must be fast; this level makes the readers the smallest.
const LEVEL_OF_READERS: &str = r#"profile.browser.package.penup.opt-level="s""#;

/// Builds the page into `target/page`.
pub fn build() -> Result<()> {
    set_up::target(WEB_ASSEMBLY)?;
    let root = crate::root();
    let built = root.join("target").join(WEB_ASSEMBLY).join("browser");
    let [page, readers] = PROGRAMS;
    for (package, level) in [(page, &[][..]), (readers, &["--config", LEVEL_OF_READERS])] {
        // Together, the first would have the features of the second.
        run(cargo()
            .current_dir(&root)
            .args(["build", "--quiet", "--profile=browser", "--target", WEB_ASSEMBLY])
            .args(["--package", package])
            .args(level))?;
    }
    // What builds the page is a workspace of its own, so that no other build compiles it.
    let builder = root.join("page/builder/Cargo.toml");
    if !root.join("target/page-builder").exists() {
        say!("penup: compiling what builds the page, once; this takes a minute or more")?;
    }
    run(cargo()
        .args(["run", "--quiet", "--locked", "--manifest-path"])
        .arg(builder)
        .arg("--target-dir")
        .arg(root.join("target/page-builder"))
        .arg("--")
        .arg(&root)
        .arg(folder())
        .args(PROGRAMS.map(|package| built.join(package.replace('-', "_") + ".wasm"))))
}

/// The folder of the page that was built.
pub fn folder() -> PathBuf {
    crate::root().join("target/page")
}

/// How the tests of the page are run.
#[derive(clap::Args)]
pub struct TestArguments {
    /// Writes the pictures of docs/page.md, too.
    #[arg(long)]
    pictures: bool,
    /// Measures frames instead, and prints the table of docs/performance.md.
    #[arg(long, conflicts_with = "pictures")]
    measure: bool,
}

/// Builds the page and the client, and tests them in Chromium without a window.
pub fn test(arguments: &TestArguments) -> Result<()> {
    // The page is joined to this board by the client.
    set_up::emulator(&LM3S6965)?;
    firmware::check(&LM3S6965, &firmware::build(&LM3S6965)?)?;
    build()?;
    run(cargo().current_dir(crate::root()).args([
        "build",
        "--quiet",
        "--package",
        "penup-client",
    ]))?;
    let mut node = if arguments.measure { node(&[], "measure.mjs")? } else { tests()? };
    if arguments.pictures {
        node.env("PENUP_PICTURES", crate::root().join("docs"));
    }
    run(&mut node)
}

/// The command that tests the page. The page, the client and the image of the LM3S6965 are built.
pub fn tests() -> Result<Command> {
    node(&["--test"], "tests.mjs")
}

/// The command that runs a program of the page's tests by Node with these options.
fn node(options: &[&str], program: &str) -> Result<Command> {
    let installed = set_up::browser()?;
    let root = crate::root();
    let mut node = Command::new("node");
    node.args(options).arg(root.join("page/browser-tests").join(program));
    let penup = root.join("target/debug/penup").with_extension(env::consts::EXE_EXTENSION);
    node.env("PENUP", penup)
        .env("PENUP_ROOT", &root)
        .env("PENUP_PAGE", folder())
        .env("PENUP_PAGE_TESTS", installed.packages)
        .env("PENUP_CHROMIUM", installed.chromium);
    Ok(node)
}
