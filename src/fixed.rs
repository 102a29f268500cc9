//! Number formats, rounding, overflow: said once.
//!
//! Lengths on the page are [`Millimetres`]; on the pins, steps (`i32`). Numbers come in as
//! [`Decimal`] text and leave as text, exactly; no binary float stands between.

/// A length on the page: ±32768 mm in units of 2^-16 mm.
pub type Millimetres = ::fixed::types::I16F16;
