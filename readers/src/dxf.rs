//! Reads DXF, as text or binary, as plans: lines, polylines with bulges, arcs, circles, ellipses
//! and splines, points, level faces, dimensions and texts, also in blocks, as they are seen from
//! above, with the dashes of their line types.
//!
//! Each layer has a pen: that of the number in its name, or else the next one. Layers that are off
//! or frozen, those that are not plotted unless the user names them, paper space, and what else is
//! not drawn is counted, and the user is told. The reader refuses a file that does not consist of
//! pairs of a code and a value.
//!
//! The file is longer than 500 lines, because it is the list of the entities of DXF: each is drawn
//! by the same placement on the page and pen.

mod binary;
mod code_page;
mod curves;
mod dashes;
mod document;
mod one_byte;
mod space;
mod text;

use super::arrange::Arrangement;
use super::counted;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::{Plan, Point, number_in};
use crate::lines::Origin;
use crate::region::{Region, Regions};
use curves::{Affine, Curve, Spline};
use dashes::dashed;
use document::{Document, Entity, LineError, document, number, pairs};
use space::Plane;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use text::Writing;

/// The beginning of a binary file.
const BINARY: &[u8] = b"AutoCAD Binary DXF\r\n\x1A\0";

/// The format itself.
#[derive(Debug)]
pub(super) struct Dxf;

/// The most blocks within each other.
const MOST_NESTED: usize = 16;

/// The most points before a file is refused. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

/// The most work of clipping before a file is refused.
const MOST_WORK: usize = 300_000_000;

/// The units of `$INSUNITS` and their lengths in mm.
const UNITS: [(i64, f64); 15] = [
    (1, 25.4),
    (2, 304.8),
    (3, 1_609_344.0),
    (4, 1.0),
    (5, 10.0),
    (6, 1000.0),
    (7, 1_000_000.0),
    (8, 0.000_025_4),
    (9, 0.0254),
    (10, 914.4),
    (12, 0.000_1),
    (13, 0.001),
    (14, 100.0),
    // The foot and the inch of surveyors in the USA.
    (21, 1_200_000.0 / 3937.0),
    (22, 100_000.0 / 3937.0),
];

/// What is said of the entities of the space that is not drawn.
const PAPER: &str = "entities in paper space";
const MODEL: &str = "entities in model space";

/// What is said of the entities on layers of the screen.
const UNPLOTTED: &str = "entities on layers that are not to be plotted (--layer NAME draws one)";

/// What is said, before its path, of another drawing that is inserted.
const EXTERNAL: &str = "INSERT of the external drawing";

/// The strokes of a drawing, and what of it is not drawn.
struct Drawing<'d, 'a> {
    document: &'d Document<'a>,
    /// The layers that the user has named.
    named: &'d [String],
    /// The strokes, of which the pens are chosen once all layers are known.
    plan: Plan,
    /// The numbers of the layers that strokes lie on.
    layers: HashMap<&'a str, u32>,
    /// The number of entities of a kind that are not drawn, and the line of the first.
    skipped: BTreeMap<String, (usize, usize)>,
    points: usize,
    /// Whether paper space is drawn, and not model space.
    is_of_paper: bool,
    /// The length of a unit of the file in mm.
    unit: f64,
    /// The number of lines with too many dashes.
    undashed: usize,
    /// The number of lines whose line type has letters or figures.
    figured: usize,
    /// The number of points whose figure has no size in the file.
    unsized_points: usize,
    /// The number of texts, and of their letters that are not in the plotter's font.
    texts: usize,
    unknown_letters: usize,
    /// The regions to which the blocks around the current entity limit it.
    within: Regions,
    /// The work that is left for clipping, see [`Regions::cut`].
    work: usize,
}

/// The context in which entities are drawn.
#[derive(Debug, Clone, Copy)]
struct Placement<'a> {
    to_page: Affine,
    /// The layer of entities that take it from the block that contains them.
    layer: &'a str,
    /// The line type of entities that take it from the block that contains them.
    line_type: &'a str,
    /// The number of nested blocks that contain the entities.
    depth: usize,
}

