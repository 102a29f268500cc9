//! Finds the areas that clip paths and masks leave of a drawing.
//!
//! A pen draws a line or does not. So a mask leaves what it lets at least half of the light
//! through: the luminance of its colours, or their opacity alone (`mask-type`). Its shapes may hide
//! each other, and strokes count with their width. An image, a pattern, or a gradient that is
//! neither dark nor light all over lets all light through, and the user is told. A mask with a
//! filter, or a group that is see-through, is not applied.

use super::drawing::{Drawing, affine};
use super::flatten::{Arcs, Polyline, TooManyPoints, flatten};
use crate::region::{Region, Regions, Shade};
use kurbo::{Affine, Point, Rect};
use std::sync::Arc;
use usvg::{
    BlendMode, ClipPath, Color, FillRule, Group, Mask, MaskType, Node, Paint, PaintOrder, Path,
    Stop,
};

/// The conversion of the colours of a mask to light.
#[derive(Debug, Clone, Copy)]
struct Light {
    /// Whether the opacity alone counts.
    is_alpha: bool,
    /// Whether colours are mixed as light is, and not as sRGB.
    is_linear: bool,
}

/// A mask while its shapes are laid on each other.
#[derive(Debug)]
struct Layers {
    light: Light,
    region: Region,
    /// Whether something in it hides what is drawn.
    is_soft: bool,
}

/// The reasons why a mask cannot be applied.
enum MaskError {
    TooManyPoints,
    /// The mask has an effect that no region can represent, such as partial transparency or a
    /// filter.
    Soft,
}

impl From<TooManyPoints> for MaskError {
    fn from(_: TooManyPoints) -> Self {
        Self::TooManyPoints
    }
}

