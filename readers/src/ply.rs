//! Reads PLY files, binary and text, by the crate `ply-rs-bw`.
//!
//! Vertices are joined where they are equal, and faces may have any number of corners. Edges are
//! lines. What else the file holds, colours or normals for instance, has no meaning for a plotter;
//! other elements are counted. The reader refuses files without faces and edges, corners that are
//! no vertices, and numbers that are not finite.

use super::arrange::Arrangement;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::mesh::{Coordinate, Mesh};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::borrow::Cow;

/// The format itself.
#[derive(Debug)]
pub(super) struct Ply;

/// What is read of an element of the file: a vertex has coordinates, a face has corners, and an
/// edge has ends.
#[derive(Debug, Default)]
struct Element {
    point: [Option<Coordinate>; 3],
    corners: Option<Vec<i64>>,
    ends: [Option<i64>; 2],
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "vertex_indices" | "vertex_index" => {
                self.corners = corners(property);
                return PropertyAccessResult::Set;
            }
            "vertex1" | "vertex2" => {
                let end = usize::from(name == "vertex2");
                self.ends[end] = coordinate(&property).map(|number| number.value() as i64);
                return PropertyAccessResult::Set;
            }
            _ => return PropertyAccessResult::Ignored,
        };
        self.point[axis] = coordinate(&property);
        PropertyAccessResult::Set
    }
}

fn coordinate(property: &Property) -> Option<Coordinate> {
    Some(match *property {
        Property::Char(value) => Coordinate::Double(value.into()),
        Property::UChar(value) => Coordinate::Double(value.into()),
        Property::Short(value) => Coordinate::Double(value.into()),
        Property::UShort(value) => Coordinate::Double(value.into()),
        Property::Int(value) => Coordinate::Double(value.into()),
        Property::UInt(value) => Coordinate::Double(value.into()),
        Property::Float(value) => Coordinate::Single(value),
        Property::Double(value) => Coordinate::Double(value),
        _ => return None,
    })
}

fn corners(property: Property) -> Option<Vec<i64>> {
    /// Widens the numbers of a list.
    fn wide<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
        list.into_iter().map(Into::into).collect()
    }
    Some(match property {
        Property::ListChar(list) => wide(list),
        Property::ListUChar(list) => wide(list),
        Property::ListShort(list) => wide(list),
        Property::ListUShort(list) => wide(list),
        Property::ListInt(list) => wide(list),
        Property::ListUInt(list) => wide(list),
        _ => return None,
    })
}

/// A text file without the empty lines and the comments among its elements, for which the crate
/// does not look there. A binary file stays as it is.
fn without_empty_lines(bytes: &[u8]) -> Cow<'_, [u8]> {
    let lines = || bytes.split_inclusive(|byte| *byte == b'\n');
    let word = |line: &[u8], number: usize| {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        words.nth(number).map(<[u8]>::to_vec)
    };
    // Nothing stands before the format but the first word of the file, and comments.
    let has = |line: &[u8], wanted: &[u8]| word(line, 0).is_some_and(|word| word == wanted);
    let format = lines().take_while(|line| !has(line, b"end_header")).find(|l| has(l, b"format"));
    if format.and_then(|line| word(line, 1)).is_none_or(|kind| kind != b"ascii") {
        return Cow::Borrowed(bytes);
    }
    let has_meaning = |line: &&[u8]| word(line, 0).is_some_and(|word| word != b"comment");
    Cow::Owned(lines().filter(has_meaning).flatten().copied().collect())
}

