//! Tools for the tests of the library: simulated machines, exact reference models, and helpers for
//! whole jobs.

#![allow(
    clippy::panic,
    clippy::expect_used,
    reason = "tests fail by panicking, and this crate contains only parts of tests"
)]

pub mod counted_board;
pub mod curve_reference;
pub mod cut_jobs;
pub mod damage;
pub mod enumeration;
pub mod order_drawings;
pub mod order_reference;
pub mod event_checker;
pub mod motion_cases;
pub mod motion_optimum;
pub mod motion_paths;
pub mod line_soak;
pub mod meshes;
pub mod noise;
pub mod noisy_line;
pub mod panic_calls;
pub mod pico_byte_cuts;
pub mod pico_cuts;
#[cfg(unix)]
pub mod pico_terminal;
pub mod pin_machine;
pub mod camera_scenes;
pub mod exact_picture;
pub mod exact_visibility;
pub mod fraction;
pub mod random;
pub mod random_scenes;
pub mod scene_files;
pub mod convex_any_faces;
pub mod convex_model;
pub mod convex_solids;
pub mod grbl_lines;
pub mod half_circles;
pub mod heaviest_jobs;
pub mod looks;
pub mod ink;
pub mod streamed_drawing;
pub mod transcript;
pub mod whole_jobs;
pub mod wish;
pub mod emulated_jobs;
pub mod fuzz_targets;
pub mod gear_train;
pub mod spiral;
pub mod step_edges;
/// How the Pico divides waits: the very file of the firmware.
#[path = "../../src/boards/pico/steps/waits.rs"]
pub mod pico_waits;
pub mod usb_controller;
pub mod usb_firmware;
pub mod usb_host;
pub mod usb_port;
pub mod usb_reference;
pub mod usb_twins;
