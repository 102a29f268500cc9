//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod curve_reference;
pub mod order_reference;
