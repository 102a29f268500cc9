//! Camera from two points; projection to integers.
