//! Reads SVG files as plans: what they show is drawn at true size, at its place on the page.
//!
//! `usvg` resolves styles, units (96 pixels in an inch), the viewBox, references and transforms.
//! [`flatten`] makes polylines of the paths, [`clip`] cuts them at the page and
//! [`region`](crate::region) at clip paths, [`pens`] chooses pens by layers or colours, and
//! [`Plan`] writes the lines that are sent. [`unread`] knows what all of this does not read. Before
//! all that, [`runs`] joins lines, which saves memory.
//!
//! A plotter draws lines: a stroke is drawn along its middle, with its dashes, whatever its width;
//! a dot with round or square ends is a very short line; a shape that is only filled is drawn as
//! its outline. What has neither is not drawn, nor what would not be seen: a filled shape without
//! an area, and a white one where no other colour lies below it and not all is white. Texts are
//! drawn as the outlines of their letters, if the caller knows fonts. Clip paths cut lines off, and
//! are a part of the outline of what is only filled, and so do masks ([`areas`]). An image that is
//! an SVG is drawn ([`embedded`]). Other images, filters and patterns are counted, and the user is
//! told.
//!
//! The names of layers may hold the codes of AxiDraw ([`axidraw`]).
//!
//! The reader refuses files that are no SVG, have nothing to draw, or have more points than fit in
//! memory.

mod areas;
mod axidraw;
mod clip;
mod count;
mod css;
mod drawing;
mod embedded;
mod encoding;
mod flatten;
mod lengths;
mod markup;
mod pens;
mod runs;
mod styles;
#[cfg_attr(not(feature = "text"), path = "svg/no_text.rs")]
mod text;
mod unread;
mod uses;

use super::arrange::Arrangement;
use super::counted;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::{Area, Plan};
use crate::page::Page;
use crate::region::length;
use drawing::{Drawing, PIXEL};
use embedded::Embedded;
use markup::Markup;
use std::fmt::Display;
use std::sync::Arc;
use text::TextFonts;
use usvg::roxmltree::Error as XmlError;
use usvg::{Error, Options, Tree};

/// The format itself.
#[derive(Debug)]
pub(super) struct Svg;

impl Format for Svg {
    fn name(&self) -> &'static str {
        "SVG"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["svg", "svgz"]
    }

    /// `usvg` takes 1024 nested elements, for each of which it calls itself several times.
    fn nests(&self) -> bool {
        true
    }

    /// The file begins with a tag, and one of its first is `svg`.
    fn recognises(&self, beginning: &[u8]) -> bool {
        let text = beginning.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(beginning).trim_ascii_start();
        text.starts_with(b"<") && beginning.windows(4).any(|letters| letters == b"<svg")
    }

    fn may_be_binary(&self, beginning: &[u8]) -> bool {
        [encoding::GZIP, b"\xFF\xFE", b"\xFE\xFF"].iter().any(|it| beginning.starts_with(it))
    }

    fn read(
        &self,
        file: String,
        bytes: Vec<u8>,
        arrangement: &Arrangement,
    ) -> Result<Contents, ReadError> {
        let refused = |reason: String| ReadError::Content { file: file.clone(), reason };
        let text = encoding::text(bytes).map_err(refused)?;
        let text = match runs::joined(&text) {
            Some(joined) => joined,
            None => text,
        };
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(&text);
        contents(&file, text, arrangement).map_err(refused)
    }
}

/// What is said of a file that draws nothing, because it has no size.
const NO_SIZE: &str = "the SVG has no size: width and height must be above 0";

/// What is said of a file that is no XML.
fn not_well_formed(error: impl Display) -> String {
    format!("this is not a well-formed SVG ({error}): save it again, for example with Inkscape")
}