impl Drawing<'_, '_, '_> {
    /// Appends the regions to which a clip path, and the clip paths of the clip path itself, limit
    /// the drawing.
    pub(super) fn clip(
        &mut self,
        mut clip: Option<&ClipPath>,
        to_page: Affine,
        areas: &mut Regions,
    ) -> Result<(), TooManyPoints> {
        while let Some(path) = clip {
            let mut region = Region::default();
            let to_path = to_page * affine(path.transform());
            self.region(path.root(), to_path, &Regions::default(), &mut region)?;
            areas.0.push(Arc::new(region));
            clip = path.clip_path();
        }
        Ok(())
    }

    /// Adds the shapes of a group in a clip path to the region that it leaves.
    fn region(
        &mut self,
        group: &Group,
        to_page: Affine,
        within: &Regions,
        region: &mut Region,
    ) -> Result<(), TooManyPoints> {
        let to_page = to_page * affine(group.transform());
        let mut within = within.clone();
        self.clip(group.clip_path(), to_page, &mut within)?;
        for node in group.children() {
            match node {
                Node::Group(group) => self.region(group, to_page, &within, region)?,
                Node::Text(text) => self.region(text.flattened(), to_page, &within, region)?,
                Node::Path(path) if path.is_visible() => {
                    let outlines = flatten(path.data(), to_page, Arcs::Quarters, &mut self.budget)?;
                    let outlines = outlines.iter().map(Polyline::positions).collect();
                    region.add(outlines, is_even_odd(path), within.0.clone());
                }
                Node::Path(_) | Node::Image(_) => {}
            }
        }
        Ok(())
    }

    /// Appends what a mask leaves, and those that mask it. Returns how many are not applied, or not
    /// as a whole.
    ///
    /// # Errors
    /// There are too many points for the memory.
    pub(super) fn mask(
        &mut self,
        mut mask: Option<&Mask>,
        to_page: Affine,
        areas: &mut Regions,
    ) -> Result<usize, TooManyPoints> {
        let mut soft = 0;
        while let Some(this) = mask {
            let element = self.markup.element(this.id());
            let light = Light {
                is_alpha: this.kind() == MaskType::Alpha,
                is_linear: element.is_some_and(|element| self.markup.is_linear(element)),
            };
            let mut layers = Layers { light, region: Region::default(), is_soft: false };
            match self.layers(this.root(), to_page, &Regions::default(), 1.0, &mut layers) {
                Ok(()) => {
                    soft += usize::from(layers.is_soft);
                    let rect = this.rect();
                    let low = [rect.left(), rect.top()].map(f64::from);
                    let high = [rect.right(), rect.bottom()].map(f64::from);
                    let mut bounds = Region::default();
                    bounds.add(vec![rectangle(low, high, to_page)], false, Vec::new());
                    areas.0.extend([Arc::new(layers.region), Arc::new(bounds)]);
                }
                Err(MaskError::Soft) => soft += 1,
                Err(MaskError::TooManyPoints) => return Err(TooManyPoints),
            }
            mask = this.mask();
        }
        Ok(soft)
    }

    /// Adds the shapes of a group in a mask, with this opacity, on top of those below.
    fn layers(
        &mut self,
        group: &Group,
        to_page: Affine,
        within: &Regions,
        opacity: f64,
        layers: &mut Layers,
    ) -> Result<(), MaskError> {
        let own = f64::from(group.opacity().get());
        if own == 0.0 {
            return Ok(());
        }
        // The shapes of a group that is not opaque hide each other before anything shines through.
        if !group.filters().is_empty()
            || group.blend_mode() != BlendMode::Normal
            || own < 1.0 && painted(group) > 1
        {
            return Err(MaskError::Soft);
        }
        let to_page = to_page * affine(group.transform());
        let mut within = within.clone();
        self.clip(group.clip_path(), to_page, &mut within)?;
        layers.is_soft |= self.mask(group.mask(), to_page, &mut within)? > 0;
        let opacity = opacity * own;
        for node in group.children() {
            match node {
                Node::Group(group) => self.layers(group, to_page, &within, opacity, layers)?,
                Node::Text(text) => {
                    self.layers(text.flattened(), to_page, &within, opacity, layers)?;
                }
                Node::Path(path) if path.is_visible() => {
                    self.layer(path, to_page, &within, opacity, layers)?;
                }
                Node::Path(_) => {}
                Node::Image(image) if image.is_visible() => {
                    layers.is_soft = true;
                    let size = [image.size().width(), image.size().height()].map(f64::from);
                    let outline = rectangle([0.0, 0.0], size, to_page);
                    layers.region.add(vec![outline], false, within.0.clone());
                }
                Node::Image(_) => {}
            }
        }
        Ok(())
    }

    /// Lays the fill and the stroke of a path in a mask on those below.
    fn layer(
        &mut self,
        path: &Path,
        to_page: Affine,
        within: &Regions,
        opacity: f64,
        layers: &mut Layers,
    ) -> Result<(), MaskError> {
        let mut fill = None;
        if let Some(paint) = path.fill() {
            let shade = layers.shade(paint.paint(), opacity * f64::from(paint.opacity().get()));
            let outlines = flatten(path.data(), to_page, Arcs::Quarters, &mut self.budget)?;
            fill = Some((outlines, is_even_odd(path), shade));
        }
        let mut stroke = None;
        if let Some(paint) = path.stroke() {
            let shade = layers.shade(paint.paint(), opacity * f64::from(paint.opacity().get()));
            let scale = to_page.determinant().abs().sqrt() * 100.0;
            let mut pen = paint.to_tiny_skia();
            let dash = pen.dash.take();
            let dashed = dash.and_then(|dash| path.data().dash(&dash, scale as f32));
            let line = dashed.as_ref().unwrap_or(path.data());
            if let Some(outline) = line.stroke(&pen, scale as f32) {
                let outlines = flatten(&outline, to_page, Arcs::None, &mut self.budget)?;
                stroke = Some((outlines, false, shade));
            }
        }
        let both = match path.paint_order() {
            PaintOrder::FillAndStroke => [fill, stroke],
            PaintOrder::StrokeAndFill => [stroke, fill],
        };
        for (outlines, is_even_odd, shade) in both.into_iter().flatten() {
            let outlines = outlines.iter().map(Polyline::positions).collect();
            layers.region.add_shade(outlines, is_even_odd, within.0.clone(), shade);
        }
        Ok(())
    }
}

