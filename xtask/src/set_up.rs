//! Finds or installs what building and testing need.
//!
//! | what | found as | installed by |
//! |---|---|---|
//! | `core` for the board | rustc's target directory | rustup; else Debian's compiler and sources |
//! | QEMU | `qemu-system-arm` | apt, or brew |
//! | rp2040js | `node` and `npm`; rp2040js in the target directory | apt, or brew; npm |
//! | the core of rp2040js | rustc's target directory | rustup |
//! | Chromium | `chromium` or another name of it | apt, or brew |
//! | playwright-core | as rp2040js is | apt, or brew; npm |
//! | rustfmt, clippy | `cargo fmt`, `cargo clippy` | rustup |

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, bail, ensure};

use crate::command::{cargo, describe, output, run, run_within};
use crate::table::{BoardRow, Emulator};

/// The compiler that builds for a target.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Toolchain {
    /// The Rust compiler in use, with `core` from rustup.
    Rustup,
    /// Debian's compiler, which builds `core` from Debian's sources.
    Debian,
}

/// Time limit for rustup. It takes seconds if the network can be reached, and may hang otherwise.
const RUSTUP_LIMIT: Duration = Duration::from_secs(120);

/// The compiler of the package `rustc-web`.
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
/// The path of the sources of `core`, from Debian's sysroot.
const DEBIAN_CORE: &str = "lib/rustlib/src/rust/library/core/Cargo.toml";

/// Finds or installs a compiler for `target`.
///
/// # Errors
/// There is none, and none can be installed.
pub fn toolchain(target: &str) -> Result<Toolchain> {
    if has_core(target) {
        return Ok(Toolchain::Rustup);
    }
    let refusal = refusal(target);
    if !refusal.exists() && add_target(target)? {
        return Ok(Toolchain::Rustup);
    }
    if !debian_is_ready() && output("apt-get", &["--version"]).is_some() {
        apt_install(&["rustc-web", "rust-web-src", "lld"])?;
    }
    ensure!(
        debian_is_ready(),
        "no compiler for {target}: run `rustup target add {target}` where the network can be \
         reached, or on Debian `apt-get install rustc-web rust-web-src lld`"
    );
    if !refusal.exists() {
        say!("penup: from now on Debian's compiler builds for {target}")?;
        fs::create_dir_all(refusal.parent().unwrap_or(&refusal))?;
        fs::write(&refusal, [])?;
    }
    Ok(Toolchain::Debian)
}

/// The target that browsers and Node run.
pub const WEB_ASSEMBLY: &str = "wasm32-unknown-unknown";

/// Finds or installs `target` for the compiler in use, by rustup alone.
///
/// # Errors
/// It is not there, and cannot be installed.
pub fn target(target: &str) -> Result<()> {
    ensure!(
        has_core(target) || add_target(target)?,
        "the compiler has no {target}: run `rustup target add {target}` where the network can be \
         reached"
    );
    Ok(())
}

/// Lets rustup install `target`, if there is rustup. Returns whether the compiler in use then has
/// it.
fn add_target(target: &str) -> Result<bool> {
    if output("rustup", &["--version"]).is_none() {
        return Ok(false);
    }
    say!("penup: installing the Rust target {target} by rustup")?;
    let mut rustup = Command::new("rustup");
    // A backtrace would hide the one line in which rustup gives its reason.
    rustup.args(["target", "add", target]).env("RUST_BACKTRACE", "0");
    match run_within(RUSTUP_LIMIT, &mut rustup) {
        Ok(()) if has_core(target) => return Ok(true),
        Ok(()) => say!("penup: rustup added {target} to another toolchain than cargo's")?,
        Err(error) => say!("penup: {error:#}")?,
    }
    Ok(false)
}

/// The path of a file that records that rustup could not install `target` for the compiler in use,
/// so that the next run does not wait for it again. A new compiler has another file, and `cargo
/// clean` deletes it.
fn refusal(target: &str) -> PathBuf {
    let version = output("rustc", &["--version"]).unwrap_or_default();
    let number = version.split(' ').nth(1).unwrap_or("unknown");
    crate::root().join(format!("target/set-up/rustc-{number}-without-{target}"))
}

