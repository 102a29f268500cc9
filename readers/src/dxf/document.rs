//! What a DXF file says: pairs of a code and a value, which make entities, layers and blocks.

use super::curves::Affine;
use crate::plan::Point;
use std::collections::{HashMap, HashSet};

/// The code with which an object begins that is embedded in an entity.
const EMBEDDED: i32 = 101;

/// A code and its value, and the line of the file in which the value stands. A file may have many
/// millions of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) code: i32,
    line: u32,
    /// The value with the spaces around it, which count in texts.
    pub(super) raw: &'a str,
}

impl<'a> Pair<'a> {
    pub(super) fn value(&self) -> &'a str {
        self.raw.trim()
    }

    pub(super) fn line(&self) -> usize {
        self.line as usize
    }
}

/// An entity of a drawing, such as a line.
#[derive(Debug, Clone)]
pub(super) struct Entity<'a> {
    pub(super) kind: &'a str,
    pub(super) line: usize,
    pub(super) pairs: &'a [Pair<'a>],
}

/// The reason why a file is refused: the number of the line, and a message.
pub(super) type LineError = (usize, String);

impl<'a> Entity<'a> {
    pub(super) fn text(&self, code: i32) -> Option<&'a str> {
        self.pairs.iter().find(|pair| pair.code == code).map(Pair::value)
    }

    /// The text with this code, with the spaces around it.
    pub(super) fn raw(&self, code: i32) -> Option<&'a str> {
        self.pairs.iter().find(|pair| pair.code == code).map(|pair| pair.raw)
    }

    /// All numbers with this code.
    pub(super) fn numbers(&self, code: i32) -> Result<Vec<f64>, LineError> {
        self.pairs.iter().filter(|pair| pair.code == code).map(|pair| number(*pair)).collect()
    }

    pub(super) fn number(&self, code: i32, default: f64) -> Result<f64, LineError> {
        Ok(self.numbers(code)?.first().copied().unwrap_or(default))
    }

    pub(super) fn point(&self, code: i32) -> Result<Point, LineError> {
        Ok([self.number(code, 0.0)?, self.number(code + 10, 0.0)?])
    }

    pub(super) fn point_in_space(&self, code: i32) -> Result<[f64; 3], LineError> {
        let [x, y] = self.point(code)?;
        Ok([x, y, self.number(code + 20, 0.0)?])
    }

    pub(super) fn points(&self, code: i32) -> Result<Vec<Point>, LineError> {
        let (x, y) = (self.numbers(code)?, self.numbers(code + 10)?);
        if x.len() != y.len() {
            return Err((self.line, format!("{} has points without x or y", self.kind)));
        }
        Ok(x.into_iter().zip(y).map(|(x, y)| [x, y]).collect())
    }

    pub(super) fn flags(&self) -> Result<i64, LineError> {
        Ok(self.number(70, 0.0)? as i64)
    }

    pub(super) fn layer(&self) -> &'a str {
        self.text(8).unwrap_or("0")
    }
}

pub(super) fn number(pair: Pair<'_>) -> Result<f64, LineError> {
    match pair.value().parse::<f64>() {
        Ok(value) if value.is_finite() && value.abs() < 1e12 => Ok(value),
        _ => Err((pair.line(), "this is no number that can be drawn".to_owned())),
    }
}

