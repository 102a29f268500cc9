//! Collects what the tree of `usvg` draws, as polylines on the page.

use super::clip::ConvexArea;
use super::flatten::{Arcs, Polyline, TooManyPoints, flatten};
use super::markup::Markup;
use super::pens::Marks;
use crate::arrange::clip_outline;
use kurbo::{Affine, Point};
use std::collections::HashSet;
use usvg::roxmltree::NodeId;
use usvg::tiny_skia_path::StrokeDash;
use usvg::{Group, Node, Paint, Path, Text, Transform, Tree};

/// The length of a pixel of CSS in mm: there are 96 in an inch.
pub(super) const PIXEL: f64 = 25.4 / 96.0;

/// How far outside of the page a line may lie without being cut, in mm. Single precision, in which
/// `usvg` computes, is no better on a large page.
const SLACK: f64 = 0.01;

/// How far outside of a clip path a line may lie without being cut, in mm: less than is written.
const CLIP_SLACK: f64 = 1e-4;

/// The most points before points are left out. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

/// A path of the drawing.
#[derive(Debug)]
pub(super) struct Shape {
    /// The element that it comes from, if that is known.
    pub(super) element: Option<NodeId>,
    /// What may choose its pen.
    pub(super) marks: Marks,
    /// What is drawn, in mm, with y upward from the lower left corner of the page.
    pub(super) polylines: Vec<Polyline>,
    /// The outlines of what is filled within the page, in the same way; empty if nothing is, or if
    /// nobody asks.
    pub(super) outlines: Vec<Vec<[f64; 2]>>,
}

/// All paths of an SVG, and what could not be drawn as the file says.
#[derive(Debug)]
pub(super) struct Drawing<'a, 'input, 'tree> {
    markup: &'a Markup<'a, 'input>,
    page: ConvexArea,
    with_areas: bool,
    budget: usize,
    /// The paths in the order of the file.
    pub(super) shapes: Vec<Shape>,
    /// The elements that were found in the tree.
    pub(super) seen: HashSet<NodeId>,
    /// The number of paths that have neither stroke nor fill, or are transparent.
    pub(super) invisible: usize,
    /// The number of paths in layers that are not plotted.
    pub(super) documentation: usize,
    /// The number of paths that reach beyond the page and are cut there.
    pub(super) cut: usize,
    /// The number of clip paths that are not applied.
    pub(super) clips: usize,
    /// The number of masks that are not applied.
    pub(super) masks: usize,
    /// The number of filters that are not applied.
    pub(super) filters: usize,
    /// The number of strokes with so many dashes that they are drawn as full lines.
    pub(super) undashed: usize,
    /// The texts that are drawn.
    pub(super) texts: Vec<&'tree Text>,
}

/// What applies to the contents of a group.
#[derive(Debug, Clone)]
struct Context {
    to_page: Affine,
    areas: Vec<ConvexArea>,
    /// The innermost group or text that is an element of the file.
    element: Option<NodeId>,
    /// Whether it is the outline of letters.
    is_text: bool,
}

impl<'a, 'input, 'tree> Drawing<'a, 'input, 'tree> {
    /// Collects the paths of `tree`, whose page has this size in mm, and their areas if the caller
    /// asks.
    ///
    /// # Errors
    /// There are too many points for the memory, or the page has no area.
    pub(super) fn new(
        tree: &'tree Tree,
        [width, height]: [f64; 2],
        markup: &'a Markup<'a, 'input>,
        with_areas: bool,
    ) -> Result<Self, TooManyPoints> {
        let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        let page = ConvexArea::new(&corners.map(|[x, y]| Point::new(x, y))).ok_or(TooManyPoints)?;
        let mut drawing = Self {
            markup,
            page,
            with_areas,
            budget: MOST_POINTS,
            shapes: Vec::new(),
            seen: HashSet::new(),
            invisible: 0,
            documentation: 0,
            cut: 0,
            clips: 0,
            masks: 0,
            filters: 0,
            undashed: 0,
            texts: Vec::new(),
        };
        let to_page = Affine::new([PIXEL, 0.0, 0.0, -PIXEL, 0.0, height]);
        let context = Context { to_page, areas: Vec::new(), element: None, is_text: false };
        drawing.group(tree.root(), &context)?;
        Ok(drawing)
    }

