//! Checks the crates that penup depends on, which needs `cargo-deny`.

use anyhow::{Result, ensure};

use crate::command::{cargo, run};

/// Looks for crates with a known hole, without a maintainer, from an unknown source, or under a
/// licence that `deny.toml` does not allow.
///
/// # Errors
/// `cargo-deny` is missing, or there is such a crate.
pub fn deny() -> Result<()> {
    let mut version = cargo();
    version.args(["deny", "--version"]).current_dir(crate::root());
    let has_deny = version.output().is_ok_and(|out| out.status.success());
    ensure!(
        has_deny,
        "checking the dependencies needs cargo-deny; install it with\n\
         cargo install --locked cargo-deny"
    );
    for manifest in ["Cargo.toml", "fuzz/Cargo.toml", "page/builder/Cargo.toml"] {
        say!("penup: checking the crates of {manifest}")?;
        let manifest = crate::root().join(manifest);
        let mut check = cargo();
        check.args(["deny", "--workspace", "--manifest-path"]).arg(manifest);
        check.arg("--config").arg(crate::root().join("deny.toml")).arg("check");
        run(check.current_dir(crate::root()))?;
    }
    Ok(())
}
