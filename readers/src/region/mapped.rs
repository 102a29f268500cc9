//! Moves regions together with the plan that they bound.

use super::{Region, Regions, ShadedArea};
use crate::plan::Point;
use std::collections::HashMap;
use std::sync::Arc;

/// The regions that are mapped already, so that one in which many shapes lie is mapped, and stays
/// in memory, once. Each is found by its address, and is kept with its image, so that no other
/// region gets that address meanwhile.
#[derive(Debug, Default)]
pub(crate) struct MappedRegions(HashMap<*const Region, [Arc<Region>; 2]>);

impl MappedRegions {
    /// The images of these regions.
    fn mapped_all(
        &mut self,
        regions: &[Arc<Region>],
        map: &impl Fn(Point) -> Point,
    ) -> Vec<Arc<Region>> {
        let mut mapped = Vec::new();
        for region in regions {
            let address = Arc::as_ptr(region);
            let known = self.0.get(&address).map(|[_, image]| image.clone());
            let image = known.unwrap_or_else(|| Arc::new(region.mapped(map, self)));
            self.0.insert(address, [region.clone(), image.clone()]);
            mapped.push(image);
        }
        mapped
    }
}

impl Region {
    /// The region with every point moved by `map`, and with it the regions that bound its parts.
    fn mapped(&self, map: &impl Fn(Point) -> Point, known: &mut MappedRegions) -> Self {
        let parts = self.parts.iter().map(|part| {
            let outlines = part.outlines.iter();
            let outlines = outlines.map(|outline| outline.iter().copied().map(map).collect());
            let within = known.mapped_all(&part.within, map);
            let moved = ShadedArea::new(outlines.collect(), part.is_even_odd, within);
            ShadedArea { shade: part.shade, ..moved }
        });
        Self { parts: parts.collect() }
    }
}

impl Regions {
    /// Moves every point of the regions by `map`. `known` are those that `map` has moved before.
    pub(crate) fn transform(&mut self, map: &impl Fn(Point) -> Point, known: &mut MappedRegions) {
        self.0 = known.mapped_all(&self.0, map);
    }
}
