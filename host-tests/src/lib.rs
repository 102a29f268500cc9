//! The simulated machine, the exact reference models and the tests of whole jobs.

pub mod convex_any_faces;
pub mod convex_model;
pub mod convex_solids;
