//! Where the checkout is, whose firmware, scenes and emulators are used.
//!
//! It is looked for when the program runs: a checkout that was moved or copied with its target
//! directory must not go on in its old place, which the compiler once knew.

use std::env;
use std::path::{Path, PathBuf};

/// The root of the workspace that cargo runs this program for, else of the one in whose target
/// directory the program lies, else of the one that it was compiled in.
pub fn root() -> PathBuf {
    let by_cargo = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let by_program = env::current_exe().ok();
    let root_above =
        |path: PathBuf| path.ancestors().find(|path| is_root(path)).map(Path::to_owned);
    let found = [by_cargo, by_program].into_iter().flatten().find_map(root_above);
    found.unwrap_or_else(|| {
        let package = Path::new(env!("CARGO_MANIFEST_DIR"));
        package.parent().unwrap_or(package).to_owned()
    })
}

fn is_root(folder: &Path) -> bool {
    ["Cargo.toml", "scenes/interpen.obj", "client/Cargo.toml"]
        .iter()
        .all(|file| folder.join(file).is_file())
}
