//! Bytes to lines to typed commands, and replies.
