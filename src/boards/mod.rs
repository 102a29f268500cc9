//! Pins, timer, serial line and storage of each board.
