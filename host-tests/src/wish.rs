//! Numbers that a command hands to the tests which it runs.

/// The number in the environment variable `name`, which `cargo xtask` sets for a longer or another
/// run, or else `default`.
///
/// # Panics
/// The variable holds anything but a whole number.
pub fn wish(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name} is no whole number: {text}")),
        Err(_) => default,
    }
}
