//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod scene_files;
