//! Renders pictures as PNG.

use crate::error::Error;
use resvg::{tiny_skia, usvg};
use std::fmt::Display;

/// The resolution of the PNG in dots per mm (203 dots per inch).
const DOTS_PER_MM: f64 = 8.0;
/// The maximum width and height of the PNG in dots. Larger pages get a lower resolution.
const MOST_DOTS: f64 = 4096.0;

/// Renders an SVG that [`Picture`](penup_job::picture::Picture) wrote as PNG.
///
/// # Errors
/// The SVG cannot be parsed, or the page is too large.
pub fn png(svg: &str) -> Result<Vec<u8>, Error> {
    let broken = |error: &dyn Display| Error::Picture(error.to_string());
    let tree = usvg::Tree::from_str(svg, &usvg::Options::default()).map_err(|e| broken(&e))?;
    let size = tree.size();
    let longest = f64::from(size.width().max(size.height()));
    // usvg assumes 96 dots per inch.
    let scale = (DOTS_PER_MM * 25.4 / 96.0).min(MOST_DOTS / longest) as f32;
    let dots = |length: f32| ((length * scale).round() as u32).max(1);
    let mut pixels = tiny_skia::Pixmap::new(dots(size.width()), dots(size.height()))
        .ok_or_else(|| broken(&"the page is too large"))?;
    let scale = tiny_skia::Transform::from_scale(scale, scale);
    resvg::render(&tree, scale, &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| broken(&e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup_job::picture::Picture;
    use penup_readers::page::Page;

    const PAGE: Page = Page { width: 40.0, height: 30.0 };

    #[test]
    fn an_empty_page_is_a_picture() {
        let png = png(&Picture::of_strokes(PAGE, &[]).svg()).expect("a white page");
        assert_eq!(png.get(..8), Some(b"\x89PNG\r\n\x1a\n".as_slice()));
        // The header contains the width and the height.
        assert_eq!(png.get(16..24), Some([0, 0, 1, 64, 0, 0, 0, 240].as_slice()));
    }

    #[test]
    fn a_png_is_dark_where_the_pen_was_and_white_elsewhere() {
        let strokes = [vec![[0.0, 15.0], [40.0, 15.0]]];
        let bytes = png(&Picture::of_strokes(PAGE, &strokes).svg()).expect("a picture");
        let pixels = tiny_skia::Pixmap::decode_png(&bytes).expect("a PNG");
        let red = |x, y| pixels.pixel(x, y).expect("within the page").red();
        assert!(red(160, 120) < 60, "ink is {}", red(160, 120));
        assert_eq!((red(160, 100), red(160, 140)), (255, 255));
    }
}
