//! Chooses the pen of each stroke: by layers, or else by colours.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use usvg::roxmltree::NodeId;

/// The most pens that a plotter has.
const MOST_PENS: u32 = 32;

/// A layer of the drawing.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Layer {
    /// The group that it is.
    pub(super) element: NodeId,
    /// Its label, or else its `id`.
    pub(super) name: String,
}

/// What may choose the pen of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Marks {
    /// The layer that contains it.
    pub(super) layer: Option<Layer>,
    /// Its colour: red, green and blue; `None` if it has several, as a gradient has.
    pub(super) colour: Option<[u8; 3]>,
}

/// The pen number in the name of a layer: `1`, `2 red`, `pen3`, `Layer 4`, `layer_5`. The number
/// stands at the beginning, or after one word.
pub(super) fn number_in(name: &str) -> Option<u32> {
    let word_end = name.find(|letter: char| !letter.is_alphabetic()).unwrap_or(name.len());
    let rest = name.get(word_end..)?.trim_start_matches([' ', '_', '-', '#']);
    let end = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
    let number = rest.get(..end)?.parse().ok()?;
    (1..=MOST_PENS).contains(&number).then_some(number)
}

/// The pens of paths, and their layers.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Chosen {
    /// For each path the number of its pen, which may be above that of the last pen of a plotter,
    /// and that of its layer.
    pub(super) of_paths: Vec<(u32, u32)>,
    /// The names of the layers. If colours choose the pens, they are the layers.
    pub(super) layers: Vec<String>,
}

/// Chooses the pen of each path.
///
/// If the drawing lies in more than one layer, the layers choose: those with a number have that
/// pen, and each other one takes the first pen that no layer has. What lies in no layer has pen 1.
/// In a drawing of one layer, the colours choose, in the order in which they appear; if there is
/// but one, the layer does.
pub(super) fn pens(marks: &[Marks]) -> Chosen {
    let (layers, in_layer) = distinct(marks.iter().map(|marks| marks.layer.as_ref()));
    let (colours, in_colour) = distinct(marks.iter().map(|marks| marks.colour));
    let number = |at: usize| u32::try_from(at).unwrap_or(u32::MAX - 1);
    if layers.len() < 2 && colours.len() > 1 {
        let name = |colour: &Option<[u8; 3]>| match colour {
            Some([red, green, blue]) => format!("#{red:02x}{green:02x}{blue:02x}"),
            None => "several colours".to_owned(),
        };
        let of_path = |at: &usize| (number(*at) + 1, number(*at));
        return Chosen {
            of_paths: in_colour.iter().map(of_path).collect(),
            layers: colours.iter().map(name).collect(),
        };
    }
    let numbered: Vec<Option<u32>> =
        layers.iter().map(|layer| layer.map_or(Some(1), |layer| number_in(&layer.name))).collect();
    let taken: HashSet<u32> = numbered.iter().copied().flatten().collect();
    let mut free = (1..).filter(|number| !taken.contains(number));
    let chosen: Vec<u32> =
        numbered.into_iter().map(|number| number.or_else(|| free.next()).unwrap_or(1)).collect();
    let of_path = |at: &usize| Some((chosen.get(*at).copied()?, number(*at)));
    let name = |layer: &Option<&Layer>| match layer {
        Some(layer) => layer.name.trim().to_owned(),
        None => "no layer".to_owned(),
    };
    Chosen {
        of_paths: in_layer.iter().filter_map(of_path).collect(),
        layers: layers.iter().map(name).collect(),
    }
}

/// The different values in the order in which they appear, and for each value its place among them.
fn distinct<T: Copy + Eq + Hash>(values: impl Iterator<Item = T>) -> (Vec<T>, Vec<usize>) {
    let mut indices = HashMap::new();
    let mut distinct = Vec::new();
    let index = |value| {
        *indices.entry(value).or_insert_with(|| {
            distinct.push(value);
            distinct.len() - 1
        })
    };
    let all = values.map(index).collect();
    (distinct, all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_a_pen_is_found_in_the_name_of_a_layer() {
        for (name, number) in [
            ("1", Some(1)),
            ("2 red", Some(2)),
            ("pen3", Some(3)),
            ("Layer 4", Some(4)),
            ("layer_05", Some(5)),
            ("12-outline", Some(12)),
            ("red", None),
            ("the house of 1893", None),
            ("0", None),
            ("33", None),
            ("", None),
            ("99999999999999999999", None),
        ] {
            assert_eq!(number_in(name), number, "{name}");
        }
    }
}
