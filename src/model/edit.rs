//! Edits a model, after Cárdenas & Seeley: sequential arrays of joints and bars, and here of faces
//! and curves too.
//!
//! [`Model::edit`] makes one [`Edit`]. A deletion either closes the gap by compaction, so that all
//! higher numbers decrease, or plugs it with the last element, so that only the number of that one
//! changes. Elements that use a deleted vertex are deleted too. An edit is refused, and the model
//! is unchanged, if numbers do not exist, if a plane is defined by collinear vertices, or if
//! coordinates or a copy do not fit.

use super::pens::{PenRun, RUN, close_gap, open_gap};
use super::{Before, Corner, Model, ModelError, POSITION_LIMIT, Position};
use crate::fixed::{Decimal, divide_rounding, product, rest_of_periods, sin_cos_degrees};
use crate::stage::{OutOfScratch, Scratch};
use core::ops::Range;

/// The kinds of elements of a model, each with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ElementKind {
    /// The vertices (joints).
    Vertices,
    /// The bars.
    Bars,
    /// The faces.
    Faces,
    /// The curves.
    Curves,
}

/// The first and the last number of a range, from 1, or from -1 backwards; `None` for all elements.
pub type Numbers = Option<[i32; 2]>;

/// A change of a model. Numbers are as in OBJ: from 1, or from -1 backwards for the last ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edit {
    /// Deletes a range of elements; the higher numbers decrease.
    Delete(ElementKind, [i32; 2]),
    /// Deletes one element; the last one gets its number.
    Plug(ElementKind, i32),
    /// Moves a vertex to a position.
    Move(i32, [Decimal; 3]),
    /// Adds a vector to the vertices.
    Translate([Decimal; 3], Numbers),
    /// Multiplies each coordinate by its factor.
    Scale([Decimal; 3], Numbers),
    /// Rotates about an axis (0 to 2) through the origin by an angle in degrees, counter-clockwise
    /// as seen from the positive end of the axis.
    Rotate(u8, f64, Numbers),
    /// Adds the mirror image about the plane of three vertices. Vertices on the plane belong to
    /// both halves.
    Mirror([i32; 3], Numbers),
    /// Replaces vertices by their mirror image about the plane of three vertices.
    Reflect([i32; 3], Numbers),
}

/// How many elements of each kind an edit added, or removed if negative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Change {
    /// The change of the number of vertices (joints).
    pub vertices: i32,
    /// The change of the number of bars.
    pub bars: i32,
    /// The change of the number of faces.
    pub faces: i32,
    /// The change of the number of curves.
    pub curves: i32,
}

/// The number of fraction bits of a matrix entry.
const UNIT_BITS: u32 = 30;

/// The limit of the absolute value of a scale factor, in units of 2^-[`UNIT_BITS`].
const SCALE_LIMIT: i64 = 1 << (20 + UNIT_BITS);

/// The number of bits of a normal's component. With it, a product with a difference of positions
/// fits 64 bits.
const NORMAL_BITS: u32 = 28;

/// A vertex that differs from its image by at most this many units in each coordinate counts as on
/// the plane, because of rounding.
const ON_PLANE: u64 = 16;

/// A map of positions to positions.
enum Map {
    /// The rows of a matrix in units of 2^-[`UNIT_BITS`], and the vector that is added.
    Affine([[i64; 3]; 3], [i64; 3]),
    /// The reflection about the plane through a position with this normal, each component within
    /// ±2^[`NORMAL_BITS`].
    Reflection(Position, [i64; 3]),
}

impl Map {
    const NO_SHIFT: [i64; 3] = [0; 3];

    fn diagonal(entries: [i64; 3]) -> [[i64; 3]; 3] {
        [0, 1, 2].map(|row| [0, 1, 2].map(|column| if row == column { entries[row] } else { 0 }))
    }

    /// Makes the rotation about an axis, counter-clockwise as seen from its positive end.
    fn rotation(axis: u8, degrees: f64) -> Self {
        let entry = |value: f64| libm::round(libm::ldexp(value, UNIT_BITS as i32)) as i64;
        let (sine, cosine) = sin_cos_degrees(degrees);
        let (sine, cosine) = (entry(sine), entry(cosine));
        let axis = usize::from(axis % 3);
        let (from, to) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut rows = Self::diagonal([1 << UNIT_BITS; 3]);
        (rows[from][from], rows[from][to]) = (cosine, -sine);
        (rows[to][from], rows[to][to]) = (sine, cosine);
        Self::Affine(rows, Self::NO_SHIFT)
    }

