//! Reads STL files, binary and text.
//!
//! A binary file is known by its length, because its head may begin with `solid` as a text does. No
//! text tells so few faces where a binary file tells their number.
//! Equal points become one vertex. All solids of a text are read. (The crate `stl_io` reads the
//! first alone, and takes such a binary file for text.)
//!
//! The reader refuses files that end too early, and numbers that are not finite.

use super::arrange::Arrangement;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::mesh::{Coordinate, Mesh, Point};
use crate::lines::Origin;

/// The format itself.
#[derive(Debug)]
pub(super) struct Stl;

/// The number of bytes before the first face of a binary file, the last four of which count the
/// faces.
const HEAD: usize = 84;

/// The most faces that a file is believed to have which has fewer.
const MOST_FACES: usize = 100_000_000;

/// The number of bytes of a face in a binary file: the normal, three points, and two bytes more.
const FACE: usize = 50;

impl Format for Stl {
    fn name(&self) -> &'static str {
        "STL"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["stl"]
    }

    /// The file begins as a text does, because no beginning tells a binary file.
    fn recognises(&self, beginning: &[u8]) -> bool {
        let text = String::from_utf8_lossy(beginning);
        let mut words = text.lines().flat_map(words);
        words.next().is_some_and(is_solid) && words.any(|word| word.eq_ignore_ascii_case("facet"))
    }

    fn may_be_binary(&self, _: &[u8]) -> bool {
        true
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let mut mesh = Mesh::new(file.clone());
        let refused = |reason| Err(ReadError::Content { file: file.clone(), reason });
        let (mut behind, mut is_cut) = (0, false);
        match Binary::of(&bytes) {
            Binary::Faces(faces, rest) => {
                read_binary(&file, faces, &mut mesh)?;
                behind = rest;
            }
            _ if is_text(&bytes) => is_cut = read_text(&file, &bytes, &mut mesh)?,
            Binary::Short { has, tells } if tells <= MOST_FACES => {
                return refused(format!(
                    "the file ends after {has} of {tells} faces: copy or download it again"
                ));
            }
            Binary::Short { .. } => return refused("this is no STL file".to_owned()),
        }
        let mut contents = mesh.finish()?;
        if behind > 0 {
            contents.notes.push(format!("{behind} bytes behind the last face are not read"));
        }
        if is_cut {
            let note = "the last solid has no end (endsolid): is the file complete?";
            contents.notes.push(note.to_owned());
        }
        Ok(contents)
    }
}

/// The words of a line of a text file, without the comment that some programs write behind `#`.
fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split('#').next().unwrap_or_default().split_ascii_whitespace()
}

/// Whether this is the first word of a text file. Some programs write all words in capitals.
fn is_solid(word: &str) -> bool {
    word.eq_ignore_ascii_case("solid")
}

/// Whether this is text whose first word is that of an STL.
fn is_text(bytes: &[u8]) -> bool {
    let beginning = bytes.get(..4096).unwrap_or(bytes);
    let text = String::from_utf8_lossy(beginning);
    !beginning.contains(&0) && text.lines().flat_map(words).next().is_some_and(is_solid)
}

/// What a file is if it is taken as a binary one.
enum Binary<'b> {
    /// It has all faces that it tells, and so many bytes behind them.
    Faces(&'b [[u8; FACE]], usize),
    /// It has fewer whole faces than it tells.
    Short { has: usize, tells: usize },
}

impl<'b> Binary<'b> {
    fn of(bytes: &'b [u8]) -> Self {
        let Some((head, body)) = bytes.split_at_checked(HEAD) else {
            return Self::Short { has: 0, tells: usize::MAX };
        };
        let tells = head.last_chunk().map_or(0, |count| u32::from_le_bytes(*count) as usize);
        let (faces, _) = body.as_chunks();
        match faces.get(..tells) {
            Some(own) => Self::Faces(own, body.len() - tells * FACE),
            None => Self::Short { has: faces.len(), tells },
        }
    }
}