/// Whether the compiler in use has `core` for `target`.
fn has_core(target: &str) -> bool {
    let Some(directory) = output("rustc", &["--print", "target-libdir", "--target", target]) else {
        return false;
    };
    let files = Path::new(&directory).read_dir().into_iter().flatten().flatten();
    files.map(|file| file.file_name()).any(|name| name.to_string_lossy().starts_with("libcore-"))
}

/// Whether Debian's compiler, its sources of `core` and its linker are installed.
fn debian_is_ready() -> bool {
    output("ld.lld", &["--version"]).is_some()
        && output(DEBIAN_RUSTC, &["--print", "sysroot"])
            .is_some_and(|sysroot| Path::new(&sysroot).join(DEBIAN_CORE).exists())
}

impl Toolchain {
    /// A cargo command (such as `build`, `check` or `clippy`) that compiles for `target`.
    pub fn cargo(self, command: &str, target: &str) -> Command {
        let mut cargo = cargo();
        cargo.current_dir(crate::root()).args([command, "--target", target]);
        if self == Self::Debian {
            // Its own target directory keeps Debian's std for proc macros and build scripts apart
            // from rustup's.
            cargo
                .args(["-Zbuild-std=core", "--target-dir", "target/debian"])
                .env("RUSTC", DEBIAN_RUSTC)
                .env("RUSTC_BOOTSTRAP", "1")
                .env(linker_variable(target), "ld.lld");
        }
        cargo
    }
}

/// The environment variable that tells cargo the linker of a target.
fn linker_variable(target: &str) -> String {
    format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace('-', "_"))
}

/// Finds or installs the emulator of `board`.
pub fn emulator(board: &BoardRow) -> Result<()> {
    match board.emulator {
        Emulator::Qemu { .. } => qemu(),
        Emulator::Rp2040js => rp2040js(),
    }
}

/// Finds or installs QEMU for Arm.
fn qemu() -> Result<()> {
    const PROGRAM: &str = "qemu-system-arm";
    let found = || output(PROGRAM, &["--version"]).is_some();
    if !found() {
        install(&[PROGRAM], "qemu")?;
    }
    if !found() {
        bail!("install QEMU so that `{PROGRAM} --version` works: https://www.qemu.org/download/");
    }
    Ok(())
}

/// Time limit for npm. It takes seconds if the network can be reached, and may hang otherwise.
const NPM_LIMIT: Duration = Duration::from_secs(120);
/// The oldest version of Node that rp2040js works with.
const LEAST_NODE: u32 = 18;
/// The oldest version of Node that playwright-core works with.
const LEAST_NODE_OF_PLAYWRIGHT: u32 = 20;

/// Finds or installs Node, and rp2040js in the version of the lock file beside the client's
/// emulator. Compiles the core with which that emulator is fast.
fn rp2040js() -> Result<()> {
    const CORE: &str = "penup-emulated-core";
    node_packages("rp2040js", LEAST_NODE, "client/src/emulator/rp2040js")?;
    target(WEB_ASSEMBLY)?;
    if !crate::root().join("target").join(WEB_ASSEMBLY).join("release").exists() {
        say!("penup: compiling the core of the emulated Pico, which takes a few seconds")?;
    }
    run(cargo().current_dir(crate::root()).args([
        "build",
        "--quiet",
        "--release",
        "--target",
        WEB_ASSEMBLY,
        "--package",
        CORE,
    ]))
}

/// What the tests of the page need.
pub struct Browser {
    /// The path of the program.
    pub chromium: String,
    /// The folder in which npm has installed what drives it.
    pub packages: PathBuf,
}

/// Finds or installs Chromium, and playwright-core in the version of the lock file beside the tests
/// of the page. playwright-core brings no browser.
pub fn browser() -> Result<Browser> {
    const FIND: &str = "command -v chromium || command -v chromium-browser || \
                        command -v google-chrome";
    let found = || output("sh", &["-c", FIND]);
    let chromium = match found() {
        Some(chromium) => Some(chromium),
        None => {
            install(&["chromium"], "chromium")?;
            found()
        }
    };
    let Some(chromium) = chromium else {
        bail!("install Chromium so that `chromium --version` works: https://www.chromium.org/");
    };
    let packages =
        node_packages("playwright-core", LEAST_NODE_OF_PLAYWRIGHT, "page/browser-tests")?;
    Ok(Browser { chromium, packages })
}

