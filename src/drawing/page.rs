//! The sheet of paper, and where on it there is room for the drawing and its title.

use super::{PAGE_LIMIT, Title};
use crate::fixed::Millimetres;

/// A sheet of paper, whose lower left corner is at the plotter's origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// Size along x, in mm.
    pub width: Millimetres,
    /// Size along y, in mm.
    pub height: Millimetres,
    /// Width that is kept free along all four sides, in mm.
    pub margin: Millimetres,
    /// Height that is kept free below the drawing for its title, in mm; 0 if there is none.
    pub foot: Millimetres,
}

/// The reasons why the drawing cannot be placed on the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageError {
    /// The margins and the title leave no free area.
    NoRoom,
    /// A side of the page is longer than 2^20 steps.
    TooManySteps,
    /// A plan at true size is larger than the free part of the page.
    DoesNotFit {
        /// Size of the plan along x, in 0.1 mm. The greatest value stands for all larger ones.
        width: u32,
        /// Size of the plan along y, in 0.1 mm. The greatest value stands for all larger ones.
        height: u32,
        /// Height that the title takes below the plan, in mm; 0 if there is none.
        foot: Millimetres,
    },
    /// The title is wider than the free part of the page.
    TitleTooWide {
        /// Width of the title, in mm.
        width: Millimetres,
        /// Width of the free part of the page, in mm.
        free: Millimetres,
    },
}

/// How many motor steps are one millimetre, along x and along y.
pub type StepsPerMillimetre = [Millimetres; 2];

impl Page {
    /// Returns the size of the page without its margins and its foot, in units of 2^-16 mm.
    pub(super) fn free(&self) -> Result<[i64; 2], PageError> {
        let margin = i64::from(self.margin.to_bits());
        let free = [(self.width, 0), (self.height, 1)]
            .map(|(side, axis)| i64::from(side.to_bits()) - margin - self.first(axis));
        match free {
            [width, height] if width > 0 && height > 0 => Ok(free),
            _ => Err(PageError::NoRoom),
        }
    }

    /// Returns the least coordinate along an axis at which the drawing may begin, in units of 2^-16
    /// mm.
    pub(super) fn first(&self, axis: usize) -> i64 {
        let foot = if axis == 0 { 0 } else { self.foot.to_bits() };
        i64::from(self.margin.to_bits()) + i64::from(foot)
    }

    /// Returns the position of a title on the page: its left end and its baseline, in mm. The title
    /// is placed below a drawing that reaches from `left` to `right` and down to `bottom` (in
    /// steps), centred under it, and then moved to be within the margins.
    ///
    /// # Errors
    /// [`PageError::TitleTooWide`], [`PageError::NoRoom`].
    pub fn place_title(
        &self,
        title: &Title<'_>,
        [left, right, bottom]: [i32; 3],
        steps: StepsPerMillimetre,
    ) -> Result<[Millimetres; 2], PageError> {
        let free = self.width.saturating_sub(self.margin).saturating_sub(self.margin);
        let width = title.width();
        if free <= 0 {
            return Err(PageError::NoRoom);
        }
        if width > free {
            return Err(PageError::TitleTooWide { width, free });
        }
        // Steps are within 2^21, and steps per millimetre have 16 fraction bits: the page has less
        // than 2^20 steps.
        let millimetres = |steps: i64, per_millimetre: Millimetres| {
            let bits = (steps << 32).checked_div(per_millimetre.to_bits().into());
            Millimetres::from_bits(bits.unwrap_or(0) as i32)
        };
        let middle = millimetres((i64::from(left) + i64::from(right)) / 2, steps[0]);
        let last = self.margin.saturating_add(free - width);
        let x = middle.saturating_sub(width / 2).min(last).max(self.margin);
        let y = millimetres(bottom.into(), steps[1]).saturating_sub(title.rise());
        Ok([x, y.max(self.margin.saturating_add(title.depth()))])
    }

    /// Refuses a page with a side longer than [`PAGE_LIMIT`].
    pub(super) fn check_steps(&self, steps: StepsPerMillimetre) -> Result<(), PageError> {
        let fits = [0, 1]
            .iter()
            .all(|&axis: &usize| side_steps(self, steps, axis) <= i64::from(PAGE_LIMIT));
        if fits { Ok(()) } else { Err(PageError::TooManySteps) }
    }
}

/// Returns the length of the page along an axis, in steps.
pub(super) fn side_steps(page: &Page, steps: StepsPerMillimetre, axis: usize) -> i64 {
    let [x, y] = steps;
    let (side, per_mm) = if axis == 0 { (page.width, x) } else { (page.height, y) };
    (i64::from(side.to_bits()) * i64::from(per_mm.to_bits())) >> 32
}

/// Returns the height that is kept free below the drawing, in steps; 0 along x.
pub(super) fn foot_steps(page: &Page, steps: StepsPerMillimetre, axis: usize) -> i64 {
    if axis == 0 {
        0
    } else {
        (i64::from(page.foot.to_bits()) * i64::from(steps[1].to_bits())) >> 32
    }
}
