//! Collects what the tree of `usvg` draws, as polylines on the page.

use super::areas::{bounds, is_clear, is_even_odd, rectangle};
use super::clip::ConvexArea;
use super::flatten::{Arcs, Polyline, TooManyPoints, flatten, is_coarse, path_length};
use super::markup::Markup;
use super::pens::Marks;
use crate::arrange::clip_outline;
use crate::region::{Region, Regions, length};
use kurbo::{Affine, Point, Rect};
use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::Arc;
use usvg::roxmltree::NodeId;
use usvg::tiny_skia_path::StrokeDash;
use usvg::{Group, Image, ImageKind, LineCap, Node, Paint, Path, Text, Transform, Tree};

/// The length of a pixel of CSS in mm: there are 96 in an inch.
pub(super) const PIXEL: f64 = 25.4 / 96.0;

/// How far outside of the page a line may lie without being cut, in mm. Single precision, in which
/// `usvg` computes, is no better on a large page.
const TOLERANCE: f64 = 0.01;

/// The most points before points are left out. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

/// The most work at clip paths and masks: a minute of an old computer.
const MOST_WORK: usize = 300_000_000;

/// The most filled shapes among which is sought what lies below white ones.
const MOST_COLOURED: usize = 20_000;

/// The width in mm of a filled shape from which on it has an area.
const LEAST_WIDTH: f64 = 0.001;

/// A path of the drawing.
#[derive(Debug)]
pub(super) struct Shape {
    /// The number of elements if nothing of them is seen on white paper, and else 0.
    unseen: usize,
    /// The element that the path comes from, if that is known.
    pub(super) element: Option<NodeId>,
    /// The properties that may choose the pen of the path.
    pub(super) marks: Marks,
    /// The lines to draw, in mm, with y upward from the lower left corner of the page.
    pub(super) polylines: Vec<Polyline>,
    /// Whether a line without a length is a dot, because its ends are round or square.
    pub(super) has_dots: bool,
    /// The outlines of what is filled within the page, in the same way; empty if nothing is, or if
    /// nobody asks.
    pub(super) outlines: Vec<Vec<[f64; 2]>>,
    /// Whether an odd number of these outlines surround what is filled.
    pub(super) is_even_odd: bool,
    /// The clip paths, which cut off what fills these outlines.
    pub(super) within: Regions,
}

/// All paths of an SVG, and what could not be drawn as the file says.
#[derive(Debug)]
pub(super) struct Drawing<'a, 'input, 'tree> {
    pub(super) markup: &'a Markup<'a, 'input>,
    page: ConvexArea,
    with_areas: bool,
    /// The number of further points that fit in memory.
    pub(super) budget: usize,
    /// The amount of work at clip paths and masks that is left.
    work: usize,
    /// The paths in the order of the file.
    pub(super) shapes: Vec<Shape>,
    /// The elements that were found in the tree.
    pub(super) seen: HashSet<NodeId>,
    /// The number of paths that have neither stroke nor fill, or are transparent.
    pub(super) invisible: usize,
    /// The number of paths that ask for a stroke and have none, nor a fill.
    pub(super) strokeless: usize,
    /// The number of paths in layers that are not plotted.
    pub(super) documentation: usize,
    /// The number of paths that reach beyond the page and are cut there.
    pub(super) cut: usize,
    /// The number of paths so far from 0 that single precision moves their points.
    pub(super) coarse: usize,
    /// The number of filled shapes whose outline is that of the page.
    pub(super) backgrounds: usize,
    /// The number of paths that are only filled and have no area.
    pub(super) flat: usize,
    /// The number of shapes that are only filled, with white, where nothing else is filled.
    pub(super) white: usize,
    /// The number of white shapes that do not hide the hatching of what lies below them.
    pub(super) covering: usize,
    /// The bounds of what is filled with another colour than white.
    coloured: Vec<Rect>,
    /// The number of paths with a pattern, which is not drawn.
    pub(super) patterns: usize,
    /// The number of images that are not drawn, in an SVG that is an image.
    pub(super) nested_images: usize,
    /// The number of masks that are not applied, or not as a whole.
    pub(super) masks: usize,
    /// The number of filters that are not applied.
    pub(super) filters: usize,
    /// The number of strokes with so many dashes that they are drawn as full lines.
    pub(super) undashed: usize,
    /// The texts that are drawn.
    pub(super) texts: Vec<&'tree Text>,
}

