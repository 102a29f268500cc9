//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod exact_visibility;
pub mod fraction;
pub mod random_scenes;
pub mod scene_files;