    fn group(&mut self, group: &'tree Group, outside: &Context) -> Result<(), TooManyPoints> {
        let mut context = outside.clone();
        if let Some(element) = self.markup.element(group.id()) {
            self.seen.insert(element);
            context.element = Some(element);
        }
        context.to_page *= affine(group.transform());
        if group.opacity().get() == 0.0 {
            self.invisible += 1;
            self.see_all(group);
            return Ok(());
        }
        self.filters += group.filters().len();
        self.masks += usize::from(group.mask().is_some());
        let mut clip = group.clip_path();
        while let Some(path) = clip {
            let to_page = context.to_page * affine(path.transform());
            match only_path(path.root(), to_page) {
                Some((path, to_page)) => match self.area(path, to_page)? {
                    Some(area) => context.areas.push(area),
                    None => self.clips += 1,
                },
                None => self.clips += 1,
            }
            clip = path.clip_path();
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, &context)?,
                Node::Path(path) => self.path(path, &context)?,
                Node::Text(text) => self.text(text, &context)?,
                // They are counted in the markup.
                Node::Image(_) => {}
            }
        }
        Ok(())
    }

    /// Draws the outlines of the letters of a text.
    fn text(&mut self, text: &'tree Text, outside: &Context) -> Result<(), TooManyPoints> {
        let mut context = Context { is_text: true, ..outside.clone() };
        if let Some(element) = self.markup.element(text.id()) {
            self.seen.insert(element);
            context.element = Some(element);
        }
        self.texts.push(text);
        self.group(text.flattened(), &context)
    }

    /// Notes that the contents of a group were found, although they are not drawn.
    fn see_all(&mut self, group: &Group) {
        for node in group.children() {
            self.seen.extend(self.markup.element(node.id()));
            if let Node::Group(group) = node {
                self.see_all(group);
            }
        }
    }

    /// The convex area that is the inside of `path`; `None` if it is not convex.
    fn area(&mut self, path: &Path, to_page: Affine) -> Result<Option<ConvexArea>, TooManyPoints> {
        let outlines = flatten(path.data(), to_page, Arcs::Quarters, &mut self.budget)?;
        let [outline] = outlines.as_slice() else { return Ok(None) };
        Ok(ConvexArea::new(&outline.points))
    }

    fn path(&mut self, path: &Path, context: &Context) -> Result<(), TooManyPoints> {
        let own = self.markup.element(path.id());
        self.seen.extend(own);
        let stroke = path.stroke().filter(|stroke| stroke.opacity().get() > 0.0);
        let fill = path.fill().filter(|fill| fill.opacity().get() > 0.0);
        let paint = match (stroke, fill) {
            _ if !path.is_visible() => None,
            (Some(stroke), _) => Some(stroke.paint()),
            (None, fill) => fill.map(|fill| fill.paint()),
        };
        let Some(paint) = paint else {
            self.invisible += 1;
            return Ok(());
        };
        let element = own.or(context.element);
        let place = context.element.or(own);
        if place.is_some_and(|place| self.markup.is_documentation(place)) {
            self.documentation += 1;
            return Ok(());
        }
        let dashes = stroke.and_then(|stroke| Some((stroke.dasharray()?, stroke.dashoffset())));
        let dashed = match dashes {
            None => None,
            Some((lengths, offset)) => {
                // Lengths along a curve are measured to within a small part of a motor step.
                let scale = context.to_page.determinant().abs().sqrt() * 100.0;
                let dash = StrokeDash::new(lengths.to_vec(), offset);
                let dashed = dash.and_then(|dash| path.data().dash(&dash, scale as f32));
                self.undashed += usize::from(dashed.is_none());
                dashed
            }
        };
        // A path without an id comes from a `use`, where any element may lie behind it.
        let arcs = match context.is_text {
            true => Arcs::None,
            false => self.markup.arcs(own),
        };
        let arcs_drawn = if dashed.is_some() { Arcs::None } else { arcs };
        let data = dashed.as_ref().unwrap_or(path.data());
        let mut polylines = flatten(data, context.to_page, arcs_drawn, &mut self.budget)?;
        if stroke.is_none() {
            // A filled area has a side between the ends of an open path, too.
            polylines.iter_mut().for_each(Polyline::close);
        }
        let outlines = match fill.map(|fill| fill.paint()) {
            Some(paint) if self.with_areas && !is_white(paint) => {
                let whole = flatten(path.data(), context.to_page, arcs, &mut self.budget)?;
                let areas = context.areas.iter().chain([&self.page]);
                let sides: Vec<_> = areas.flat_map(ConvexArea::sides).collect();
                let outline = |polyline: &Polyline| -> Vec<[f64; 2]> {
                    polyline.points.iter().map(|point| [point.x, point.y]).collect()
                };
                let outlines = whole.iter().map(|it| clip_outline(&outline(it), &sides));
                outlines.filter(|outline| outline.len() > 2).collect()
            }
            _ => Vec::new(),
        };
        for area in &context.areas {
            let mut parts = Vec::new();
            for polyline in &polylines {
                area.cut(polyline, CLIP_SLACK, &mut parts);
            }
            polylines = parts;
        }
        let (mut parts, mut is_cut) = (Vec::new(), false);
        for polyline in &polylines {
            is_cut |= self.page.cut(polyline, SLACK, &mut parts);
        }
        self.cut += usize::from(is_cut);
        let colour = match paint {
            Paint::Color(colour) => Some([colour.red, colour.green, colour.blue]),
            _ => None,
        };
        // The layer is that of the group in which the element is used.
        let layer = context.element.or(own).and_then(|element| self.markup.layer(element));
        let marks = Marks { layer, colour };
        if !parts.is_empty() || !outlines.is_empty() {
            self.shapes.push(Shape { element, marks, polylines: parts, outlines });
        }
        Ok(())
    }
}

/// Whether a fill is that of the paper, which is not hatched.
fn is_white(paint: &Paint) -> bool {
    matches!(paint, Paint::Color(colour) if [colour.red, colour.green, colour.blue] == [255; 3])
}

/// The only path in `group`, and its way to the page; `None` if there is none, or there are
/// several.
fn only_path(group: &Group, to_page: Affine) -> Option<(&Path, Affine)> {
    let to_page = to_page * affine(group.transform());
    match group.children() {
        [Node::Path(path)] => Some((path, to_page)),
        [Node::Group(group)] if group.clip_path().is_none() => only_path(group, to_page),
        _ => None,
    }
}

fn affine(transform: Transform) -> Affine {
    let Transform { sx, kx, ky, sy, tx, ty } = transform;
    Affine::new([sx, ky, kx, sy, tx, ty].map(f64::from))
}