impl<'d, 'a> Drawing<'d, 'a> {
    fn skip(&mut self, what: &str, line: usize) {
        self.skipped.entry(what.to_owned()).or_insert((0, line)).0 += 1;
    }

    /// Whether the user has named a layer, in any case of its letters.
    fn is_named(&self, layer: &str) -> bool {
        self.named.iter().any(|name| name.to_lowercase() == layer.to_lowercase())
    }

    fn all(
        &mut self,
        entities: &'d [Entity<'a>],
        placement: Placement<'a>,
    ) -> Result<(), LineError> {
        let mut at = 0;
        while let Some(entity) = entities.get(at) {
            at += 1;
            // The vertices of a polyline of the old form follow it.
            let first = at;
            if entity.kind == "POLYLINE" {
                while entities.get(at).is_some_and(|it| matches!(it.kind, "VERTEX" | "SEQEND")) {
                    at += 1;
                }
            }
            let layer = match entity.layer() {
                "0" => placement.layer,
                own => own,
            };
            let is_hidden_text = entity.kind == "ATTRIB" && entity.flags()? & 1 != 0;
            if self.document.is_hidden(layer) {
                self.skip("entities on layers that are off or frozen", entity.line);
            } else if self.document.is_unplotted(layer) && !self.is_named(layer) {
                self.skip(UNPLOTTED, entity.line);
            } else if (entity.number(67, 0.0)? != 0.0) != self.is_of_paper && placement.depth == 0 {
                self.skip(if self.is_of_paper { MODEL } else { PAPER }, entity.line);
            } else if entity.number(60, 0.0)? != 0.0 || is_hidden_text {
                self.skip("invisible entities", entity.line);
            } else {
                let vertices = entities.get(first..at).unwrap_or_default();
                self.entity(entity, vertices, Placement { layer, ..placement })?;
            }
        }
        Ok(())
    }

    fn entity(
        &mut self,
        entity: &'d Entity<'a>,
        vertices: &[Entity<'a>],
        placement: Placement<'a>,
    ) -> Result<(), LineError> {
        let up = [entity.number(210, 0.0)?, entity.number(220, 0.0)?, entity.number(230, 1.0)?];
        let plane = Plane::of(up);
        // The points of these are those of the world, whatever is up.
        let is_planar = match entity.kind {
            "LINE" | "ELLIPSE" | "SPLINE" | "POINT" | "3DFACE" | "DIMENSION" | "MTEXT"
            | "ACAD_TABLE" => false,
            "POLYLINE" => entity.flags()? & (8 | 16 | 64) == 0,
            _ => true,
        };
        let height = match entity.kind {
            "LWPOLYLINE" => entity.number(38, 0.0)?,
            _ => entity.number(30, 0.0)?,
        };
        let to_page = match is_planar {
            true => placement.to_page.after(plane.seen(height)),
            false => placement.to_page,
        };
        let placement = Placement { to_page, ..placement };
        let curve = match entity.kind {
            "LINE" => Curve::polyline(&[entity.point(10)?, entity.point(11)?]),
            "LWPOLYLINE" => bulged(&light(entity)?, entity.flags()? & 1 == 1),
            "POLYLINE" => {
                let flags = entity.flags()?;
                // Meshes have faces; the control points of a curve that was fitted are not drawn.
                if flags & (16 | 64) != 0 {
                    self.skip("POLYLINE, a mesh", entity.line);
                    return Ok(());
                }
                let mut corners = Vec::new();
                for vertex in vertices.iter().filter(|it| it.kind == "VERTEX") {
                    if vertex.flags()? & 16 == 0 {
                        corners.push((vertex.point(10)?, vertex.number(42, 0.0)?));
                    }
                }
                bulged(&corners, flags & 1 == 1)
            }
            "CIRCLE" => Curve::arc(entity.point(10)?, entity.number(40, 0.0)?, 0.0, 360.0),
            "ARC" => {
                let (start, end) = (entity.number(50, 0.0)?, entity.number(51, 360.0)?);
                let turn = (end - start).rem_euclid(360.0);
                let turn = if turn == 0.0 { 360.0 } else { turn };
                Curve::arc(entity.point(10)?, entity.number(40, 0.0)?, start, turn)
            }
            "ELLIPSE" => {
                let [start, end] =
                    [entity.number(41, 0.0)?, entity.number(42, std::f64::consts::TAU)?];
                let ratio = entity.number(40, 1.0)?;
                let long = entity.point_in_space(11)?;
                let short = plane.turned(long).map(|part| part * ratio);
                let axes = [[long[0], long[1]], [short[0], short[1]]];
                Curve::ellipse(entity.point(10)?, axes, [start, end])
            }
            "SPLINE" => {
                let spline = Spline {
                    degree: entity.number(71, 3.0)? as usize,
                    knots: entity.numbers(40)?,
                    control: entity.points(10)?,
                    weights: entity.numbers(41)?,
                };
                if spline.control.is_empty() {
                    self.skip("SPLINE without control points", entity.line);
                    return Ok(());
                }
                let Some(curve) = Curve::spline(spline) else {
                    self.skip("SPLINE whose knots do not fit it", entity.line);
                    return Ok(());
                };
                curve
            }
            "POINT" => return self.point(entity, placement),
            "3DFACE" | "SOLID" | "TRACE" => match outline(entity)? {
                Some(sides) => {
                    for side in sides {
                        self.draw(entity, placement, &Curve::polyline(&side))?;
                    }
                    return Ok(());
                }
                None => {
                    self.skip(&format!("{}, not level", entity.kind), entity.line);
                    return Ok(());
                }
            },
            "TEXT" | "ATTRIB" => return self.write(entity, placement, text::line(entity)?),
            "MTEXT" => return self.write(entity, placement, text::paragraph(entity, plane)?),
            "INSERT" => return self.insert(entity, placement),
            // A table is shown by a block, turned so that its x has the direction of the table.
            "ACAD_TABLE" if self.block(entity).is_some() => {
                let Some((base, entities)) = self.block(entity) else { return Ok(()) };
                let ([x, y], [right, up]) = (entity.point(10)?, entity.point(11)?);
                let length = right.hypot(up);
                let [cosine, sine] =
                    if length > 0.0 { [right / length, up / length] } else { [1.0, 0.0] };
                let turned = Affine([cosine, sine, -sine, cosine, x, y]);
                let moved = shift([-base[0], -base[1]]);
                let to_page = placement.to_page.after(turned).after(moved);
                return self.nested(entity, entities, Placement { to_page, ..placement });
            }
            // What shows a dimension is a block.
            // A copy of a dimension may share the block, moved by a distance in its own plane.
            "DIMENSION" if self.block(entity).is_some() => {
                let Some((_, entities)) = self.block(entity) else { return Ok(()) };
                let moved = plane.seen(entity.number(32, 0.0)?).apply(entity.point(12)?);
                let to_page = placement.to_page.after(shift(moved));
                return self.nested(entity, entities, Placement { to_page, ..placement });
            }
            "VERTEX" | "SEQEND" => return Ok(()),
            kind => {
                self.skip(kind, entity.line);
                return Ok(());
            }
        };
        self.draw(entity, placement, &curve)
    }

    /// Draws a point with the figure that the file has for all of them: a dot, a cross, or a stroke
    /// upward, within a circle or a square or both. A cross reaches twice as far as these.
    fn point(&mut self, entity: &'d Entity<'a>, placement: Placement<'a>) -> Result<(), LineError> {
        let centre = entity.point(10)?;
        let (mode, size) = (self.document.point_mode, self.document.point_size);
        let (kind, frames) = (mode & 7, mode & (32 | 64));
        if (kind, frames) == (1, 0) {
            self.skip("POINT, which the file shows as nothing ($PDMODE)", entity.line);
            return Ok(());
        }
        let has_figure = frames != 0 || matches!(kind, 2..=4);
        self.unsized_points += usize::from(has_figure && size <= 0.0);
        let has_figure = has_figure && size > 0.0;
        // In sizes of the figure.
        let lines: &[&[Point]] = match kind {
            2 if has_figure => &[&[[-1.0, 0.0], [1.0, 0.0]], &[[0.0, -1.0], [0.0, 1.0]]],
            3 if has_figure => &[&[[-1.0, -1.0], [1.0, 1.0]], &[[-1.0, 1.0], [1.0, -1.0]]],
            4 if has_figure => &[&[[0.0, 0.0], [0.0, 0.5]]],
            1 if has_figure => &[],
            _ => &[&[[0.0, 0.0]]],
        };
        let square: &[Point] = &[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]];
        let square = (has_figure && frames & 64 != 0).then_some(&square);
        for line in lines.iter().chain(square) {
            let at = |[x, y]: &Point| [centre[0] + x * size, centre[1] + y * size];
            let line: Vec<Point> = line.iter().map(at).collect();
            self.draw(entity, placement, &Curve::polyline(&line))?;
        }
        if has_figure && frames & 32 != 0 {
            self.draw(entity, placement, &Curve::arc(centre, size / 2.0, 0.0, 360.0))?;
        }
        Ok(())
    }

    /// Draws a curve of an entity, with its line type.
    fn draw(
        &mut self,
        entity: &'d Entity<'a>,
        placement: Placement<'a>,
        curve: &Curve,
    ) -> Result<(), LineError> {
        let most = MOST_POINTS - self.points;
        let points = curve.flattened(placement.to_page, most).ok_or_else(|| too_many(entity))?;
        let line_type = self.document.line_type(entity, placement.layer, placement.line_type);
        let lengths = self.document.dashes(entity, line_type)?;
        let lengths: Vec<f64> = lengths.into_iter().map(|length| length * self.unit).collect();
        self.figured += usize::from(!lengths.is_empty() && self.document.is_figured(line_type));
        let pieces = match lengths.is_empty() {
            true => vec![points],
            false => match dashed(points.clone(), &lengths) {
                Some(pieces) => pieces,
                None => {
                    self.undashed += 1;
                    vec![points]
                }
            },
        };
        pieces.into_iter().try_for_each(|points| self.ink(entity, placement, points))
    }

    /// Draws the letters of an entity; `None` if they cannot be drawn.
    fn write(
        &mut self,
        entity: &'d Entity<'a>,
        placement: Placement<'a>,
        writing: Option<Writing>,
    ) -> Result<(), LineError> {
        let Some(Writing { strokes, unknown }) = writing else {
            self.skip(entity.kind, entity.line);
            return Ok(());
        };
        self.texts += usize::from(!strokes.is_empty());
        self.unknown_letters += unknown;
        strokes.into_iter().try_for_each(|points| {
            let points = points.into_iter().map(|point| placement.to_page.apply(point));
            self.ink(entity, placement, points.collect())
        })
    }

    /// Draws a polyline on the page.
    fn ink(
        &mut self,
        entity: &'d Entity<'a>,
        placement: Placement<'a>,
        points: Vec<Point>,
    ) -> Result<(), LineError> {
        let pieces = match points.as_slice() {
            _ if self.within.0.is_empty() => vec![points],
            [dot] if self.within.contain(*dot) => vec![points],
            [_] => Vec::new(),
            line => self.within.cut(line, &mut self.work).map_err(|_| too_many(entity))?,
        };
        for points in pieces {
            self.points += points.len();
            if self.points > MOST_POINTS {
                return Err(too_many(entity));
            }
            let next = self.layers.len() as u32;
            let layer = *self.layers.entry(placement.layer).or_insert(next);
            self.plan.begin(entity.line, entity.kind);
            match points.as_slice() {
                [dot] => self.plan.draw_dot(*dot, None, 1, layer),
                _ => self.plan.draw_on(points, None, 1, layer),
            }
        }
        Ok(())
    }

    /// Draws a block at the position where it is inserted, or several times in rows and columns.
    fn insert(
        &mut self,
        entity: &'d Entity<'a>,
        placement: Placement<'a>,
    ) -> Result<(), LineError> {
        let Some((base, entities)) = self.block(entity) else {
            self.skip("INSERT of an unknown block", entity.line);
            return Ok(());
        };
        if let Some(path) = self.document.external(entity.text(2).unwrap_or_default()) {
            let how = "(bind it in the program that wrote the file)";
            self.skip(&format!("{EXTERNAL} {path} {how}"), entity.line);
            return Ok(());
        }
        let [x, y] = entity.point(10)?;
        let scale = [entity.number(41, 1.0)?, entity.number(42, 1.0)?];
        let (sine, cosine) = entity.number(50, 0.0)?.to_radians().sin_cos();
        let counts = [entity.number(70, 1.0)?, entity.number(71, 1.0)?];
        let gaps = [entity.number(44, 0.0)?, entity.number(45, 0.0)?];
        if counts.iter().any(|count| !(0.0..=1000.0).contains(count)) {
            return Err((entity.line, "a block is inserted at most 1000 times a row".to_owned()));
        }
        let turned = Affine([cosine, sine, -sine, cosine, x, y]);
        let scaled =
            Affine([scale[0], 0.0, 0.0, scale[1], -base[0] * scale[0], -base[1] * scale[1]]);
        for row in 0..counts[1].max(1.0) as u32 {
            for column in 0..counts[0].max(1.0) as u32 {
                let moved = [f64::from(column) * gaps[0], f64::from(row) * gaps[1]];
                let to_page = placement.to_page.after(turned).after(shift(moved)).after(scaled);
                let outline = self.document.clip(entity);
                if let Some(outline) = outline {
                    let outline = outline.iter().map(|point| to_page.apply(*point)).collect();
                    let mut region = Region::default();
                    region.add(vec![outline], true, Vec::new());
                    self.within.0.push(Arc::new(region));
                }
                self.nested(entity, entities, Placement { to_page, ..placement })?;
                if outline.is_some() {
                    self.within.0.pop();
                }
            }
        }
        Ok(())
    }

    /// The block that an entity names: its base point and its entities.
    fn block(&self, entity: &Entity<'_>) -> Option<&'d (Point, Vec<Entity<'a>>)> {
        self.document.block(entity.text(2).unwrap_or_default())
    }

    /// Draws the entities of a block.
    fn nested(
        &mut self,
        entity: &Entity<'a>,
        entities: &'d [Entity<'a>],
        placement: Placement<'a>,
    ) -> Result<(), LineError> {
        if placement.depth >= MOST_NESTED {
            return Err((entity.line, "the blocks are nested too deeply".to_owned()));
        }
        self.points += 1;
        if self.points >= MOST_POINTS {
            return Err((entity.line, "the blocks are inserted too often".to_owned()));
        }
        let line_type = self.document.line_type(entity, placement.layer, placement.line_type);
        self.all(entities, Placement { line_type, depth: placement.depth + 1, ..placement })
    }
}

