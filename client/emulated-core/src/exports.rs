//! What `quick_core.mjs` calls.
//!
//! Each function takes the chip that [`create`] has returned. JavaScript has one thread and calls
//! none of them from within another, except that the divider's functions are called by [`run`];
//! they do not touch the chip.

use core::ptr::null_mut;

use crate::chip::{Chip, Divider};

// SAFETY: `quick_core.mjs` imports functions with these arguments and results.
#[link(wasm_import_module = "divider")]
unsafe extern "C" {
    /// Reads the register of the divider at an offset within SIO.
    safe fn read(offset: u32) -> u32;
    /// Writes the register of the divider at an offset within SIO.
    safe fn write(offset: u32, value: u32);
}

/// The divider that rp2040js models.
struct Imported;

impl Divider for Imported {
    fn read(&mut self, offset: u32) -> u32 {
        read(offset)
    }

    fn write(&mut self, offset: u32, value: u32) {
        write(offset, value);
    }
}

/// Returns a new chip, which is never freed, or null if there is no memory for it.
#[unsafe(no_mangle)]
pub extern "C" fn create() -> *mut Chip {
    Chip::new().map_or(null_mut(), |chip| Box::into_raw(Box::new(chip)))
}

/// Defines an exported function that takes a chip and what follows it.
macro_rules! export {
    ($(#[$doc:meta])* $name:ident($chip:ident $(, $argument:ident: $type:ty)*) -> $result:ty
     $body:block) => {
        $(#[$doc])*
        ///
        /// # Safety
        /// `chip` was returned by [`create`] and is not null, and no other function uses it now.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(chip: *mut Chip $(, $argument: $type)*) -> $result {
            // SAFETY: as the caller promises.
            let $chip = unsafe { &mut *chip };
            $body
        }
    };
}

export! {
    /// Returns where the shared words begin.
    shared(chip) -> *mut u32 { (&raw mut chip.shared).cast() }
}
export! {
    /// Returns where RAM begins.
    ram(chip) -> *mut u8 { chip.ram.as_mut_ptr() }
}
export! {
    /// Returns where flash begins.
    flash(chip) -> *mut u8 { chip.flash.as_mut_ptr() }
}
export! {
    /// Executes instructions; see [`Chip::run`].
    run(chip, limit: u32) -> u32 { chip.run(limit, &mut Imported) }
}
export! {
    /// Fetches the instruction at an address; see [`Chip::fetch`].
    fetch(chip, address: u32) -> () { chip.fetch(address); }
}
export! {
    /// Reads data at an address; see [`crate::Cache::data`].
    data(chip, address: u32) -> u32 { chip.cache.data(&mut chip.shared, address) }
}
export! {
    /// Empties the cache.
    flush(chip) -> () { chip.cache.flush(&mut chip.shared); }
}
export! {
    /// Adds a mark to the instruction at an address, or removes one.
    mark(chip, address: u32, adds: u32) -> () { chip.marks.change(address, adds != 0); }
}