fn read_binary(file: &str, faces: &[[u8; FACE]], mesh: &mut Mesh) -> Result<(), ReadError> {
    for (index, face) in faces.iter().enumerate() {
        let (numbers, _) = face.as_chunks();
        let numbers = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes));
        // The first three are the normal, which follows from the points.
        let points: Vec<f32> = numbers.skip(3).take(9).collect();
        let number = index as u32 + 1;
        if points.iter().any(|number| !number.is_finite()) {
            let reason = format!("a coordinate of face {number} is no finite number");
            return Err(ReadError::Content { file: file.to_owned(), reason });
        }
        let (points, _) = points.as_chunks();
        let corners = points.iter().map(|point: &[f32; 3]| point.map(Coordinate::Single));
        let corners: Vec<u32> = corners.map(|point| mesh.vertex(point)).collect();
        mesh.face(number, &corners);
    }
    Ok(())
}

/// Reads a text file. Returns whether the end of its last solid is missing.
fn read_text(file: &str, bytes: &[u8], mesh: &mut Mesh) -> Result<bool, ReadError> {
    let text = String::from_utf8_lossy(bytes);
    let (mut corners, mut number) = (Vec::new(), 0);
    let (mut is_in_facet, mut is_in_solid) = (false, false);
    for (index, line) in text.lines().enumerate() {
        let refused = |reason: &str| {
            let text = line.chars().take(Origin::MOST_SHOWN + 1).collect();
            let origin = Origin { file: file.to_owned(), line: index + 1, text };
            Err(ReadError::Line { origin, reason: reason.to_owned() })
        };
        let mut words = words(line);
        let Some(word) = words.next() else { continue };
        match word.to_ascii_lowercase().as_str() {
            "vertex" => match point(words) {
                Some(point) => corners.push(mesh.vertex(point)),
                None => return refused("a vertex has three finite numbers"),
            },
            "endloop" | "endfacet" => {
                if !corners.is_empty() {
                    number += 1;
                    mesh.face(number, &corners);
                    corners.clear();
                }
                is_in_facet &= word.eq_ignore_ascii_case("endloop");
            }
            "facet" => is_in_facet = true,
            "solid" => is_in_solid = true,
            "endsolid" => is_in_solid = false,
            "outer" => {}
            _ => return refused("this is no line of an STL file"),
        }
    }
    if is_in_facet || !corners.is_empty() {
        let reason = "the file ends within a face: is it complete?".to_owned();
        return Err(ReadError::Content { file: file.to_owned(), reason });
    }
    Ok(is_in_solid)
}

/// The point that the words of a line tell.
fn point<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Point> {
    let mut number = || {
        let number: f64 = words.next()?.parse().ok()?;
        number.is_finite().then_some(Coordinate::Double(number))
    };
    let point = [number()?, number()?, number()?];
    words.next().is_none().then_some(point)
}

#[cfg(test)]
mod tests {
    use crate::tests::{notes, sent};

    /// A tetrahedron as text, in two solids.
    const TEXT: &str = "solid one part\n facet normal 0 0 -1\n  outer loop\n   vertex 0 0 0\n   \
                        vertex 0 1.5 0\n   vertex 1 0 0\n  endloop\n endfacet\nendsolid one part\n\
                        solid two\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1e0 0 0\n\
                        vertex 0 0 1\nendloop\nendfacet\nendsolid\n";

    #[test]
    fn comments_mean_nothing() {
        let text = TEXT.replace('\n', " # a comment\n  # another\n");
        let commented = format!("# first of all\n\n{text}");
        assert_eq!(sent("a.stl", commented.as_bytes()), sent("a.stl", TEXT.as_bytes()));
        assert_eq!(sent("a", commented.as_bytes()), sent("a.stl", TEXT.as_bytes()));
        assert!(sent("a.stl", TEXT.as_bytes()).is_ok());
    }