/// The map that moves a drawing so far.
fn shift([x, y]: Point) -> Affine {
    Affine([1.0, 0.0, 0.0, 1.0, x, y])
}

/// What is said of a single one of the things that are not drawn. The paths of other drawings stay
/// as they are.
fn singular(what: &str) -> String {
    match what.starts_with(EXTERNAL) {
        true => what.to_owned(),
        false => what.replacen("entities", "entity", 1),
    }
}

/// Returns the error of a file that becomes too large at this entity.
fn too_many(entity: &Entity<'_>) -> LineError {
    (entity.line, "the file has too many points to be drawn".to_owned())
}

/// The sides of a face that are visible, or the closed outline of a filled triangle or
/// quadrilateral, whose corners stand crosswise; `None` if it is not level.
fn outline(entity: &Entity<'_>) -> Result<Option<Vec<Vec<Point>>>, LineError> {
    let is_face = entity.kind == "3DFACE";
    let order: [i32; 4] = if is_face { [10, 11, 12, 13] } else { [10, 11, 13, 12] };
    let last = if entity.text(13).is_some() { 13 } else { 12 };
    let mut corners = Vec::new();
    for code in order {
        let code = code.min(last);
        let height = entity.number(code + 20, 0.0)?;
        if (height - entity.number(30, 0.0)?).abs() > 1e-9 {
            return Ok(None);
        }
        corners.push(entity.point(code)?);
    }
    let hidden = if is_face { entity.flags()? } else { 0 };
    let mut sides: Vec<Vec<Point>> = Vec::new();
    let ends = corners.iter().cycle().skip(1);
    for (number, (from, to)) in corners.iter().zip(ends).enumerate() {
        if hidden & (1 << number) != 0 || from == to {
            continue;
        }
        match sides.last_mut() {
            Some(side) if side.last() == Some(from) => side.push(*to),
            _ => sides.push(vec![*from, *to]),
        }
    }
    Ok(Some(sides))
}