    /// Returns the image of a position, rounded and limited to ±2^62.
    // Not inlined, so that its 128-bit arithmetic is in the program only once.
    #[inline(never)]
    fn apply(&self, position: Position) -> [i64; 3] {
        let p = position.coordinates().map(i64::from);
        match self {
            Self::Affine(rows, shift) => [0, 1, 2].map(|row: usize| {
                let products = rows[row].iter().zip(p).map(|(m, p)| product(*m, p));
                let half = 1 << (UNIT_BITS - 1);
                within((products.sum::<i128>() + half) >> UNIT_BITS).saturating_add(shift[row])
            }),
            Self::Reflection(on_plane, n) => {
                let q = on_plane.coordinates().map(i64::from);
                // The sum is below 3 2^31 2^28.
                let height: i64 = (0..3).map(|k| (p[k] - q[k]) * n[k]).sum();
                let square: i64 = n.iter().map(|c| c * c).sum();
                [0, 1, 2].map(|k: usize| {
                    let product = 2 * product(height, n[k]);
                    p[k] - within(divide_rounding(product, square.into()))
                })
            }
        }
    }
}

fn within(value: i128) -> i64 {
    const LIMIT: i128 = 1 << 62;
    value.clamp(-LIMIT, LIMIT) as i64
}

impl Model<'_> {
    /// Makes one change. `scratch` must have 2 bytes for each vertex that is mirrored. `keep` is
    /// called with the model just before it changes.
    ///
    /// # Errors
    /// See [`ModelError`]; the model is unchanged.
    pub fn edit(
        &mut self,
        edit: Edit,
        scratch: Scratch<'_>,
        keep: Before<'_>,
    ) -> Result<Change, ModelError> {
        if self.curves.is_in_hand() {
            return Err(ModelError::CurveUnfinished);
        }
        let counts = self.counts();
        match edit {
            Edit::Delete(part, numbers) => {
                let range = self.range(part, Some(numbers))?;
                keep(self);
                self.delete(part, range, false);
            }
            Edit::Plug(part, number) => {
                let range = self.range(part, Some([number; 2]))?;
                if self.runs > 0 && matches!(part, ElementKind::Bars | ElementKind::Faces) {
                    // The pen may change before and after the element that is moved.
                    self.check_corners(2 * RUN)?;
                }
                keep(self);
                self.delete(part, range, true);
            }
            Edit::Move(number, place) => {
                let range = self.range(ElementKind::Vertices, Some([number; 2]))?;
                let place = self.place(place, keep)?;
                for vertex in self.vertices.get_mut(range).unwrap_or(&mut []) {
                    *vertex = place;
                }
            }
            Edit::Translate(by, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                let mut shift = Map::NO_SHIFT;
                for (shift, by) in shift.iter_mut().zip(by) {
                    *shift = by
                        .to_binary_truncated(self.fraction_bits)
                        .map_err(|_| ModelError::CoordinateTooLarge)?;
                }
                let map = Map::Affine(Map::diagonal([1 << UNIT_BITS; 3]), shift);
                self.transform(&map, range.clone(), keep)?;
                let is_whole = by.iter().all(|by| by.decimals() == 0);
                self.scale_errors(1 << UNIT_BITS, is_whole, &range);
            }
            Edit::Scale(by, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                let mut factors = [0; 3];
                for (factor, by) in factors.iter_mut().zip(by) {
                    let value = by.to_binary(UNIT_BITS).ok();
                    *factor = value
                        .filter(|factor| factor.abs() <= SCALE_LIMIT)
                        .ok_or(ModelError::CoordinateTooLarge)?;
                }
                let map = Map::Affine(Map::diagonal(factors), Map::NO_SHIFT);
                self.transform(&map, range.clone(), keep)?;
                let most = factors.iter().map(|factor| factor.unsigned_abs()).max().unwrap_or(0);
                let is_whole = factors.iter().all(|factor| factor % (1 << UNIT_BITS) == 0);
                self.scale_errors(most, is_whole, &range);
            }
            Edit::Rotate(axis, degrees, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.transform(&Map::rotation(axis, degrees), range.clone(), keep)?;
                if rest_of_periods(degrees, 90.0) != 0.0 {
                    self.turn_errors(&range);
                }
            }
            Edit::Reflect(plane, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.transform(&self.reflection(plane)?, range.clone(), keep)?;
                self.turn_faces(&range);
                self.turn_errors(&range);
            }
            Edit::Mirror(plane, numbers) => {
                let range = self.range(ElementKind::Vertices, numbers)?;
                self.mirror(&self.reflection(plane)?, range, scratch, keep)?;
                self.turn_errors(&(0..0));
            }
        }
        let after = self.counts();
        let [vertices, bars, faces, curves] =
            [0, 1, 2, 3].map(|part: usize| after[part] as i32 - counts[part] as i32);
        Ok(Change { vertices, bars, faces, curves })
    }

    /// Updates the error bound after the vertices in `range` were multiplied by a factor in units
    /// of 2^-30.
    fn scale_errors(&mut self, by: u64, is_whole: bool, range: &Range<usize>) {
        let all = range.len() == self.vertices.len();
        self.rounding.scale(self.fraction_bits, by, is_whole, all);
    }

    /// Updates the error bound after the vertices in `range` were rotated or reflected.
    fn turn_errors(&mut self, range: &Range<usize>) {
        let all = range.len() == self.vertices.len();
        self.rounding.turn(self.fraction_bits, all);
    }

    fn counts(&self) -> [usize; 4] {
        [ElementKind::Vertices, ElementKind::Bars, ElementKind::Faces, ElementKind::Curves]
            .map(|part| self.count(part))
    }

    /// Returns the number of elements of a kind.
    pub fn count(&self, part: ElementKind) -> usize {
        match part {
            ElementKind::Vertices => self.vertices.len(),
            ElementKind::Bars => self.bars,
            ElementKind::Faces => self.faces,
            ElementKind::Curves => self.curves.count,
        }
    }

    /// Returns the indices of the elements with these numbers. The range is empty only if `numbers`
    /// is `None` and there are no elements.
    ///
    /// # Errors
    /// [`ModelError::UnknownVertex`], [`ModelError::UnknownElement`].
    pub fn range(&self, part: ElementKind, numbers: Numbers) -> Result<Range<usize>, ModelError> {
        let count = self.count(part);
        let Some(numbers) = numbers else { return Ok(0..count) };
        let mut ends = [0; 2];
        for (end, number) in ends.iter_mut().zip(numbers) {
            *end = super::resolve(number, count).map(usize::from).ok_or(match part {
                ElementKind::Vertices => ModelError::UnknownVertex { number, vertices: count },
                _ => ModelError::UnknownElement { part, number, count },
            })?;
        }
        let [first, last] = ends;
        Ok(first.min(last)..first.max(last) + 1)
    }

    /// Deletes the elements of a kind in `range`. If `plug`, the last element replaces the deleted
    /// one.
    fn delete(&mut self, part: ElementKind, range: Range<usize>, plug: bool) {
        match part {
            ElementKind::Vertices => {
                let gone = range.len();
                if plug {
                    self.vertices.swap_remove(range.start);
                } else {
                    let count = self.vertices.len();
                    self.vertices.copy_within(range.end..count, range.start);
                    self.vertices.truncate(count - gone);
                }
                let last = self.vertices.len();
                self.renumber(&|number| {
                    let at = usize::from(number);
                    if range.contains(&at) {
                        None
                    } else if plug && at == last {
                        Some(range.start as u16) // below VERTEX_NUMBER_LIMIT
                    } else if plug || at < range.start {
                        Some(number)
                    } else {
                        Some(number - gone as u16)
                    }
                });
            }
            ElementKind::Curves => self.curves.delete(self.corners, range, plug),
            ElementKind::Bars | ElementKind::Faces => {
                self.delete_elements(part == ElementKind::Bars, range, plug)
            }
        }
    }

    /// Deletes the bars, or faces, whose positions among their kind are in `range`.
    fn delete_elements(&mut self, bars: bool, range: Range<usize>, plug: bool) {
        if plug {
            // Move the last element to just before the one that is deleted.
            let end = self.elements_end();
            let corners = self.corners.get_mut(..end).unwrap_or(&mut []);
            let (mut at, mut number, mut hole) = (0, 0, 0);
            let mut last = 0..0;
            while let Some(length) = corners.get(at..).and_then(element_length) {
                if corners.get(at).is_some_and(|corner| corner.of_bar() == bars) {
                    if number == range.start {
                        hole = at;
                    }
                    number += 1;
                    last = at..at + length;
                }
                at += length;
            }
            if let Some(between) = corners.get_mut(hole..last.end).filter(|_| last.start > hole) {
                between.rotate_right(last.len());
                self.move_pen(last, hole);
                self.keep_elements(bars, range.start + 1..range.end + 1);
                return;
            }
        }
        self.keep_elements(bars, range);
    }

    /// Removes the bars, or faces, whose positions among their kind are in `gone`.
    fn keep_elements(&mut self, bars: bool, gone: Range<usize>) {
        let mut number = 0;
        self.retain(&mut |element| {
            let counts = element.first().is_some_and(|corner| corner.of_bar() == bars);
            number += usize::from(counts);
            !(counts && gone.contains(&(number - 1)))
        });
    }

    /// Gives every corner and control point its new number. Elements and curves with a vertex for
    /// which `new` returns `None` are removed.
    fn renumber(&mut self, new: &dyn Fn(u16) -> Option<u16>) {
        self.retain(&mut |element| {
            element.iter_mut().all(|corner| match new(corner.vertex()) {
                Some(number) => {
                    *corner = Corner::new(number, corner.of_bar(), corner.is_last());
                    true
                }
                None => false,
            })
        });
        self.curves.renumber(self.corners, new);
    }

    /// Keeps the elements for which `stays` returns `true`; it may change them.
    fn retain(&mut self, stays: &mut dyn FnMut(&mut [Corner]) -> bool) {
        let (end, mut runs) = (self.elements_end(), self.runs);
        let (mut read, mut write, mut bars, mut faces) = (0, 0, 0, 0);
        while let Some(length) = self.corners.get(read..end).and_then(element_length) {
            let element = self.corners.get_mut(read..read + length).unwrap_or(&mut []);
            let of_bar = element.first().is_some_and(|corner| corner.of_bar());
            if stays(element) {
                self.corners.copy_within(read..read + length, write);
                write += length;
                *(if of_bar { &mut bars } else { &mut faces }) += 1;
            } else {
                let list = self.corners.get_mut(end..self.curves.start).unwrap_or(&mut []);
                runs = close_gap(bytemuck::cast_slice_mut(list), runs, write..write + length);
            }
            read += length;
        }
        self.set_runs(end, runs, write);
        self.remove_halves(write..end);
        (self.bars, self.faces) = (bars, faces);
    }

    /// Updates the pens after the corners in `from` were moved to `to`, which is before them. There
    /// must be room for two more runs.
    fn move_pen(&mut self, from: Range<usize>, to: usize) {
        if self.runs == 0 {
            return;
        }
        let (end, pen) = (self.elements_end(), self.pens().at(from.start));
        for _ in 0..2 * RUN {
            let _ = self.insert_half(self.curves.start, 0);
        }
        let list = self.corners.get_mut(end..self.curves.start).unwrap_or(&mut []);
        let runs = bytemuck::cast_slice_mut(list);
        let count = close_gap(runs, self.runs, from.clone());
        let count = open_gap(runs, count, to, from.len(), pen);
        self.set_runs(end, count, end);
    }

    /// Keeps `count` of the runs after `start`, which belong to elements up to `end`.
    fn set_runs(&mut self, start: usize, count: usize, end: usize) {
        let list = self.corners.get(start..self.curves.start).unwrap_or(&[]);
        let runs: &[PenRun] = bytemuck::cast_slice(list);
        // A run that begins at the end is empty.
        let is_empty = count > 0 && runs.get(count - 1).is_some_and(|run| run.begins_at(end));
        self.runs = count - usize::from(is_empty);
        self.remove_halves(start + RUN * self.runs..self.curves.start);
    }

    /// Returns the reflection about the plane of three vertices.
    fn reflection(&self, numbers: [i32; 3]) -> Result<Map, ModelError> {
        let vertices = self.vertices.len();
        let mut corners = [Position::default(); 3];
        for (corner, number) in corners.iter_mut().zip(numbers) {
            *corner = super::resolve(number, vertices)
                .and_then(|at| self.vertices.get(usize::from(at)))
                .copied()
                .ok_or(ModelError::UnknownVertex { number, vertices })?;
        }
        let [a, b, c] = corners.map(Position::coordinates);
        let [u, v] =
            [b, c].map(|end| [0, 1, 2].map(|k: usize| i64::from(end[k]) - i64::from(a[k])));
        let cross = [0, 1, 2].map(|k: usize| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            // Each component is at most 2^63.
            (u[i] * v[j]).saturating_sub(u[j] * v[i])
        });
        let divisor = cross.iter().fold(0, |divisor, part| gcd(divisor, part.unsigned_abs()));
        if divisor == 0 {
            return Err(ModelError::NoPlane);
        }
        let divisor = i64::try_from(divisor).unwrap_or(i64::MAX);
        let normal = cross.map(|part| part / divisor);
        let largest = normal.iter().map(|part| part.unsigned_abs()).max().unwrap_or(1);
        let excess = (u64::BITS - largest.leading_zeros()).saturating_sub(NORMAL_BITS);
        Ok(Map::Reflection(corners[0], normal.map(|part| part >> excess)))
    }

    /// Maps the vertices in `range`, and makes the unit coarser if necessary.
    fn transform(
        &mut self,
        map: &Map,
        range: Range<usize>,
        keep: Before<'_>,
    ) -> Result<(), ModelError> {
        let positions = self.vertices.get(range.clone()).unwrap_or(&[]);
        let coarser = self.coarser_for(positions.iter().map(|position| map.apply(*position)))?;
        keep(self);
        for position in self.vertices.get_mut(range.clone()).unwrap_or(&mut []) {
            *position = in_unit(map.apply(*position), coarser);
        }
        self.coarsen_others(coarser, range);
        Ok(())
    }

    /// Returns by how many bits the unit must become coarser so that these positions fit.
    fn coarser_for(&self, positions: impl Iterator<Item = [i64; 3]>) -> Result<u32, ModelError> {
        let largest = positions.flatten().map(i64::unsigned_abs).max().unwrap_or(0);
        (0..=self.fraction_bits)
            .find(|bits| largest >> bits <= POSITION_LIMIT as u64)
            .ok_or(ModelError::CoordinateTooLarge)
    }

    /// Converts all vertices except those in `range` to a unit that is coarser by `bits`.
    fn coarsen_others(&mut self, bits: u32, range: Range<usize>) {
        if bits > 0 {
            for (at, position) in self.vertices.iter_mut().enumerate() {
                if !range.contains(&at) {
                    *position = in_unit(position.coordinates().map(i64::from), bits);
                }
            }
            self.rounding.coarsen(bits);
            self.fraction_bits -= bits;
        }
    }

    /// Reverses the faces that have all their vertices in `range`, so that they face outwards
    /// again.
    fn turn_faces(&mut self, range: &Range<usize>) {
        self.retain(&mut |element| {
            let inside = element.iter().all(|corner| range.contains(&usize::from(corner.vertex())));
            if inside && element.first().is_some_and(|corner| !corner.of_bar()) {
                reverse(element);
            }
            true
        });
    }

    /// Adds the image of the vertices in `range`, and of the elements and curves that have all
    /// their vertices there.
    fn mirror(
        &mut self,
        map: &Map,
        range: Range<usize>,
        mut scratch: Scratch<'_>,
        keep: Before<'_>,
    ) -> Result<(), ModelError> {
        let images = scratch.take::<u16>(range.len()).map_err(ModelError::Scratch)?;
        let (old, limit) = (self.vertices.len(), self.vertex_limit());
        let mut count = old;
        for (at, image) in range.clone().zip(images.iter_mut()) {
            let Some(position) = self.vertices.get(at) else { continue };
            let near = |(image, c): (i64, i32)| (image - i64::from(c)).unsigned_abs() <= ON_PLANE;
            let stays = map.apply(*position).into_iter().zip(position.coordinates()).all(near);
            // The number is below VERTEX_NUMBER_LIMIT, otherwise the edit is refused below.
            *image = if stays { at } else { count } as u16;
            count += usize::from(!stays);
        }
        if count > limit {
            return Err(ModelError::TooManyVertices { limit });
        }
        let image = |number: u16| {
            let at = usize::from(number).checked_sub(range.start)?;
            images.get(at).copied()
        };
        // What lies in the plane is its own image and is not copied.
        let is_copied = |mut numbers: &mut dyn Iterator<Item = u16>| {
            let mut moves = false;
            Iterator::all(&mut numbers, |number| {
                image(number).inspect(|new| moves |= *new != number).is_some()
            }) && moves
        };
        let elements = self.elements();
        let (mut of_elements, mut at, mut pen) = (0, 0, elements.pens().last());
        for element in elements.corners().split_inclusive(|corner| corner.is_last()) {
            if is_copied(&mut element.iter().map(|corner| corner.vertex())) {
                let last = core::mem::replace(&mut pen, elements.pens().at(at));
                of_elements += element.len() + if pen == last { 0 } else { RUN };
            }
            at += element.len();
        }
        let of_curves: usize = self
            .curves()
            .iter()
            .filter(|curve| is_copied(&mut curve.control.iter().copied()))
            .map(|curve| curve.half_words())
            .sum();
        self.check_corners(of_elements + of_curves)?;
        let positions = self.vertices.get(range.clone()).unwrap_or(&[]);
        let coarser = self.coarser_for(positions.iter().map(|position| map.apply(*position)))?;

        keep(self);
        for at in range.clone() {
            let Some(position) = self.vertices.get(at) else { continue };
            if image(at as u16) != Some(at as u16) {
                let position = in_unit(map.apply(*position), coarser);
                // There is room, because it was counted.
                let _ = self.vertices.push(position);
            }
        }
        self.coarsen_others(coarser, old..count);
        let end = self.elements_end();
        let mut at = 0;
        while let Some(length) = self.corners.get(at..end).and_then(element_length) {
            let element = at..at + length;
            at += length;
            let corners = self.corners.get(element.clone()).unwrap_or(&[]);
            if !is_copied(&mut corners.iter().map(|corner| corner.vertex())) {
                continue;
            }
            self.begin_run(self.pens().at(element.start));
            let start = self.elements_end();
            for at in element {
                let Some(corner) = self.corners.get(at).copied() else { continue };
                let number = image(corner.vertex()).unwrap_or(0);
                // There is room: it was counted.
                let _ = self.insert(Corner::new(number, corner.of_bar(), corner.is_last()));
            }
            let end = self.elements_end();
            let copy = self.corners.get_mut(start..end).unwrap_or(&mut []);
            if copy.first().is_some_and(|corner| corner.of_bar()) {
                self.bars += 1;
            } else {
                reverse(copy);
                self.faces += 1;
            }
        }
        self.curves.copy(self.corners, &is_copied, &image);
        Ok(())
    }
}

/// Returns the number of corners of the first element.
fn element_length(corners: &[Corner]) -> Option<usize> {
    corners.iter().position(|corner| corner.is_last()).map(|last| last + 1)
}

/// Reverses the order of a face's corners, beginning at the same vertex.
fn reverse(face: &mut [Corner]) {
    let Some((_, rest)) = face.split_first_mut() else { return };
    rest.reverse();
    let last = face.len() - 1;
    for (at, corner) in face.iter_mut().enumerate() {
        *corner = Corner::new(corner.vertex(), false, at == last);
    }
}

/// Converts a position to a coarser unit. It is rounded towards zero, as when the unit of the model
/// changes.
fn in_unit(position: [i64; 3], coarser: u32) -> Position {
    // It fits: see `coarser_for`.
    let [x, y, z] = position.map(|c| ((c.abs() >> coarser) * c.signum()) as i32);
    Position { x, y, z }
}

fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

impl From<OutOfScratch> for ModelError {
    fn from(missing: OutOfScratch) -> Self {
        Self::Scratch(missing)
    }
}