/// Reads `text`, the contents of `file`.
///
/// # Errors
/// The reason why it is not drawn, as a sentence.
fn contents(file: &str, text: &str, arrangement: &Arrangement) -> Result<Contents, String> {
    let text = markup::with_prefixes(text);
    let text = markup::with_ids(&text, &markup::parsed(&text).map_err(not_well_formed)?);
    let document = markup::parsed(&text).map_err(not_well_formed)?;
    if lengths::is_empty(document.root_element()) {
        return Err(NO_SIZE.to_owned());
    }
    let mut options = Options::default();
    let embedded = Arc::new(Embedded::default());
    embedded.serve(&mut options, arrangement.files.clone());
    let fonts = markup::has_text(&document).then(|| TextFonts::find(arrangement.fonts)).flatten();
    if let Some(fonts) = &fonts {
        fonts.serve(&mut options);
    }
    let tree = Tree::from_xmltree(&document, &options).map_err(|error| match error {
        Error::InvalidSize => NO_SIZE.to_owned(),
        Error::ElementsLimitReached | Error::ParsingFailed(XmlError::NodesLimitReached) => {
            "the SVG has too many elements, or they are nested too deeply".to_owned()
        }
        error => not_well_formed(error),
    })?;
    let size = [tree.size().width(), tree.size().height()];
    // What single precision adds to a length in mm is rounded away.
    let size = size.map(|size| (f64::from(size) * PIXEL * 1000.0).round() / 1000.0);
    let page = Page { width: size[0], height: size[1] };
    let markup = Markup::new(&document);
    let with_areas = arrangement.hatch.is_some();
    let mut drawing = Drawing::new(&tree, size, &markup, with_areas).map_err(|_| {
        "the SVG has too many points, too large clip paths or masks, or a curve of kilometres: \
         leave it out"
            .to_owned()
    })?;
    let mut plan = Plan::new(file.to_owned());
    let mut areas = Vec::new();
    let marks: Vec<_> = drawing.shapes.iter().map(|shape| shape.marks.clone()).collect();
    let chosen = pens::pens(&marks);
    for (shape, &(pen, layer)) in drawing.shapes.iter_mut().zip(&chosen.of_paths) {
        let (line, text) = shape.element.map_or((1, String::new()), |it| markup.position(it));
        plan.begin(line, &text);
        // The lines of a shape are freed as soon as the plan has them.
        for polyline in std::mem::take(&mut shape.polylines) {
            let points = polyline.positions();
            match points.first().filter(|_| shape.has_dots && length(&points) == 0.0) {
                Some(dot) => plan.draw_dot(*dot, Some(size), pen, layer),
                None => plan.draw_on(points, Some(size), pen, layer),
            }
        }
        if !shape.outlines.is_empty() {
            let (outlines, within) = (shape.outlines.clone(), shape.within.clone());
            let (is_even_odd, element) = (shape.is_even_odd, plan.element());
            areas.push(Area { outlines, is_even_odd, within, pen, layer, element });
        }
    }
    plan.layers = chosen.layers;
    plan.areas = Some(areas);
    let mut notes = markup.left_out(&drawing.seen, fonts.is_some());
    notes.extend(embedded.notes(fonts.is_some()));
    notes.extend(fonts.iter().flat_map(|fonts| fonts.notes(&drawing.texts)));
    notes.extend(pens::not_obeyed(&marks));
    notes.extend(not_as_it_is(&drawing));
    notes.extend(markup.size_note(page));
    if plan.is_empty() {
        let mut reasons = vec!["there is nothing to draw in this SVG".to_owned()];
        if drawing.documentation > 0 {
            let counted = counted(drawing.documentation, ["path is", "paths are"]);
            reasons.push(format!("{counted} in layers that are not plotted, as % says"));
        }
        if drawing.invisible > 0 {
            let counted = counted(drawing.invisible, ["path has", "paths have"]);
            reasons.push(format!("{counted} neither a stroke nor a fill that is seen"));
        }
        reasons.extend(notes);
        return Err(reasons.join("; "));
    }
    Ok(plan.contents(Some(page), notes))
}

/// What is drawn otherwise than the file says, in sentences for the user.
fn not_as_it_is(drawing: &Drawing<'_, '_, '_>) -> impl Iterator<Item = String> {
    [
        (
            drawing.documentation,
            ["path is", "paths are"],
            "not drawn: the name of the layer begins with %",
        ),
        (
            drawing.cut,
            ["path reaches", "paths reach"],
            "beyond the page of the SVG: the rest is cut off",
        ),
        (
            drawing.coarse,
            ["path lies", "paths lie"],
            "so far from the origin of its coordinates that it is drawn less exactly than a motor \
             step: move the drawing to the origin in the program that wrote it",
        ),
        (
            drawing.backgrounds,
            ["filled shape covers", "filled shapes cover"],
            "the whole page, as a background does: its outline is not drawn",
        ),
        (
            drawing.flat,
            ["path is", "paths are"],
            "not drawn: filled, but without an area and without a stroke",
        ),
        (
            drawing.white,
            ["shape is", "shapes are"],
            "not drawn: filled with white alone, on white paper; a stroke or another colour shows \
             it",
        ),
        (
            drawing.covering,
            ["white shape lies", "white shapes lie"],
            "on a filled one, and the lines of --hatch go through it",
        ),
        (
            drawing.patterns,
            ["path has", "paths have"],
            "a pattern, which is not drawn: only the path is",
        ),
        (
            drawing.nested_images,
            ["image in an SVG that is an image is", "images in an SVG that is an image are"],
            "not drawn",
        ),
        (
            drawing.masks,
            ["mask is", "masks are"],
            "not applied as a whole: what a gradient, an image, a pattern or a filter hides is \
             drawn",
        ),
        (drawing.filters, ["filter is", "filters are"], "not applied"),
        (
            drawing.strokeless,
            ["path is", "paths are"],
            "not drawn: the stroke has no width, or a paint that is not read",
        ),
        (drawing.undashed, ["line has", "lines have"], "too many dashes: drawn as a full line"),
    ]
    .into_iter()
    .filter(|(number, _, _)| *number > 0)
    .map(|(number, noun, what)| format!("{} {what}", counted(number, noun)))
}

#[cfg(test)]
mod tests;
