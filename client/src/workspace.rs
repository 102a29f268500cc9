//! Finds the checkout whose firmware, scenes and emulators the program uses.
//!
//! The search happens at run time: if a checkout is moved or copied with its target directory, the
//! program must use the new location and not the one that was compiled in.

use std::env;
use std::path::{Path, PathBuf};

/// The root of the workspace. The first of these that exists is used: the workspace for which cargo
/// runs this program, the one whose target directory contains the program, the one in which the
/// program was compiled.
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

/// Whether the folder is the root of the workspace.
fn is_root(folder: &Path) -> bool {
    ["Cargo.toml", "scenes/interpen.obj", "client/Cargo.toml"]
        .iter()
        .all(|file| folder.join(file).is_file())
}
