//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod order_reference;
pub mod pin_machine;
pub mod scene_files;
