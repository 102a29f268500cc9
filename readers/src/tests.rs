//! Tests of how the format of a file is found.

use super::*;

/// Reads a file with this name and content; returns the number of its lines, or the message.
fn read(name: &str, content: &[u8]) -> Result<usize, String> {
    let file = SourceFile::new(name.to_owned(), content.to_vec());
    file.map(|file| file.count()).map_err(|error| error.to_string())
}

/// The lines that a file with this name and content sends, or the message.
pub(crate) fn sent(name: &str, content: &[u8]) -> Result<Vec<String>, String> {
    let file = SourceFile::new(name.to_owned(), content.to_vec());
    let file = file.map_err(|error| error.to_string())?;
    let lines: Vec<String> = file.in_order().map(|line| line.sent).collect();
    let single = (0..file.count()).map_while(|index| file.line(index)).map(|line| line.sent);
    assert!(single.eq(lines.iter().cloned()));
    Ok(lines)
}

/// What the user is told of a file that can be drawn.
pub(crate) fn notes(name: &str, content: &[u8]) -> Vec<String> {
    let file = SourceFile::new(name.to_owned(), content.to_vec());
    file.expect("a file that can be drawn").notes().to_vec()
}

const UNKNOWN: &str = "penup reads Wavefront OBJ files, whose names end in .obj; SVG files, \
                       whose names end in .svg or .svgz; ";

#[test]
fn the_extension_decides_in_capitals_as_well() {
    assert_eq!(read("a.obj", b"#"), Ok(0));
    assert_eq!(read("A.OBJ", b"# v\nv 0 0 0"), Ok(1));
    let error = read("a.obj", b"#\n\0\0\0").expect_err("no text");
    assert!(error.starts_with("a.obj:2: "), "{error}");
}

#[test]
fn files_of_other_programs_are_named_whatever_they_are_called() {
    let page: &[u8] = b"\n<!DOCTYPE HTML>\n<title>404</title>";
    let contents: [(&[u8], &str); 8] = [
        (b"%PDF-1.4\n%\xE2\xE3", "this is a PDF document, which penup does not read: open it in"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "this is an image of pixels"),
        (b"PK\x03\x04", "this is a ZIP archive or 3MF"),
        (b"AC1032\0\0", "this is a DWG drawing, which penup does not read: save it as DXF"),
        (b"ISO-10303-21;\nHEADER;", "this is a STEP model"),
        (b"version https://git-lfs.github.com/spec/v1\n", "this is a pointer of Git LFS"),
        (page, "this is a web page"),
        (b"", "the file is empty"),
    ];
    for (content, reason) in contents {
        for name in ["a.svg", "a.stl", "a.obj"] {
            let error = read(name, content).expect_err("refused");
            assert!(error.starts_with(&format!("{name}: {reason}")), "{error}");
        }
    }
}

#[cfg(all(feature = "dxf", feature = "gcode", feature = "hpgl", feature = "svg"))]
#[test]
fn a_file_under_the_name_of_another_format_is_told_its_own() {
    let svg: &[u8] = b"<svg xmlns=\"http://www.w3.org/2000/svg\"><path d=\"M0 0L9 9\"/></svg>";
    let dxf = b"  0\nSECTION\n  2\nENTITIES\n  0\nENDSEC\n  0\nEOF\n";
    for (name, content, format) in [
        ("a.stl", svg, "an SVG file: give it a name that ends in .svg (this is no STL file)"),
        ("a.dxf", svg, "an SVG file: give it a name that ends in .svg (there should be a code"),
        ("a.plt", svg, "an SVG file: give it a name that ends in .svg ("),
        ("a.obj", svg, "an SVG file: give it a name that ends in .svg (penup reads"),
        ("a.svg", dxf, "a DXF file: give it a name that ends in .dxf (this is not a well-formed"),
        ("a.gcode", dxf, "a DXF file: give it a name that ends in .dxf (\"0\" is no word"),
        ("a.gcode", b"IN;SP1;PU0,0;PD9,9;", "an HP-GL file: give it a name that ends in .hpgl"),
        ("a.dxf", b"G21\nG0 X1\nM3\nG1 X2 F9\n", "a G-code file: give it a name that ends in"),
        ("a.stl", b"v 0 0 0\nv 1 0 0\nl 1 2\n", "a Wavefront OBJ file: give it a name that"),
    ] {
        let error = read(name, content).expect_err("refused");
        assert!(error.contains(&format!("the content is that of {format}")), "{name}: {error}");
    }
    // Where the name is right, nothing is said of other formats.
    let error = read("a.svg", b"<svg><path").expect_err("refused");
    assert!(!error.contains("content"), "{error}");
}

/// Random bytes are not shown to the user as if they were a line.
#[test]
fn bytes_that_are_no_text_are_refused_as_such() {
    let mut state = 1_u32;
    let noise: Vec<u8> = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    })
    .take(5000)
    .collect();
    for (name, format) in [
        ("a.obj", "Wavefront OBJ"),
        ("a.gcode", "G-code"),
        ("a.hpgl", "HP-GL"),
        ("a.dxf", "DXF"),
        ("a.svg", "SVG"),
    ] {
        let said = format!(
            "{name}:1: this is no text, and {format} is: is it another file under this name?"
        );
        assert_eq!(read(name, &noise), Err(said));
    }
}

#[test]
fn the_content_decides_where_the_extension_does_not() {
    assert_eq!(read("cube", b"# a cube\nmtllib c.mtl\nv 0 0 0\nv 1 0 0\nl 1 2\n"), Ok(3));
    assert_eq!(read("point", b"v 0 0 0"), Ok(1));
    let long = [b"v 0 0 0 # long\n".repeat(100_000), b"v 1 2 3".to_vec()].concat();
    assert_eq!(read("long.txt", &long), Ok(100_001));
}

#[test]
fn a_file_of_no_known_format_is_refused_with_those_that_are_read() {
    let contents: [&[u8]; 4] = [b"", b"Dear Ada,\n", b"\x1a\n\0", b"l 1 2\n"];
    for content in contents {
        for name in ["a.zip", "a"] {
            let error = read(name, content).expect_err("no known format");
            assert!(error.starts_with(&format!("{name}: {UNKNOWN}")), "{error}");
        }
    }
}

#[test]
fn every_format_has_extensions_in_lower_case() {
    for format in FORMATS {
        assert!(!format.extensions().is_empty(), "{format:?}");
        for extension in format.extensions() {
            assert_eq!(*extension, extension.to_lowercase(), "{format:?}");
            assert!(!extension.starts_with('.'), "{format:?}");
        }
    }
}

/// So the name of a file can choose any reader, whatever the content is.
#[test]
fn every_format_has_an_extension_of_its_own() {
    for extensions in extensions_of_formats() {
        let first = extensions.first().expect("an extension");
        assert_eq!(crate::extensions().filter(|other| other == first).count(), 1, "{first}");
    }
}
