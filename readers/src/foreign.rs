//! Knows files of other programs by their beginnings, so that the user is told what to do with
//! them.

const AS_SVG: &str = "open it in Inkscape and save it as SVG";
const AS_MESH: &str = "save the model as STL, OBJ or PLY";

/// How files begin that are not read, what they are, and what to do with them.
const KINDS: [(&[u8], &str, &str); 15] = [
    (b"%PDF-", "a PDF document", AS_SVG),
    (b"%!PS", "PostScript", AS_SVG),
    (b"\x89PNG", IMAGE, TRACED),
    (b"\xFF\xD8\xFF", IMAGE, TRACED),
    (b"GIF8", IMAGE, TRACED),
    (b"II*\0", IMAGE, TRACED),
    (b"MM\0*", IMAGE, TRACED),
    (b"PK\x03\x04", "a ZIP archive or 3MF", "unpack it, or save the model as STL, OBJ or PLY"),
    (b"AC10", "a DWG drawing", "save it as DXF"),
    (b"ISO-10303-21", "a STEP model", AS_MESH),
    (b"glTF", "a glTF model", AS_MESH),
    (b"Kaydara FBX", "an FBX model", AS_MESH),
    (b"BLENDER", "a Blender file", AS_MESH),
    (b"version https://git-lfs", "a pointer of Git LFS", "fetch the file itself by git lfs pull"),
    (b"\x7FELF", "a program", "is it another file under this name?"),
];

const IMAGE: &str = "an image of pixels";
const TRACED: &str = "trace it, for example in Inkscape, and save the paths as SVG";

/// Why a file that begins so is not read, as a sentence; `None` if it may be.
pub(super) fn refusal(beginning: &[u8]) -> Option<String> {
    let known = KINDS.iter().find(|(begin, _, _)| beginning.starts_with(begin));
    let (what, advice) = match known {
        Some((_, what, advice)) => (*what, *advice),
        None if is_web_page(beginning) => {
            ("a web page", "download the file itself, on GitHub by Raw")
        }
        None => return None,
    };
    Some(format!("this is {what}, which penup does not read: {advice}"))
}

/// Whether this is the beginning of a web page without a drawing.
fn is_web_page(beginning: &[u8]) -> bool {
    let text = beginning.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(beginning).trim_ascii_start();
    let begins =
        |with: &[u8]| text.get(..with.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(with));
    (begins(b"<!doctype html") || begins(b"<html"))
        && !beginning.windows(4).any(|letters| letters == b"<svg")
}

/// Whether bytes hold control characters as no text does. A file of UTF-16 does not, and escapes
/// and the ends of labels of HP-GL do not count.
pub(super) fn is_binary(beginning: &[u8]) -> bool {
    let is_odd = |byte: &&u8| matches!(byte, 1 | 2 | 4..=7 | 16..=23 | 28..=31);
    beginning.iter().take(4096).filter(is_odd).count() >= 8
}