/// The contents of a file.
#[derive(Debug, Default)]
pub(super) struct Document<'a> {
    pub(super) unit: Option<i64>,
    /// What a point looks like, and how large its figure is (`$PDMODE`, `$PDSIZE`).
    pub(super) point_mode: i64,
    pub(super) point_size: f64,
    /// The layers that are not drawn, in capitals: names do not depend on them.
    hidden: HashSet<String>,
    /// The layers that are shown but not plotted, in capitals.
    unplotted: HashSet<String>,
    /// The blocks with their base points.
    blocks: HashMap<String, (Point, Vec<Entity<'a>>)>,
    /// The paths of the other drawings that blocks stand for.
    externals: HashMap<String, &'a str>,
    /// The line types that are not continuous: the lengths of dashes, above 0, and gaps, below 0.
    line_types: HashMap<String, Vec<f64>>,
    /// The line types that have letters or figures in their gaps, in capitals.
    figured: HashSet<String>,
    /// The line types of layers.
    types_of_layers: HashMap<String, &'a str>,
    /// By what the lengths of line types are multiplied.
    type_scale: f64,
    /// The outlines within which inserted blocks are shown, in the coordinates of the block, by the
    /// handles of the insertions.
    clips: HashMap<&'a str, Vec<Point>>,
    /// The number of insertions of which only a part is shown that is not known.
    pub(super) unclipped: usize,
    pub(super) entities: Vec<Entity<'a>>,
}

impl<'a> Document<'a> {
    /// Whether a layer is off or frozen.
    pub(super) fn is_hidden(&self, layer: &str) -> bool {
        self.hidden.contains(&layer.to_uppercase())
    }

    /// Whether a layer is shown on the screen only, as one with points of dimensions is.
    pub(super) fn is_unplotted(&self, layer: &str) -> bool {
        let layer = layer.to_uppercase();
        layer == "DEFPOINTS" || self.unplotted.contains(&layer)
    }

    /// The block with this name: its base point and its entities.
    pub(super) fn block(&self, name: &str) -> Option<&(Point, Vec<Entity<'a>>)> {
        self.blocks.get(&name.to_uppercase())
    }

    /// The path of the other drawing that the block with this name stands for, if nothing of that
    /// drawing is in this file.
    pub(super) fn external(&self, name: &str) -> Option<&'a str> {
        let is_elsewhere = self.block(name).is_some_and(|(_, entities)| entities.is_empty());
        self.externals.get(&name.to_uppercase()).copied().filter(|_| is_elsewhere)
    }

    /// The outline within which an insertion of a block shows it, in the coordinates of the block.
    pub(super) fn clip(&self, insertion: &Entity<'_>) -> Option<&[Point]> {
        self.clips.get(insertion.text(5)?).map(Vec::as_slice)
    }

    /// The name of the line type of an entity on this layer, in a block that is inserted with the
    /// type `of_block`.
    pub(super) fn line_type(&self, entity: &Entity<'a>, layer: &str, of_block: &'a str) -> &'a str {
        match entity.text(6) {
            Some(name) if name.eq_ignore_ascii_case("BYBLOCK") => of_block,
            Some(name) if !name.eq_ignore_ascii_case("BYLAYER") => name,
            _ => self.types_of_layers.get(&layer.to_uppercase()).copied().unwrap_or_default(),
        }
    }

    /// The lengths of the dashes and gaps of an entity with this line type, in units of the file;
    /// empty if its line is continuous.
    ///
    /// # Errors
    /// The scale of the entity is no number.
    pub(super) fn dashes(&self, entity: &Entity<'a>, name: &str) -> Result<Vec<f64>, LineError> {
        let scale = self.type_scale * entity.number(48, 1.0)?;
        let lengths = self.line_types.get(&name.to_uppercase());
        Ok(lengths.into_iter().flatten().map(|length| length * scale).collect())
    }
}

impl Document<'_> {
    /// Whether a line type has letters or figures in its gaps.
    pub(super) fn is_figured(&self, name: &str) -> bool {
        self.figured.contains(&name.to_uppercase())
    }
}

/// The pairs of a file.
pub(super) fn pairs(text: &str) -> Result<Vec<Pair<'_>>, LineError> {
    let mut lines = text.lines().enumerate();
    let mut pairs = Vec::new();
    while let Some((index, code)) = lines.next() {
        let Ok(code) = code.trim().parse() else {
            if code.trim().is_empty() && lines.clone().all(|(_, line)| line.trim().is_empty()) {
                break;
            }
            return Err((index + 1, "there should be a code of DXF, a whole number".to_owned()));
        };
        let Some((index, value)) = lines.next() else {
            return Err((index + 1, "the file ends after a code: is it complete?".to_owned()));
        };
        // A file of less than 4 GiB has no more lines.
        let line = u32::try_from(index + 1).unwrap_or(u32::MAX);
        let pair = Pair { code, line, raw: value };
        pairs.push(pair);
        // Whatever follows does not belong to the drawing.
        if (code, pair.value()) == (0, "EOF") {
            break;
        }
    }
    Ok(pairs)
}

