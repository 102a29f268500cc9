//! Owns the memory and joins the rest.