/// Finds or installs Node `least` or later, and `package` with npm, in the versions of the lock
/// file in the folder `from`. Returns the folder with the packages.
fn node_packages(package: &str, least: u32, from: &str) -> Result<PathBuf> {
    let node = || -> Option<u32> {
        let version = output("node", &["--version"])?;
        version.strip_prefix('v')?.split('.').next()?.parse().ok()
    };
    let found = || node().is_some_and(|version| version >= least);
    if !found() {
        install(&["nodejs"], "node")?;
    }
    ensure!(
        found(),
        "install Node {least} or later so that `node --version` works: https://nodejs.org/"
    );
    let from = crate::root().join(from);
    let to = crate::root().join("target").join(package);
    let lock = fs::read(from.join("package-lock.json"))?;
    // npm writes this file last, so if it exists, the installation is complete.
    let done = to.join("node_modules/.package-lock.json");
    if done.exists() && fs::read(to.join("package-lock.json")).is_ok_and(|found| found == lock) {
        return Ok(to);
    }
    if output("npm", &["--version"]).is_none() {
        install(&["npm"], "node")?;
    }
    say!("penup: installing {package} by npm")?;
    fs::create_dir_all(&to)?;
    fs::copy(from.join("package.json"), to.join("package.json"))?;
    fs::write(to.join("package-lock.json"), lock)?;
    let mut npm = Command::new("npm");
    npm.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]);
    run_within(NPM_LIMIT, npm.current_dir(&to))?;
    Ok(to)
}

/// Installs Debian packages if there is apt, else a package of Homebrew if there is brew.
fn install(debian: &[&str], brew: &str) -> Result<()> {
    if output("apt-get", &["--version"]).is_some() {
        return apt_install(debian);
    }
    if output("brew", &["--version"]).is_some() {
        say!("penup: installing {brew} by brew")?;
        return run(Command::new("brew").args(["install", brew]));
    }
    Ok(())
}

/// Finds or installs rustfmt and clippy, which a minimal Rust installation lacks.
pub fn checkers() -> Result<()> {
    for (command, component) in [("fmt", "rustfmt"), ("clippy", "clippy")] {
        let found = || output(&cargo_program(), &[command, "--version"]).is_some();
        if found() {
            continue;
        }
        say!("penup: installing {component} by rustup")?;
        let mut rustup = Command::new("rustup");
        let installed = run_within(RUSTUP_LIMIT, rustup.args(["component", "add", component]));
        if !found() {
            let reason = installed.err().map(|error| format!("{error:#}; ")).unwrap_or_default();
            bail!("{reason}run `{}` where the network can be reached", describe(&rustup));
        }
    }
    Ok(())
}

fn cargo_program() -> String {
    cargo().get_program().to_string_lossy().into_owned()
}

/// Installs Debian packages. If that fails, it refreshes apt's package lists, which may be outdated
/// or missing, and tries once more.
fn apt_install(packages: &[&str]) -> Result<()> {
    say!("penup: installing {} by apt-get", packages.join(" "))?;
    let install = || {
        let mut command = as_root("apt-get");
        command.args(["install", "--yes", "--no-install-recommends"]).args(packages);
        command
    };
    if run(&mut install()).is_ok() {
        return Ok(());
    }
    say!("penup: refreshing apt's package lists, then once more")?;
    let refreshed = run(as_root("apt-get").arg("update"));
    match refreshed.and_then(|()| run(&mut install())) {
        Ok(()) => Ok(()),
        Err(error) => bail!(
            "{error:#}\ninstall by hand, as root: apt-get update && apt-get install {}",
            packages.join(" ")
        ),
    }
}

/// A command that runs as root: directly if the user is root, else through sudo, which may ask for
/// the password.
fn as_root(program: &str) -> Command {
    let is_root = output("id", &["-u"]).is_some_and(|user| user == "0");
    let mut command = if is_root {
        Command::new(program)
    } else {
        let mut sudo = Command::new("sudo");
        sudo.arg(program);
        sudo
    };
    command.env("DEBIAN_FRONTEND", "noninteractive");
    command
}