    fn binary(head: &str, faces: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = format!("{head:80}").into_bytes();
        bytes.extend((faces.len() as u32).to_le_bytes());
        for face in faces {
            bytes.extend([0; 12]);
            bytes.extend(face.as_flattened().iter().flat_map(|number| number.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn all_solids_of_a_text_are_read_and_equal_points_joined() {
        let expected =
            ["v 0 0 0", "v 0 1.5 0", "v 1 0 0", "v 0 0 1", "f 1 2 3", "f 1 3 4"].map(str::to_owned);
        assert_eq!(sent("a.stl", TEXT.as_bytes()), Ok(expected.to_vec()));
        assert_eq!(sent("a", TEXT.as_bytes()), Ok(expected.to_vec()), "known by its beginning");
    }

    #[test]
    fn the_words_of_a_text_may_be_in_capitals() {
        let capitals = TEXT.to_uppercase();
        for name in ["a.stl", "a"] {
            assert_eq!(sent(name, capitals.as_bytes()), sent("a.stl", TEXT.as_bytes()), "{name}");
        }
        assert!(sent("a.stl", TEXT.as_bytes()).is_ok());
    }

    #[test]
    fn a_binary_file_may_begin_as_a_text_does() {
        let face = [[0.1, 0.0, -0.0], [1.0, 2.5, 0.0], [0.0, 0.0, 1e-7]];
        let expected = ["v 0.1 0 0", "v 1 2.5 0", "v 0 0 0.0000001", "f 1 2 3"].map(str::to_owned);
        for head in ["made by a program", "solid made by another"] {
            assert_eq!(sent("a.stl", &binary(head, &[face])), Ok(expected.to_vec()), "{head}");
        }
    }

    #[test]
    fn what_follows_the_faces_of_a_binary_file_is_told() {
        let mut bytes = binary("solid a", &[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
        assert_eq!(notes("a.stl", &bytes), [""; 0]);
        bytes.extend([0; 7]);
        assert_eq!(notes("a.stl", &bytes), ["7 bytes behind the last face are not read"]);
    }

    #[test]
    fn a_text_without_its_end_is_told() {
        let end = TEXT.rfind("endsolid").expect("an end");
        let told = ["the last solid has no end (endsolid): is the file complete?"];
        assert_eq!(notes("a.stl", &TEXT.as_bytes()[..end]), told);
        assert_eq!(notes("a.stl", TEXT.as_bytes()), [""; 0]);
    }

    #[test]
    fn a_face_without_three_corners_is_counted() {
        let (a, b, c) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let bytes = binary("", &[[a, b, c], [a, a, b], [a, b, a]]);
        let said = notes("a.stl", &bytes);
        assert_eq!(said, ["2 faces are not drawn, for want of three different corners"]);
    }

    #[test]
    fn damaged_files_are_refused_with_the_place() {
        let short = binary("", &[[[0.0; 3], [1.0; 3], [2.0; 3]]]);
        let solid = binary("solid of a program", &[[[0.0; 3], [1.0; 3], [2.0; 3]]; 2]);
        for (bytes, reason) in [
            (&short[..short.len() - 1], "a.stl: the file ends after 0 of 1 faces: copy or"),
            (&solid[..solid.len() - 60], "a.stl: the file ends after 0 of 2 faces"),
            (&[200; 300], "a.stl: this is no STL file"),
            (b"nothing", "a.stl: this is no STL file"),
            (&binary("", &[[[f32::NAN; 3], [1.0; 3], [2.0; 3]]]), "face 1 is no finite number"),
            (&binary("", &[]), "a.stl: there is no face to draw"),
            (b"solid\nfacet normal 0 0 1\nouter loop\nvertex 1 2\n", "a.stl:4: a vertex has three"),
            (b"solid\nfacet\nvertex 1 2 inf\n", "a.stl:3: a vertex has three finite numbers"),
            (b"solid\nvertex 1 2 3\n", "a.stl: the file ends within a face"),
            (b"solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nfacet\n",
                "a.stl: the file ends within a face"),
            (b"solid\nbanana\n", "a.stl:2: this is no line of an STL file"),
        ] {
            let error = sent("a.stl", bytes).expect_err("refused");
            assert!(error.contains(reason), "{error}");
        }
    }
}
