//! A model in the lines of OBJ, and the `$` commands that edit, view and draw it.

use super::session::begun_by;

/// Lets a plotter that holds a tetrahedron receive the input as lines of OBJ and `$` commands, with
/// the orders to the bench that `session` knows. The promises are those of `session`.
pub fn fuzz(input: &[u8]) {
    let beginning = b"$page=20x20\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n";
    begun_by(beginning, input);
}
