//! Chooses the pen of each stroke: by layers, or else by colours.

use super::axidraw::Control;
use super::markup::{INKSCAPE, SHAPES};
use crate::plan::number_in;
use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use usvg::roxmltree::{Node, NodeId};

/// A layer of the drawing.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Layer {
    /// The group that is the layer.
    pub(super) element: NodeId,
    /// The label of the layer, or else its `id`.
    pub(super) name: String,
    /// The pen in that name, unless a program has made the name up.
    pub(super) number: Option<u32>,
}

/// The properties of a path that may choose its pen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Marks {
    /// The layer that contains the path.
    pub(super) layer: Option<Layer>,
    /// The colour of the path: red, green and blue; `None` if it has several, as a gradient has.
    pub(super) colour: Option<[u8; 3]>,
}

/// The label of a layer, or else its `id`, in which Illustrator writes a letter as `_x31_` where an
/// `id` may not have it.
pub(super) fn name(layer: Node<'_, '_>) -> String {
    if let Some(label) = layer.attribute((INKSCAPE, "label")) {
        return label.to_owned();
    }
    let mut parts = layer.attribute("id").unwrap_or_default().split("_x");
    let mut name = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let coded = part.split_once('_').and_then(|(code, rest)| {
            Some((char::from_u32(u32::from_str_radix(code, 16).ok()?)?, rest))
        });
        match coded {
            Some((letter, rest)) => name.extend([&*letter.to_string(), rest]),
            None => name.extend(["_x", part]),
        }
    }
    name
}

/// The number in the name of a layer; `None` in a name that a program makes up of that of an
/// element and a number.
pub(super) fn pen_of(layer: Node<'_, '_>) -> Option<u32> {
    let name = name(layer);
    let digits = name.find(|letter: char| letter.is_ascii_digit()).unwrap_or(name.len());
    let (element, rest) = name.split_at(digits);
    let is_made_up = !layer.has_attribute((INKSCAPE, "label"))
        && rest.chars().all(|letter| letter.is_ascii_digit() || letter == '-')
        && (SHAPES.contains(&element)
            || ["g", "text", "tspan", "use", "svg", "penup-"].contains(&element));
    if is_made_up { None } else { number_in(&name) }
}

/// Says which codes of AxiDraw in the names of layers are not obeyed.
pub(super) fn not_obeyed(marks: &[Marks]) -> Vec<String> {
    let (layers, _) = distinct(marks.iter().filter_map(|marks| marks.layer.as_ref()));
    let mut notes = Vec::new();
    let alone = layers.len() < 2;
    for layer in layers {
        let (name, control) = (layer.name.trim(), Control::of(&layer.name));
        let codes = control.not_obeyed();
        if !codes.is_empty() {
            notes.push(format!(
                "the layer \"{name}\" is drawn with the speed and the pen of the others: {} cannot \
                 be obeyed",
                codes.join(" ")
            ));
        }
        if control.pauses && alone {
            notes.push(format!(
                "there is no pause before the layer \"{name}\": it is the only one, and the \
                 machine pauses where pens change"
            ));
        }
    }
    notes
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
    let mut numbered: Vec<Option<u32>> =
        layers.iter().map(|layer| layer.map_or(Some(1), |layer| layer.number)).collect();
    // A layer before which the machine pauses has a pen that no other layer has.
    let mut used = HashSet::new();
    let pauses = |layer: &Layer| Control::of(&layer.name).pauses;
    for (number, layer) in numbered.iter_mut().zip(&layers) {
        if number.is_some_and(|number| !used.insert(number)) && layer.is_some_and(pauses) {
            *number = None;
        }
    }
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