/// How many paints a group has, at most.
fn painted(group: &Group) -> usize {
    let of_node = |node: &Node| match node {
        Node::Group(group) => painted(group),
        Node::Text(text) => painted(text.flattened()),
        Node::Path(path) => {
            usize::from(path.fill().is_some()) + usize::from(path.stroke().is_some())
        }
        Node::Image(_) => 1,
    };
    group.children().iter().map(of_node).sum()
}

impl Layers {
    /// Returns the shade of a paint of this opacity.
    fn shade(&mut self, paint: &Paint, opacity: f64) -> Shade {
        let light = self.light;
        let of_colour = |colour: Color| if light.is_alpha { 1.0 } else { luminance(colour, light) };
        let shade = match paint {
            Paint::Color(colour) => Some(Shade { light: of_colour(*colour), alpha: opacity }),
            Paint::LinearGradient(gradient) => of_stops(gradient.stops(), opacity, of_colour),
            Paint::RadialGradient(gradient) => of_stops(gradient.stops(), opacity, of_colour),
            Paint::Pattern(_) => None,
        };
        self.is_soft |= shade.is_none();
        shade.unwrap_or(Shade::CLEAR)
    }
}

/// What a gradient adds to a mask; `None` if it is not opaque, or neither dark nor light all over.
fn of_stops(stops: &[Stop], opacity: f64, of_colour: impl Fn(Color) -> f64) -> Option<Shade> {
    let is_opaque = opacity == 1.0 && stops.iter().all(|stop| stop.opacity().get() == 1.0);
    let mut lights = stops.iter().map(|stop| of_colour(stop.color()) >= 0.5);
    let first = lights.next()?;
    let is_plain = is_opaque && lights.all(|other| other == first);
    is_plain.then(|| Shade { light: f64::from(u8::from(first)), alpha: 1.0 })
}

/// Whether a paint is transparent all over.
pub(super) fn is_clear(paint: &Paint) -> bool {
    let stops = match paint {
        Paint::LinearGradient(gradient) => gradient.stops(),
        Paint::RadialGradient(gradient) => gradient.stops(),
        _ => return false,
    };
    stops.iter().all(|stop| stop.opacity().get() == 0.0)
}

/// The bounds of a path on the page.
pub(super) fn bounds(path: &Path, to_page: Affine) -> Rect {
    let bounds = path.bounding_box();
    let [left, top, right, bottom] =
        [bounds.left(), bounds.top(), bounds.right(), bounds.bottom()].map(f64::from);
    to_page.transform_rect_bbox(Rect::new(left, top, right, bottom))
}

/// Whether what a path fills is decided by the number of outlines around it.
pub(super) fn is_even_odd(path: &Path) -> bool {
    path.fill().is_some_and(|fill| fill.rule() == FillRule::EvenOdd)
}

/// The corners of a rectangle on the page.
pub(super) fn rectangle(low: [f64; 2], high: [f64; 2], to_page: Affine) -> Vec<[f64; 2]> {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let on_page = corners.map(|[x, y]| to_page * Point::new(x, y));
    on_page.iter().map(|corner| [corner.x, corner.y]).collect()
}

/// Returns the lightness of a colour, from 0 to 1, as SVG defines it for masks.
fn luminance(colour: Color, light: Light) -> f64 {
    let part = |part: u8| {
        let part = f64::from(part) / 255.0;
        match light.is_linear {
            true if part <= 0.04045 => part / 12.92,
            true => ((part + 0.055) / 1.055).powf(2.4),
            false => part,
        }
    };
    0.2126 * part(colour.red) + 0.7152 * part(colour.green) + 0.0722 * part(colour.blue)
}
