//! A start that leaves few vertices free: duals as large as the nearest neighbours let them be, and
//! the pairs that touch then.

use super::Matching;
use crate::order::pace::Pace;
use crate::order::{NONE, OrderError};

impl Matching<'_, '_> {
    /// Sets the duals and matches what touches.
    pub(super) fn start(&mut self, pace: &mut Pace<'_>) -> Result<(), OrderError> {
        let real = self.odd.real_count();
        for vertex in 0..real {
            self.charge(1, pace)?;
            let mut nearest = i32::MAX;
            for other in (0..real).filter(|&other| other != vertex) {
                if let Some(weight) = self.weight_below(vertex, other, nearest) {
                    nearest = weight;
                }
            }
            // Half the weight each: no two discs overlap.
            self.radius[usize::from(vertex)] = nearest / 2;
        }
        // With this weight the free ends, of no radius, overlap none either.
        self.end_weight = self.radius.iter().copied().max().unwrap_or(0);
        for vertex in 0..self.odd.count() {
            if self.mate[usize::from(vertex)] == NONE {
                self.charge(1, pace)?;
                self.widen(vertex);
            }
        }
        Ok(())
    }

    /// Lets the disc of a free vertex grow until it touches another, and matches them if that one
    /// is free too.
    fn widen(&mut self, vertex: u16) {
        let own = self.radius[usize::from(vertex)];
        let mut gap = i32::MAX / 2;
        let mut touched = NONE;
        for other in (0..self.odd.count()).filter(|&other| other != vertex) {
            let reach = own + self.radius[usize::from(other)];
            let free = self.mate[usize::from(other)] == NONE;
            if let Some(weight) = self.weight_below(vertex, other, gap + reach + i32::from(free)) {
                gap = weight - reach;
                touched = other;
            }
        }
        self.radius[usize::from(vertex)] += gap;
        if let Some(&NONE) = self.mate.get(usize::from(touched)) {
            self.mate[usize::from(vertex)] = touched;
            self.mate[usize::from(touched)] = vertex;
        }
    }
}
