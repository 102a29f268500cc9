//! Reads the SVG files that stand as images in another one: as data in the file itself, or as a
//! file beside it.

use super::super::counted;
use super::encoding;
use super::markup::{self, Markup};
use crate::files::Files;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use usvg::roxmltree::NodeId;
use usvg::{Group, ImageHrefResolver, ImageKind, Node, Options, Tree};

/// The most bytes of images in all.
const MOST_BYTES: usize = 1 << 28;

/// The beginning of a PNG of one pixel, which says no more than its size.
const PIXEL: &[u8] = b"\x89PNG\r\n\x1A\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0";

/// What the images of a file need, and what is said about them.
#[derive(Debug, Default)]
pub(super) struct Embedded {
    found: Mutex<Found>,
}

#[derive(Debug, Default)]
struct Found {
    /// How many bytes were read.
    bytes: usize,
    /// The number of images within images that are files of their own.
    outside: usize,
    /// The number of SVG files with texts.
    with_texts: usize,
    /// What is not read of them, in sentences.
    unread: Vec<String>,
}

impl Embedded {
    /// Lets `usvg` read images that are SVG, those in other files with `files`. Any other image is
    /// replaced by one of a pixel, so that the drawing knows of it.
    pub(super) fn serve(self: &Arc<Self>, options: &mut Options<'_>, files: Files) {
        let (of_data, of_file) = (self.clone(), self.clone());
        options.image_href_resolver = ImageHrefResolver {
            resolve_data: Box::new(move |kind, data, options| {
                let is_svg = matches!(kind, "image/svg+xml" | "text/plain" | "text/xml");
                of_data.read(is_svg.then_some(data.as_slice()), options)
            }),
            resolve_string: Box::new(move |path, options| {
                let data = files.read(path);
                of_file.read(data.as_deref(), options)
            }),
        };
    }

    fn found(&self) -> MutexGuard<'_, Found> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads an SVG. Images within it are read meanwhile.
    fn read(&self, data: Option<&[u8]>, options: &Options<'_>) -> Option<ImageKind> {
        let tree = data.and_then(|data| self.tree(data, options)).map(ImageKind::SVG);
        Some(tree.unwrap_or_else(|| ImageKind::PNG(Arc::new(PIXEL.to_vec()))))
    }

    fn tree(&self, data: &[u8], options: &Options<'_>) -> Option<Tree> {
        let text = encoding::text(data.to_vec()).ok()?;
        let text = markup::with_ids(&text, &markup::parsed(&text).ok()?);
        let document = markup::parsed(&text).ok()?;
        {
            let mut found = self.found();
            found.bytes = found.bytes.saturating_add(text.len());
            if found.bytes > MOST_BYTES {
                return None;
            }
            found.with_texts += usize::from(markup::has_text(&document));
            found.outside += markup::references_to_files(&document);
        }
        let tree = Tree::from_data_nested(text.as_bytes(), options).ok()?;
        let markup = Markup::new(&document);
        let mut drawn = HashSet::new();
        note_drawn(tree.root(), &markup, &mut drawn);
        self.found().unread.extend(markup.shapes_left_out(&drawn));
        Some(tree)
    }

    /// Says what is not drawn of the images. `reads_text` says whether there are fonts.
    pub(super) fn notes(&self, reads_text: bool) -> Vec<String> {
        let found = self.found();
        let mut notes = Vec::new();
        if found.outside > 0 {
            let counted = counted(found.outside, ["image is", "images are"]);
            notes.push(format!("in an SVG that is an image, {counted} not drawn: other files"));
        }
        if found.with_texts > 0 && !reads_text {
            let counted = counted(found.with_texts, ["SVG that is an image", "SVGs as images"]);
            notes.push(format!("the texts of {counted} are not drawn, because no font is found"));
        }
        notes.extend(found.unread.iter().map(|said| format!("in an SVG that is an image, {said}")));
        notes
    }
}

/// Adds the elements to which a group and its contents belong.
fn note_drawn(group: &Group, markup: &Markup<'_, '_>, drawn: &mut HashSet<NodeId>) {
    drawn.extend(markup.element(group.id()));
    for node in group.children() {
        drawn.extend(markup.element(node.id()));
        if let Node::Group(group) = node {
            note_drawn(group, markup, drawn);
        }
    }
}
