//! Prints the scene of the picture that README begins with, as an OBJ file:
//!
//!     cargo run -p penup-host-tests --example gears > scenes/gears.obj
//!
//! `cargo xtask gallery` does this, and draws the picture.

use penup_host_tests::gear_train;

fn main() {
    print!("{}", gear_train::obj());
}