/// Divides pairs into entities, each of which begins with code 0. What stands before the first is
/// left out, and so is an object that is embedded at the end of an entity: its codes have other
/// meanings.
pub(super) fn entities<'a>(pairs: &'a [Pair<'a>]) -> impl Iterator<Item = Entity<'a>> {
    let groups = pairs.chunk_by(|_, next| next.code != 0);
    groups.filter_map(|group| match group {
        [begin, pairs @ ..] if begin.code == 0 => {
            let pairs = pairs.split(|pair| pair.code == EMBEDDED).next().unwrap_or_default();
            Some(Entity { kind: begin.value(), line: begin.line(), pairs })
        }
        _ => None,
    })
}

pub(super) fn document<'a>(pairs: &'a [Pair<'a>]) -> Result<Document<'a>, LineError> {
    let mut document = Document { type_scale: 1.0, ..Document::default() };
    let starts: Vec<usize> = (0..pairs.len())
        .filter(|&at| pairs[at].code == 0 && pairs[at].value() == "SECTION")
        .collect();
    for (index, &start) in starts.iter().enumerate() {
        let end = starts.get(index + 1).copied().unwrap_or(pairs.len());
        let section = &pairs[start..end];
        match section.get(1).map(Pair::value) {
            Some("HEADER") => {
                let variable = |name: &str, code: i32| {
                    let mut after = section.iter().skip_while(|pair| pair.value() != name);
                    let value = after.nth(1).filter(|pair| pair.code == code);
                    value.map(|pair| number(*pair)).transpose()
                };
                let unit = variable("$INSUNITS", 70)?.map(|unit| unit as i64);
                document.unit = unit.or(document.unit);
                document.type_scale = variable("$LTSCALE", 40)?.unwrap_or(document.type_scale);
                document.point_mode = variable("$PDMODE", 70)?.unwrap_or_default() as i64;
                document.point_size = variable("$PDSIZE", 40)?.unwrap_or_default();
            }
            Some("TABLES") => {
                for entry in entities(section) {
                    let Some(name) = entry.text(2).map(str::to_uppercase) else { continue };
                    match entry.kind {
                        "LAYER" => {
                            let is_off = entry.number(62, 7.0)? < 0.0 || entry.flags()? & 1 == 1;
                            document.hidden.extend(is_off.then(|| name.clone()));
                            let is_unplotted = entry.number(290, 1.0)? == 0.0;
                            document.unplotted.extend(is_unplotted.then(|| name.clone()));
                            let line = entry.text(6);
                            document.types_of_layers.extend(line.map(|line| (name, line)));
                        }
                        "LTYPE" => {
                            let lengths = entry.numbers(49)?;
                            let is_figured = entry.numbers(74)?.iter().any(|kind| *kind != 0.0);
                            document.figured.extend(is_figured.then(|| name.clone()));
                            document.line_types.insert(name, lengths);
                        }
                        _ => {}
                    }
                }
            }
            Some("BLOCKS") => {
                let mut block: Option<String> = None;
                for entity in entities(section) {
                    match (entity.kind, &block) {
                        ("BLOCK", _) => {
                            let name = entity.text(2).unwrap_or_default().to_uppercase();
                            let base = entity.point(10)?;
                            let path = external(&entity)?.map(|path| (name.clone(), path));
                            document.externals.extend(path);
                            document.blocks.insert(name.clone(), (base, Vec::new()));
                            block = Some(name);
                        }
                        ("ENDBLK" | "ENDSEC" | "SECTION", _) => block = None,
                        (_, Some(name)) => {
                            if let Some((_, entities)) = document.blocks.get_mut(name) {
                                entities.push(entity);
                            }
                        }
                        _ => {}
                    }
                }
            }
            Some("ENTITIES") => {
                let is_own = |it: &Entity<'_>| !matches!(it.kind, "SECTION" | "ENDSEC" | "EOF");
                document.entities.extend(entities(section).filter(is_own));
            }
            Some("OBJECTS") => {
                // Each object belongs to one block that is inserted.
                let objects: Vec<Entity<'_>> = entities(section).collect();
                for object in objects.iter().filter(|object| object.kind == "SPATIAL_FILTER") {
                    if object.number(71, 1.0)? == 0.0 {
                        continue;
                    }
                    let clip = clip(object, &objects)?;
                    document.unclipped += usize::from(clip.is_none());
                    document.clips.extend(clip);
                }
            }
            _ => {}
        }
    }
    let blocks = document.blocks.values().flat_map(|(_, entities)| entities);
    let all = document.entities.iter().chain(blocks).filter(|entity| entity.kind == "INSERT");
    let handles: HashSet<&str> = all.filter_map(|entity| entity.text(5)).collect();
    let clips = document.clips.len();
    document.clips.retain(|handle, _| handles.contains(handle));
    document.unclipped += clips - document.clips.len();
    Ok(document)
}

/// The path of the other drawing that a block stands for, or else its name; `None` if it stands for
/// none.
fn external<'a>(block: &Entity<'a>) -> Result<Option<&'a str>, LineError> {
    let is_external = block.flags()? & (4 | 8) != 0;
    let path = block.text(1).filter(|path| !path.is_empty()).or_else(|| block.text(2));
    Ok(path.filter(|_| is_external))
}