impl Format for Ply {
    fn name(&self) -> &'static str {
        "PLY"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ply"]
    }

    fn recognises(&self, beginning: &[u8]) -> bool {
        beginning.starts_with(b"ply\n") || beginning.starts_with(b"ply\r")
    }

    fn may_be_binary(&self, _: &[u8]) -> bool {
        true
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let refused = |reason| ReadError::Content { file: file.clone(), reason };
        let bytes = without_empty_lines(&bytes);
        let mut rest = &*bytes;
        let mut reader = Reader::new(&mut rest);
        let parser = Parser::<Element>::new();
        let payload = parser
            .read_header(&mut reader)
            .and_then(|header| parser.read_payload(&mut reader, &header));
        let payload = payload.map_err(|error| {
            // The crate's messages have several lines, with whole lines of the file.
            let said = error.to_string();
            let said: Vec<&str> = said.split_whitespace().take(20).collect();
            refused(format!("this is no whole PLY file: {}", said.join(" ")))
        })?;
        let mut mesh = Mesh::new(file.clone());
        let mut numbers = Vec::new();
        for (index, vertex) in payload.get("vertex").into_iter().flatten().enumerate() {
            let [Some(x), Some(y), Some(z)] = vertex.point else {
                return Err(refused(format!("vertex {index} does not have x, y and z")));
            };
            if ![x, y, z].into_iter().all(Coordinate::is_finite) {
                return Err(refused(format!("a coordinate of vertex {index} is no finite number")));
            }
            numbers.push(mesh.vertex([x, y, z]));
        }
        let number = |corner: &i64| numbers.get(usize::try_from(*corner).ok()?).copied();
        for (index, face) in payload.get("face").into_iter().flatten().enumerate() {
            let Some(corners) = &face.corners else {
                return Err(refused(format!("face {index} has no list of vertices")));
            };
            let known: Vec<u32> = corners.iter().filter_map(number).collect();
            if known.len() < corners.len() {
                return Err(refused(format!("face {index} has a corner that is no vertex")));
            }
            mesh.face(index as u32 + 1, &known);
        }
        for (index, edge) in payload.get("edge").into_iter().flatten().enumerate() {
            let [Some(from), Some(to)] = edge.ends.map(|end| number(&end?)) else {
                return Err(refused(format!("edge {index} has an end that is no vertex")));
            };
            mesh.edge(index as u32 + 1, [from, to]);
        }
        let others = payload.iter().filter(|(name, elements)| {
            !["vertex", "face", "edge"].contains(&name.as_str()) && !elements.is_empty()
        });
        let others =
            others.map(|(name, elements)| format!("{} of {name} not read", elements.len()));
        let others: Vec<String> = others.collect();
        if mesh.is_empty() && !numbers.is_empty() {
            let others: String = others.iter().map(|it| format!(", and {it}")).collect();
            return Err(refused(format!(
                "there are {} points and no face to draw{others}: make a mesh of faces of them \
                 first, for example with MeshLab",
                numbers.len()
            )));
        }
        let mut contents = mesh.finish()?;
        contents.notes.extend(others);
        // A line end behind the elements is usual, in binary files too.
        let unread = rest.trim_ascii().len();
        if unread > 0 {
            contents.notes.push(format!(
                "behind the elements that its head announces the file has {unread} more bytes, \
                 which are not read"
            ));
        }
        Ok(contents)
    }
}

#[cfg(test)]
mod tests {
    use crate::tests::sent;

    const HEAD: &str = "comment a square\nelement vertex 4\nproperty float x\nproperty float y\n\
                        property float z\nproperty uchar red\nelement face 1\n\
                        property list uchar int vertex_indices\nend_header\n";

    fn expected() -> Result<Vec<String>, String> {
        let lines = ["v 0 0 0", "v 1.1 0 0", "v 1.1 1 0", "v 0 1 0", "f 1 2 3 4"];
        Ok(lines.map(str::to_owned).to_vec())
    }

