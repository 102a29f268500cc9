//! Chooses the layers that are drawn, and their order.

use crate::plan::Plan;
use std::collections::{BTreeMap, HashSet};

/// The most pens that a plotter has.
const MOST_PENS: usize = 32;

/// The layers of a plan with their names and pens, in the order of their pens.
fn layers(plan: &Plan) -> Vec<(u32, String, u32)> {
    let strokes = plan.strokes.iter().map(|stroke| (stroke.layer, stroke.pen));
    let areas = plan.areas.iter().flatten().map(|area| (area.layer, area.pen));
    let pens: BTreeMap<u32, u32> = strokes.chain(areas).collect();
    let mut layers: Vec<_> =
        pens.into_iter().map(|(layer, pen)| (layer, plan.layer_name(layer), pen)).collect();
    layers.sort_by_key(|(layer, _, pen)| (*pen, *layer));
    layers
}

/// The layers that `name` names: those that are called so, whatever the case of the letters, or
/// else those drawn by the pen of this number.
///
/// # Errors
/// There is none.
fn named(layers: &[(u32, String, u32)], name: &str) -> Result<Vec<u32>, String> {
    let lower = name.to_lowercase();
    let find = |is_it: &dyn Fn(&(u32, String, u32)) -> bool| -> Vec<u32> {
        layers.iter().filter(|layer| is_it(layer)).map(|(layer, _, _)| *layer).collect()
    };
    let mut found = find(&|(_, own, _)| own.trim().to_lowercase() == lower);
    if let (true, Ok(number)) = (found.is_empty(), name.parse::<u32>()) {
        found = find(&|(_, _, pen)| *pen == number);
    }
    if found.is_empty() {
        let known: Vec<String> =
            layers.iter().map(|(_, own, pen)| format!("\"{own}\" (pen {pen})")).collect();
        return Err(format!("there is no layer \"{name}\"; there are {}", known.join(", ")));
    }
    Ok(found)
}

/// Keeps the layers with these names alone.
///
/// # Errors
/// There is no such layer.
pub(super) fn choose(plan: &mut Plan, names: &[String]) -> Result<(), String> {
    let layers = layers(plan);
    let mut kept = HashSet::new();
    for name in names {
        kept.extend(named(&layers, name)?);
    }
    plan.strokes.retain(|stroke| kept.contains(&stroke.layer));
    if let Some(areas) = &mut plan.areas {
        areas.retain(|area| kept.contains(&area.layer));
    }
    Ok(())
}

/// Gives the layers their pens in the order of these names, and then in the order that they had.
/// Says which pen draws which layer.
///
/// # Errors
/// There is no such layer, or there are more layers than pens.
pub(super) fn reorder(plan: &mut Plan, names: &[String]) -> Result<String, String> {
    let layers = layers(plan);
    let mut order: Vec<u32> = Vec::new();
    let rest = layers.iter().map(|(layer, _, _)| Ok(vec![*layer]));
    for found in names.iter().map(|name| named(&layers, name)).chain(rest) {
        for layer in found? {
            if !order.contains(&layer) {
                order.push(layer);
            }
        }
    }
    if order.len() > MOST_PENS {
        return Err(format!(
            "there are {} layers, and a plotter has {MOST_PENS} pens",
            order.len()
        ));
    }
    let pens: BTreeMap<u32, u32> = order.iter().copied().zip(1..).collect();
    for stroke in &mut plan.strokes {
        stroke.pen = pens.get(&stroke.layer).copied().unwrap_or(stroke.pen);
    }
    let said = order.iter().zip(1..).map(|(layer, pen): (&u32, u32)| {
        format!("pen {pen} draws the layer \"{}\"", plan.layer_name(*layer))
    });
    Ok(said.collect::<Vec<_>>().join(", "))
}
