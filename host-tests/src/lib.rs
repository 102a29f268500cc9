//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod order_reference;
pub mod event_checker;
pub mod motion_optimum;
pub mod pin_machine;
pub mod scene_files;