/// The corners of a polyline of the new form, each with the bulge of the side that follows.
fn light(entity: &Entity<'_>) -> Result<Vec<(Point, f64)>, LineError> {
    let mut corners: Vec<(Point, f64)> = Vec::new();
    for pair in entity.pairs {
        match (pair.code, corners.last_mut()) {
            (10, _) => corners.push(([number(*pair)?, 0.0], 0.0)),
            (20, Some((point, _))) => point[1] = number(*pair)?,
            (42, Some((_, bulge))) => *bulge = number(*pair)?,
            _ => {}
        }
    }
    Ok(corners)
}

/// A polyline whose sides are arcs where they bulge: the bulge is the tangent of a quarter of the
/// angle, above 0 counterclockwise.
fn bulged(corners: &[(Point, f64)], is_closed: bool) -> Curve {
    let mut curve = Curve::polyline(&[]);
    let first = corners.first().copied().filter(|_| is_closed && corners.len() > 1);
    let all: Vec<(Point, f64)> = corners.iter().copied().chain(first).collect();
    for pair in all.windows(2) {
        let ((from, bulge), (to, _)) = (pair[0], pair[1]);
        curve.side(from, to, bulge);
    }
    curve
}

impl Format for Dxf {
    fn name(&self) -> &'static str {
        "DXF"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["dxf"]
    }

    /// The file begins with a section, before which only comments stand.
    fn recognises(&self, beginning: &[u8]) -> bool {
        let text = String::from_utf8_lossy(beginning.get(..4096).unwrap_or(beginning));
        let mut lines = text.lines().map(str::trim);
        loop {
            match (lines.next(), lines.next()) {
                (Some("999"), Some(_)) => {}
                (Some("0"), Some("SECTION")) => return true,
                _ => return false,
            }
        }
    }

    fn may_be_binary(&self, beginning: &[u8]) -> bool {
        beginning.starts_with(BINARY)
    }

    fn read(
        &self,
        file: String,
        bytes: Vec<u8>,
        arrangement: &Arrangement,
    ) -> Result<Contents, ReadError> {
        let refused = |reason: &str| {
            Err(ReadError::Content { file: file.clone(), reason: reason.to_owned() })
        };
        let bytes = match bytes.strip_prefix(BINARY) {
            None => bytes,
            Some(pairs) => match binary::as_text(pairs) {
                Some(text) => text,
                None => return refused("this binary DXF is damaged or not whole: save it again"),
            },
        };
        let (text, note_of_letters) = code_page::decoded(bytes);
        let text = text.trim_start_matches('\u{FEFF}');
        let in_line = |(number, reason): LineError| {
            let line = text.lines().nth(number - 1).unwrap_or_default();
            let shown = line.chars().take(Origin::MOST_SHOWN + 1).collect();
            let origin = Origin { file: file.clone(), line: number, text: shown };
            if line.contains('\0') {
                return ReadError::NotText { origin, kind: "a DXF file" };
            }
            ReadError::Line { origin, reason }
        };
        let pairs = pairs(text).map_err(in_line)?;
        let document = document(&pairs).map_err(in_line)?;
        let unit = match document.unit {
            None | Some(0) => 1.0,
            Some(unit) => match UNITS.iter().find(|(number, _)| *number == unit) {
                Some((_, length)) => *length,
                None => return refused("its unit ($INSUNITS) is none in which plans are drawn"),
            },
        };
        let mut drawing = Drawing {
            document: &document,
            named: &arrangement.layers,
            plan: Plan::new(file.clone()),
            layers: HashMap::new(),
            skipped: BTreeMap::new(),
            points: 0,
            is_of_paper: false,
            unit,
            undashed: 0,
            figured: 0,
            unsized_points: 0,
            texts: 0,
            unknown_letters: 0,
            within: Regions::default(),
            work: MOST_WORK,
        };
        let to_page = Affine([unit, 0.0, 0.0, unit, 0.0, 0.0]);
        let placement = Placement { to_page, layer: "0", line_type: "", depth: 0 };
        drawing.all(&document.entities, placement).map_err(in_line)?;
        if drawing.plan.is_empty() && drawing.skipped.contains_key(PAPER) {
            drawing.is_of_paper = true;
            drawing.skipped.clear();
            drawing.all(&document.entities, placement).map_err(in_line)?;
        }
        let mut layers: Vec<(&str, u32)> = drawing.layers.into_iter().collect();
        layers.sort_by_key(|(_, number)| *number);
        let numbered: Vec<Option<u32>> =
            layers.iter().map(|(layer, _)| number_in(layer).filter(|_| *layer != "0")).collect();
        let taken: HashSet<u32> = numbered.iter().copied().flatten().collect();
        let mut free = (1..).filter(|number| !taken.contains(number));
        let pens: Vec<u32> = (numbered.into_iter())
            .map(|number| number.or_else(|| free.next()).unwrap_or(1))
            .collect();
        let mut plan = drawing.plan;
        for stroke in &mut plan.strokes {
            stroke.pen = pens.get(stroke.layer as usize).copied().unwrap_or(1);
        }
        plan.layers = layers.into_iter().map(|(layer, _)| layer.to_owned()).collect();
        let mut notes: Vec<String> = drawing
            .skipped
            .iter()
            .map(|(what, (count, line))| match count {
                1 => format!("1 {} is not drawn (line {line})", singular(what)),
                _ => format!("{count} {what} are not drawn (the first in line {line})"),
            })
            .collect();
        for (number, nouns, what) in [
            (
                document.unclipped,
                ["inserted block is", "inserted blocks are"],
                "clipped in the file (XCLIP) in a way that is not obeyed: the whole is drawn",
            ),
            (drawing.undashed, ["line has", "lines have"], "too many dashes: drawn as a full line"),
            (
                drawing.figured,
                ["line has", "lines have"],
                "letters or figures in the line type, which are not drawn: there are gaps",
            ),
            (
                drawing.unsized_points,
                ["point is", "points are"],
                "drawn as a dot: the size of its figure depends on the screen ($PDSIZE)",
            ),
            (
                drawing.texts,
                ["text is", "texts are"],
                "drawn in the plotter's own letters, not in the font of the file",
            ),
            (
                drawing.unknown_letters,
                ["letter is", "letters are"],
                "not in the plotter's font: drawn as a box",
            ),
        ] {
            if number > 0 {
                notes.push(format!("{} {what}", counted(number, nouns)));
            }
        }
        notes.extend(note_of_letters);
        if drawing.is_of_paper {
            notes.push("paper space is drawn, because there is nothing in model space".to_owned());
        }
        let end = pairs.last().filter(|last| (last.code, last.value()) == (0, "EOF"));
        if let Some(end) = end.map(|end| end.line()) {
            let is_blank = |letter: char| letter.is_whitespace() || letter.is_control();
            if text.lines().skip(end).any(|line| !line.chars().all(is_blank)) {
                notes.push(format!(
                    "what stands behind the end of the file (EOF in line {end}) is not drawn: if \
                     files were joined, draw each by itself"
                ));
            }
        } else {
            notes.push(
                "the file has no mark of its end (EOF): if it was cut off, a part is missing, so \
                 copy or save it again"
                    .to_owned(),
            );
        }
        if document.unit.unwrap_or(0) == 0 {
            notes.push("the file does not say its unit: it is taken as mm".to_owned());
        }
        if plan.is_empty() {
            let entities = counted(document.entities.len(), ["entity", "entities"]);
            notes.insert(0, format!("there is nothing to draw in this DXF with {entities}"));
            return refused(&notes.join("; "));
        }
        Ok(plan.contents(None, notes))
    }
}

#[cfg(test)]
mod tests;