/// The handle of the insertion that a filter in space belongs to, and the outline within which the
/// block is shown; `None` if the filter shows what is not within an outline in the plane.
fn clip<'a>(
    filter: &Entity<'a>,
    objects: &[Entity<'a>],
) -> Result<Option<(&'a str, Vec<Point>)>, LineError> {
    let owner = |object: &Entity<'a>| object.text(330);
    let owner_of = |handle: &str| {
        owner(objects.iter().find(|object| object.text(5).is_some_and(|own| own == handle))?)
    };
    // An insertion has a dictionary of its own, in which that of its filters is.
    let insertion = owner(filter).and_then(owner_of).and_then(owner_of);
    let Some(insertion) = insertion else { return Ok(None) };
    let is_inverse = objects.iter().any(|object| {
        let is_mark = |pair: &Pair<'_>| pair.value() == "ACAD_INVERTEDCLIP_ROUNDTRIP";
        object.pairs.iter().any(is_mark)
            && owner(object).and_then(owner_of).is_some_and(|of| filter.text(5) == Some(of))
    });
    let up = [filter.number(210, 0.0)?, filter.number(220, 0.0)?, filter.number(230, 1.0)?];
    let has_depth = filter.number(72, 0.0)? != 0.0 || filter.number(73, 0.0)? != 0.0;
    let matrices = filter.numbers(40)?;
    let (outline, count) = (filter.points(10)?, matrices.len());
    if is_inverse || up != [0.0, 0.0, 1.0] || has_depth || count < 24 || outline.len() < 2 {
        return Ok(None);
    }
    // The first of two matrices of 12 numbers leads to the coordinates of the block.
    let matrix = &matrices[count - 24..count - 12];
    let map = Affine([matrix[0], matrix[4], matrix[1], matrix[5], matrix[3], matrix[7]]);
    let corners = match outline[..] {
        [[left, low], [right, high]] => {
            vec![[left, low], [right, low], [right, high], [left, high]]
        }
        _ => outline,
    };
    Ok(Some((insertion, corners.into_iter().map(|point| map.apply(point)).collect())))
}
