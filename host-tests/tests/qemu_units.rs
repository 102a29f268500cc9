//! Draws files in inches by an emulated board, and measures the ink at its pins.
#![cfg(feature = "emulator")]

use penup::board_table::LM3S6965;
use penup_client::machines::emulate;
use penup_client::plot::draw;
use penup_client::progress::Quiet;
use penup_client::sender::Timeouts;
use penup_readers::SourceFile;
use penup_readers::lines::{JobLine, Lines as _};
use std::error::Error;
use std::sync::atomic::AtomicBool;

const SVG: &str = "<svg xmlns='http://www.w3.org/2000/svg' width='4in' height='3in' \
                   viewBox='0 0 4 3'><path d='M1 1H3V2' fill='none' stroke='#000'/></svg>";
const GCODE: &str = "G20\nG90\nG0 X1 Y1\nG1 X3 F40\nG1 Y2\nG0 X0 Y0\n";
const DXF: &str = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n1\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
                   0\nLWPOLYLINE\n90\n3\n70\n0\n10\n1\n20\n1\n10\n3\n20\n1\n10\n3\n20\n2\n\
                   0\nENDSEC\n0\nEOF\n";
/// The plotter units of HP-GL are 1/40 mm; 4064 of them are 4 inches.
const HPGL: &str = "IN;IP0,0,4064,3048;SC0,4,0,3;SP1;PU1,1;PD3,1,3,2;PU;SP0;";

#[test]
fn an_inch_of_a_file_is_25_4_mm_of_ink() -> Result<(), Box<dyn Error>> {
    let upward = [[25.4, 25.4], [76.2, 25.4], [76.2, 50.8]];
    // SVG counts y downward on a page 76.2 mm high.
    let downward = upward.map(|[x, y]| [x, 76.2 - y]);
    for (name, text, expected) in [
        ("inch.svg", SVG, downward),
        ("inch.gcode", GCODE, upward),
        ("inch.dxf", DXF, upward),
        ("inch.plt", HPGL, upward),
    ] {
        let file = SourceFile::new(name.to_owned(), text.into())?;
        let options = ["$clear", "$view=auto"].map(|option| JobLine::command(option.to_owned()));
        let job: Vec<JobLine> = options.into_iter().chain(file.in_order()).collect();
        let mut board = emulate(&LM3S6965)?;
        draw(board.as_mut(), &job, Timeouts::default(), &AtomicBool::new(false), &mut Quiet)?;
        let runs = board.pen_runs()?;
        let inked: Vec<_> = runs.iter().filter(|run| run.pen_down).collect();
        let [run] = inked.as_slice() else { panic!("{name}: {} strokes", inked.len()) };
        let is_near = |point: &[f64; 2], end: &[f64; 2]| {
            (point[0] - end[0]).hypot(point[1] - end[1]) < 1.0 / 80.0
        };
        // The stroke may be drawn from either end.
        let forth = run.points.iter().zip(&expected).all(|(point, end)| is_near(point, end));
        let back = run.points.iter().rev().zip(&expected).all(|(point, end)| is_near(point, end));
        assert!(run.points.len() == 3 && (forth || back), "{name}: {:?}", run.points);
    }
    Ok(())
}