/// The properties that apply to the contents of a group.
#[derive(Debug, Clone)]
struct Context {
    to_page: Affine,
    areas: Regions,
    /// The innermost group or text that is an element of the file.
    element: Option<NodeId>,
    /// Whether the contents are the outlines of letters.
    is_text: bool,
    /// Whether the contents belong to an SVG that is an image in the file.
    is_nested: bool,
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
            work: MOST_WORK,
            shapes: Vec::new(),
            seen: HashSet::new(),
            invisible: 0,
            strokeless: 0,
            documentation: 0,
            cut: 0,
            coarse: 0,
            backgrounds: 0,
            flat: 0,
            white: 0,
            covering: 0,
            coloured: Vec::new(),
            patterns: 0,
            nested_images: 0,
            masks: 0,
            filters: 0,
            undashed: 0,
            texts: Vec::new(),
        };
        let to_page = Affine::new([PIXEL, 0.0, 0.0, -PIXEL, 0.0, height]);
        let context = Context {
            to_page,
            areas: Regions::default(),
            element: None,
            is_text: false,
            is_nested: false,
        };
        drawing.group(tree.root(), &context)?;
        drawing.leave_white_out();
        Ok(drawing)
    }

    /// Leaves out what is white on white paper, unless all is white, as on a dark ground.
    fn leave_white_out(&mut self) {
        let is_other = |shape: &Shape| shape.unseen == 0 && shape.marks.colour != Some([255; 3]);
        if self.shapes.iter().any(is_other) {
            self.white = self.shapes.iter().map(|shape| shape.unseen).sum();
            self.shapes.retain(|shape| shape.unseen == 0);
        }
    }

    fn group(&mut self, group: &'tree Group, outside: &Context) -> Result<(), TooManyPoints> {
        let mut context = outside.clone();
        if let Some(element) = self.element(group.id(), outside) {
            // An image is not seen before it turns out to be one that is drawn.
            if !self.markup.is_image(element) {
                self.seen.insert(element);
            }
            context.element = Some(element);
        }
        context.to_page *= affine(group.transform());
        if group.opacity().get() == 0.0 {
            self.invisible += 1;
            if !outside.is_nested {
                self.see_all(group);
            }
            return Ok(());
        }
        self.filters += group.filters().len();
        let to_page = context.to_page;
        self.clip(group.clip_path(), to_page, &mut context.areas)?;
        self.masks += self.mask(group.mask(), to_page, &mut context.areas)?;
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, &context)?,
                Node::Path(path) => self.path(path, &context)?,
                Node::Text(text) => self.text(text, &context)?,
                Node::Image(image) => self.image(image, &context)?,
            }
        }
        Ok(())
    }

    /// Draws an SVG that stands as an image in another one, whose page cuts it. The markup counts
    /// other images of the file.
    fn image(&mut self, image: &'tree Image, outside: &Context) -> Result<(), TooManyPoints> {
        if !image.is_visible() {
            self.invisible += 1;
            return Ok(());
        }
        let ImageKind::SVG(tree) = image.kind() else {
            self.nested_images += usize::from(outside.is_nested);
            return Ok(());
        };
        self.seen.extend(outside.element.filter(|_| !outside.is_nested));
        let mut context = Context { is_nested: true, ..outside.clone() };
        let size = tree.size();
        let size = [size.width(), size.height()].map(f64::from);
        let mut page = Region::default();
        page.add(vec![rectangle([0.0, 0.0], size, context.to_page)], false, Vec::new());
        context.areas.0.push(Arc::new(page));
        self.group(tree.root(), &context)
    }

    /// The element of the file with this `id`. Those of an SVG within it are not of the file.
    fn element(&self, id: &str, context: &Context) -> Option<NodeId> {
        if context.is_nested { None } else { self.markup.element(id) }
    }

    /// Draws the outlines of the letters of a text.
    fn text(&mut self, text: &'tree Text, outside: &Context) -> Result<(), TooManyPoints> {
        let mut context = Context { is_text: true, ..outside.clone() };
        if let Some(element) = self.element(text.id(), outside) {
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

    fn path(&mut self, path: &Path, context: &Context) -> Result<(), TooManyPoints> {
        let own = self.element(path.id(), context);
        self.seen.extend(own);
        let count = self.markup.count(own);
        let stroke = path.stroke().filter(|it| it.opacity().get() > 0.0 && !is_clear(it.paint()));
        let fill = path.fill().filter(|it| it.opacity().get() > 0.0 && !is_clear(it.paint()));
        let paint = match (stroke, fill) {
            _ if !path.is_visible() => None,
            (Some(stroke), _) => Some(stroke.paint()),
            (None, fill) => fill.map(|fill| fill.paint()),
        };
        let Some(paint) = paint else {
            self.invisible += count;
            let element = own.or(context.element).filter(|it| !self.markup.is_hidden(*it));
            let is_asked = |element| self.markup.asks_for_stroke(element);
            self.strokeless +=
                count * usize::from(path.stroke().is_none() && element.is_some_and(is_asked));
            return Ok(());
        };
        let element = own.or(context.element);
        let place = context.element.or(own);
        if place.is_some_and(|place| self.markup.is_documentation(place)) {
            self.documentation += count;
            return Ok(());
        }
        let is_white_fill = fill.is_some_and(|fill| is_white(fill.paint()));
        let is_unseen = fill.is_some() && self.is_white_on_paper(path, paint, context.to_page);
        let is_sought = self.coloured.len() <= MOST_COLOURED;
        if self.with_areas
            && is_white_fill
            && !is_unseen
            && is_sought
            && self.covers(path, context.to_page)
        {
            self.covering += count;
        }
        let dashes = stroke.and_then(|stroke| Some((stroke.dasharray()?, stroke.dashoffset())));
        // Dashes of a fixed length are measured on the page, and others in the file.
        let is_fixed = dashes.is_some()
            && element.is_some_and(|element| self.markup.has_fixed_stroke(element));
        let on_page = || path.data().clone().transform(single(context.to_page));
        let (path_data, to_page, unit) = match dashes.filter(|_| is_fixed).and_then(|_| on_page()) {
            Some(data) => (Cow::Owned(data), Affine::IDENTITY, PIXEL as f32),
            None => (Cow::Borrowed(path.data()), context.to_page, 1.0),
        };
        let dashed = match dashes {
            None => None,
            Some((lengths, offset)) => {
                // Lengths along a curve are measured to within a small part of a motor step.
                let scale = to_page.determinant().abs().sqrt() * 100.0;
                // A file may say the length of a path, in which its dashes are measured then.
                let said = own.and_then(|own| self.markup.path_length(own));
                let unit = said.map_or(unit, |said| (path_length(&path_data, scale) / said) as f32);
                let lengths = lengths.iter().map(|length| length * unit).collect();
                let dash = StrokeDash::new(lengths, offset * unit);
                let dashed = dash.and_then(|dash| path_data.dash(&dash, scale as f32));
                let is_endless = unit.is_infinite();
                self.undashed += count * usize::from(dashed.is_none() && !is_endless);
                dashed
            }
        };
        // A path without an id comes from a `use`, where any element may lie behind it.
        let arcs = match context.is_text {
            true => Arcs::None,
            false => self.markup.arcs(own),
        };
        let arcs_drawn = if dashed.is_some() { Arcs::None } else { arcs };
        let data = dashed.as_ref().unwrap_or(&path_data);
        let mut polylines = flatten(data, to_page, arcs_drawn, &mut self.budget)?;
        if stroke.is_none() {
            // A filled area has a side between the ends of an open path, too.
            polylines.iter_mut().for_each(Polyline::close);
            polylines.retain(|it| has_area(&it.points));
            if polylines.is_empty() {
                self.flat += count;
                return Ok(());
            }
        }
        let outlines = match fill.map(|fill| fill.paint()) {
            Some(paint) if self.with_areas && !is_white(paint) => {
                let whole = flatten(path.data(), context.to_page, arcs, &mut self.budget)?;
                let sides = self.page.sides();
                let outlines = whole.iter().map(|it| clip_outline(&it.positions(), &sides));
                outlines.filter(|outline| outline.len() > 2).collect()
            }
            _ => Vec::new(),
        };
        let (whole, areas) = (polylines, &context.areas);
        let polylines = match areas.0.is_empty() {
            true => whole.clone(),
            false => self.clipped(&whole, path, stroke.is_none(), areas)?,
        };
        let (mut parts, mut cut) = (Vec::new(), 0);
        for polyline in &polylines {
            let mut own = Vec::new();
            if self.page.cut(polyline, TOLERANCE, &mut own) {
                cut += 1;
                own.retain(|part| length(&part.positions()) > 2.0 * TOLERANCE);
            }
            parts.extend(own);
        }
        if stroke.is_none() && self.is_background(&whole, areas, &parts) {
            self.backgrounds += 1;
            parts.clear();
        } else {
            // Each line of a run was an element.
            self.cut += count.min(cut);
        }
        self.patterns += usize::from(
            [stroke.map(|it| it.paint()), fill.map(|it| it.paint())]
                .iter()
                .any(|paint| matches!(paint, Some(Paint::Pattern(_)))),
        );
        let colour = match paint {
            Paint::Color(colour) => Some([colour.red, colour.green, colour.blue]),
            _ => None,
        };
        // The layer is that of the group in which the element is used.
        let layer = context.element.or(own).and_then(|element| self.markup.layer(element));
        let marks = Marks { layer, colour };
        if !parts.is_empty() || !outlines.is_empty() {
            self.coarse += count * usize::from(is_coarse(path, context.to_page));
            let within = context.areas.clone();
            let has_dots = stroke.is_some_and(|stroke| stroke.linecap() != LineCap::Butt);
            let unseen = if is_unseen { count } else { 0 };
            self.shapes.push(Shape {
                unseen,
                element,
                marks,
                polylines: parts,
                has_dots,
                outlines,
                is_even_odd: is_even_odd(path),
                within,
            });
        }
        Ok(())
    }

    /// Notes what a path fills, and returns whether nothing of it would be seen: it is filled with
    /// white alone, and no other colour below it. The bounds decide, so a shape is drawn where it
    /// may be seen, and all are drawn if there are too many to look at.
    fn is_white_on_paper(&mut self, path: &Path, paint: &Paint, to_page: Affine) -> bool {
        let bounds = bounds(path, to_page);
        if path.fill().is_some_and(|fill| !is_white(fill.paint())) {
            self.coloured.push(bounds);
        }
        is_white(paint)
            && path.stroke().is_none_or(|stroke| stroke.opacity().get() == 0.0)
            && self.coloured.len() <= MOST_COLOURED
            && !self.covers(path, to_page)
    }

    /// Whether a path lies on what another colour than white fills, by their bounds.
    fn covers(&self, path: &Path, to_page: Affine) -> bool {
        let bounds = bounds(path, to_page);
        self.coloured.iter().any(|it| it.overlaps(bounds))
    }

    /// Returns what clip paths leave of the lines of a path. If the path is only filled, the
    /// borders of the clip paths within it are a part of its outline.
    fn clipped(
        &mut self,
        polylines: &[Polyline],
        path: &Path,
        is_only_filled: bool,
        areas: &Regions,
    ) -> Result<Vec<Polyline>, TooManyPoints> {
        let mut parts = Vec::new();
        for polyline in polylines {
            let points = polyline.positions();
            match points.first().filter(|_| length(&points) == 0.0) {
                Some(dot) => parts.extend(areas.contain(*dot).then_some(points)),
                None => parts.extend(areas.cut(&points, &mut self.work)?),
            }
        }
        if is_only_filled {
            let mut shape = Region::default();
            let outlines = polylines.iter().map(Polyline::positions).collect();
            shape.add(outlines, is_even_odd(path), Vec::new());
            let page = &self.page;
            let is_beyond = |[x, y]: [f64; 2]| page.depth(Point::new(x, y)) < TOLERANCE;
            parts.extend(areas.borders_within(&Arc::new(shape), is_beyond, &mut self.work)?);
        }
        let of_points = |points: Vec<[f64; 2]>| {
            let points = points.into_iter().map(|[x, y]| Point::new(x, y)).collect();
            Polyline { points }
        };
        Ok(parts.into_iter().map(of_points).collect())
    }

    /// Whether the page lies within these outlines, as it does in those of a background, and what
    /// is left of them is on its border at most.
    fn is_background(&self, outlines: &[Polyline], areas: &Regions, parts: &[Polyline]) -> bool {
        let is_on_border = |part: &Polyline| {
            let mut lines = part.points.iter().zip(part.points.iter().skip(1));
            lines.all(|(from, to)| {
                [*from, from.midpoint(*to), *to].iter().all(|it| self.page.depth(*it) <= TOLERANCE)
            })
        };
        if !parts.iter().all(is_on_border) {
            return false;
        }
        let mut shape = Region::default();
        shape.add(outlines.iter().map(Polyline::positions).collect(), false, Vec::new());
        let middle = self.page.middle();
        shape.contains(middle) && areas.contain(middle)
    }
}

/// Whether these points do not all lie on one straight line.
fn has_area(points: &[Point]) -> bool {
    let Some(&first) = points.first() else { return false };
    let farthest = |one: &&Point, other: &&Point| {
        (**one - first).hypot2().total_cmp(&(**other - first).hypot2())
    };
    let Some(&end) = points.iter().max_by(farthest) else { return false };
    let along = end - first;
    let length = along.hypot();
    points.iter().any(|it| along.cross(*it - first).abs() > LEAST_WIDTH * length)
}

/// Whether a fill is that of the paper, which is not hatched.
fn is_white(paint: &Paint) -> bool {
    matches!(paint, Paint::Color(colour) if [colour.red, colour.green, colour.blue] == [255; 3])
}

pub(super) fn affine(transform: Transform) -> Affine {
    let Transform { sx, kx, ky, sy, tx, ty } = transform;
    Affine::new([sx, ky, kx, sy, tx, ty].map(f64::from))
}

/// A transform in the numbers of `usvg`.
fn single(transform: Affine) -> Transform {
    let [sx, ky, kx, sy, tx, ty] = transform.as_coeffs().map(|number| number as f32);
    Transform { sx, kx, ky, sy, tx, ty }
}
