//! Data that an interrupt handler owns.

use core::cell::UnsafeCell;

/// A cell that is filled once and belongs to one interrupt handler from then on.
pub struct Owned<T>(UnsafeCell<Option<T>>);

// SAFETY: `fill` and `get` are never called at once, by their contracts; the value moves from the
// thread that fills to the handler, therefore `Send`.
unsafe impl<T: Send> Sync for Owned<T> {}

impl<T> Owned<T> {
    /// Makes an empty cell. [`Owned::fill`] gives it its value.
    pub const fn empty() -> Self {
        Self(UnsafeCell::new(None))
    }

    /// Gives the cell the value that the handler will own.
    ///
    /// # Safety
    /// The handler's interrupt is masked, and nobody holds what [`Owned::get`] gave.
    pub unsafe fn fill(&self, value: T) {
        // SAFETY: nobody else has access now, by the contract.
        unsafe { *self.0.get() = Some(value) };
    }

    /// Returns the value, or `None` before the cell was filled.
    ///
    /// # Safety
    /// Called by the handler itself, or while its interrupt is masked; the reference ends before
    /// the handler can run again.
    #[allow(clippy::mut_from_ref, reason = "the contract allows only one user at a time")]
    #[inline(always)]
    pub unsafe fn get(&self) -> Option<&mut T> {
        // SAFETY: no other reference lives, by the contract.
        unsafe { (*self.0.get()).as_mut() }
    }

    /// Returns the value without a check.
    ///
    /// # Safety
    /// As for [`Owned::get`], and it was filled before.
    #[allow(clippy::mut_from_ref, reason = "the contract allows only one user at a time")]
    #[inline(always)]
    pub unsafe fn get_filled(&self) -> &mut T {
        // SAFETY: no other reference lives and there is a value, by the contract.
        unsafe { (*self.0.get()).as_mut().unwrap_unchecked() }
    }
}