    #[test]
    fn text_and_both_binary_forms_are_the_same_mesh() {
        let text = format!(
            "ply\nformat ascii 1.0\n{HEAD}0 0 0 255\n1.1 0 0 255\n1.1 1 0 0\n0 1 0 0\n4 0 1 2 3\n"
        );
        assert_eq!(sent("a.ply", text.as_bytes()), expected());
        assert_eq!(sent("a", text.as_bytes()), expected(), "known by its beginning");
        let vertices: [[f32; 3]; 4] =
            [[0.0, 0.0, 0.0], [1.1, 0.0, 0.0], [1.1, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for (name, is_little) in [("binary_little_endian", true), ("binary_big_endian", false)] {
            let mut bytes = format!("ply\nformat {name} 1.0\n{HEAD}").into_bytes();
            let four = |bits: u32| if is_little { bits.to_le_bytes() } else { bits.to_be_bytes() };
            for vertex in vertices {
                bytes.extend(vertex.iter().flat_map(|number| four(number.to_bits())));
                bytes.push(7);
            }
            bytes.push(4);
            bytes.extend((0..4).flat_map(four));
            assert_eq!(sent("a.ply", &bytes), expected(), "{name}");
        }
    }

    #[test]
    fn empty_lines_and_comments_among_the_elements_mean_nothing() {
        let text = format!(
            "ply\nformat ascii 1.0\n{HEAD}\n0 0 0 255\ncomment one\n  \n1.1 0 0 255\n1.1 1 0 0\n\
             0 1 0 0\n\n4 0 1 2 3\n\n"
        );
        assert_eq!(sent("a.ply", text.as_bytes()), expected());
        assert_eq!(sent("a.ply", text.replace('\n', "\r\n").as_bytes()), expected());
    }

    #[test]
    fn edges_are_lines_and_other_elements_are_counted() {
        let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                    property float z\n";
        let points = "0 0 0\n1 0 0\n1 1 0\n";
        let edges = "element edge 2\nproperty int vertex1\nproperty int vertex2\n";
        let file = format!("{head}{edges}end_header\n{points}0 1\n2 1\n");
        let expected = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "l 1 2", "l 3 2"].map(str::to_owned);
        assert_eq!(sent("a.ply", file.as_bytes()), Ok(expected.to_vec()));
        let error = sent("a.ply", file.replace("2 1", "3 1").as_bytes()).expect_err("refused");
        assert!(error.contains("edge 1 has an end that is no vertex"), "{error}");
        let strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
        let error = sent("a.ply", format!("{head}{strips}{points}3 0 1 2\n").as_bytes());
        let error = error.expect_err("refused");
        assert!(
            error.contains("there are 3 points and no face to draw, and 1 of tristrips not read"),
            "{error}"
        );
        let cloud = format!("{head}end_header\n{points}");
        let error = sent("a.ply", cloud.as_bytes()).expect_err("refused");
        assert!(error.contains("there are 3 points and no face to draw: make a mesh"), "{error}");
    }

    #[test]
    fn what_is_left_out_is_told() {
        let head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                    property float z\nelement edge 2\nproperty int vertex1\n\
                    property int vertex2\nend_header\n0 0 0\n1 0 0\n1 1 0\n1 1 0\n0 1\n";
        let notes = |edges: &str| {
            let file = format!("{head}{edges}");
            let file = crate::SourceFile::new("a.ply".to_owned(), file.into_bytes());
            file.expect("a file that is drawn").notes().join("; ")
        };
        assert_eq!(notes("1 2\n \n"), "");
        let plan = format!("{head}2 0\n");
        let plan = crate::SourceFile::new("a.ply".to_owned(), plan.into_bytes());
        assert_eq!(plan.expect("drawn").bounds(), Some([[0.0, 0.0], [1.0, 1.0]]));
        assert_eq!(notes("2 3\n"), "1 edge has no length, and nothing is drawn of that");
        let more = notes("1 2\n2 0\n3 0\n");
        assert!(more.starts_with("behind the elements"), "{more}");
        assert!(more.contains("the file has 7 more bytes"), "{more}");
    }

    #[test]
    fn damaged_files_are_refused_in_a_sentence() {
        let file =
            |vertices: &str, face: &str| format!("ply\nformat ascii 1.0\n{HEAD}{vertices}{face}");
        let vertices = "0 0 0 1\n1 0 0 1\n1 1 0 1\n0 1 0 1\n";
        for (text, reason) in [
            (file(vertices, ""), "this is no whole PLY file: "),
            (file(vertices, "4 0 1 2 9\n"), "face 0 has a corner that is no vertex"),
            (file(vertices, "4 0 1 2 -1\n"), "face 0 has a corner that is no vertex"),
            (
                file(&vertices.replace("1 1 0 1", "1e39 1 0 1"), "3 0 1 2\n"),
                "vertex 2 is no finite",
            ),
            (
                "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n"
                    .into(),
                "no whole PLY",
            ),
            (
                "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n".into(),
                "no face to draw",
            ),
        ] {
            let error = sent("a.ply", text.as_bytes()).expect_err("refused");
            assert!(error.contains(reason), "{error}");
        }
    }
}
