//! No fonts: what stands for `text.rs` where texts are not read.

use crate::fonts::Fonts;
use usvg::{Options, Text};

/// The fonts for one file, of which there are none.
#[derive(Debug)]
pub(super) enum TextFonts {}

impl TextFonts {
    pub(super) fn find(_: Fonts) -> Option<Self> {
        None
    }

    pub(super) fn serve(&self, _: &mut Options<'_>) {
        match *self {}
    }

    pub(super) fn notes(&self, _: &[&Text]) -> Vec<String> {
        match *self {}
    }
}
