//! Texts that the host needs and a board does not.

/// A value that exists on the host alone. In a board's image it takes no space, and neither do the
/// texts to which it refers. So a table may hold what only the client shows in the same row as what
/// the firmware uses.
///
/// ```
/// use penup::host_only::HostOnly;
/// const HELP: HostOnly<&str> = HostOnly::new("What the client explains at length");
/// # #[cfg(feature = "host")]
/// assert_eq!(HELP.get(), "What the client explains at length");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostOnly<T> {
    /// The value itself, on the host.
    #[cfg(any(test, feature = "host"))]
    value: T,
    /// Nothing, on a board; it only remembers the type.
    #[cfg(not(any(test, feature = "host")))]
    value: core::marker::PhantomData<T>,
}

impl<T: Copy> HostOnly<T> {
    /// Keeps `value` on the host and drops it on a board.
    #[cfg(any(test, feature = "host"))]
    pub const fn new(value: T) -> Self {
        Self { value }
    }

    /// Keeps `value` on the host and drops it on a board.
    #[cfg(not(any(test, feature = "host")))]
    pub const fn new(_: T) -> Self {
        Self { value: core::marker::PhantomData }
    }

    /// Returns the value, which exists on the host alone.
    #[cfg(any(test, feature = "host"))]
    pub const fn get(self) -> T {
        self.value
    }
}
