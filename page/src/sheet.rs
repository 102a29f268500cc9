//! What a camera sees of a model, drawn on the sheet by the plotter's own code.

use crate::number::Number;
use crate::options::{NamedValues, text_of};
use crate::source::Source;
use crate::words::{for_page, refusal, sentence};
use penup::boards::host::HostBoard;
use penup::drawing::{LineType, PagePoint};
use penup::index::Index as _;
use penup::machine::{EventRing, PulserState, Setting};
use penup::plotter::Plotter;
use penup::protocol::CommandError;
use penup::stage::NeverCancel;
use penup::step::Pattern;
use penup::view::Pose;
use penup_job::Job;
use penup_job::Settings;
use penup_job::notes;
use penup_job::protocol::{Reply, ReplyReader};
use penup_job::room::Room;
use penup_readers::lines::{JobLine, Lines};
use serde::Serialize;
use std::fmt;
use std::rc::Rc;
use wasm_bindgen::prelude::wasm_bindgen;

/// A plotter that draws nothing but pictures.
#[wasm_bindgen]
pub struct Sheet {
    board: HostBoard<'static>,
    plotter: Plotter<'static, Number>,
    /// The room that the plotter has.
    room: Room,
    source: Source,
    /// Width and height of the page in mm.
    page: [f64; 2],
    /// What the user should know, in sentences.
    said: Vec<String>,
}

impl fmt::Debug for Sheet {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Sheet")
            .field("lines", &self.source.lines.count())
            .finish_non_exhaustive()
    }
}

/// What there is to see.
#[derive(Serialize)]
struct Scene {
    vertices: usize,
    faces: usize,
    bars: usize,
    curves: usize,
    /// Whether the drawing is flat, in millimetres, and is laid on the page as it is.
    is_plan: bool,
    /// The least and the greatest coordinates.
    bounds: Option<[[f64; 3]; 2]>,
    /// What the user should know about the file.
    notes: Vec<String>,
    /// The room that a plotter needs for it, for [`Board`](crate::Board).
    room: Room,
}

/// Where the camera stands.
#[derive(Serialize)]
struct CameraPose {
    eye: [f64; 3],
    at: [f64; 3],
    up: Option<[f64; 3]>,
}

#[wasm_bindgen]
impl Sheet {
    /// A sheet with nothing on it.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        crate::note_faults();
        let source = Source::default();
        let room = Room::for_job(&*source.lines);
        let (board, plotter) = started(room);
        Self { board, plotter, room, source, page: [0.0; 2], said: Vec::new() }
    }

    /// Reads the file `name` and keeps its model. If it `is_read`, the `bytes` are what
    /// `penup-page-files` made of it. Returns what there is to see, as JSON.
    ///
    /// # Errors
    /// A sentence for the user; the sheet is then empty.
    pub fn open(
        &mut self,
        name: &str,
        bytes: Vec<u8>,
        is_read: bool,
        options: &str,
    ) -> Result<String, String> {
        self.source = Source::default();
        self.take(&JobLine::command("$clear"))?;
        let source = Source::read(name, bytes, is_read)?;
        let room = Room::for_job(&*source.lines);
        if !room.fits(self.room) {
            (self.board, self.plotter) = started(room);
            self.room = room;
        }
        self.source = source;
        self.set(options)?;
        let model = self.plotter.model();
        let bounds = model.bounds().map(|(low, high)| {
            let unit = (0.5f64).powi(model.fraction_bits() as i32);
            [low, high].map(|it| [it.x, it.y, it.z].map(|c| f64::from(c) * unit))
        });
        Ok(text_of(&Scene {
            vertices: model.vertices().len(),
            faces: model.face_count(),
            bars: model.bar_count(),
            curves: model.curve_count(),
            is_plan: model.is_plan(),
            bounds,
            notes: self.said.clone(),
            room,
        }))
    }

    /// What the user should know about the file with these options, as JSON: sentences.
    pub fn notes(&self) -> String {
        text_of(&self.said)
    }

    /// Sets the options, given as a JSON array of pairs of name and value, and all others to their
    /// defaults. The lines of the file are sent again, because pens depend on an option.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn set(&mut self, options: &str) -> Result<(), String> {
        let settings = self.settings(options)?;
        let job = Job::new(Shared(Rc::clone(&self.source.lines)), &settings);
        for line in job.in_order() {
            self.take(&line)?;
        }
        Ok(())
    }

    /// Width and height of the page in mm.
    pub fn page(&self) -> Vec<f64> {
        self.page.to_vec()
    }

    /// Sets options without reading the file again: a JSON array of pairs of name and value.
    ///
    /// # Errors
    /// A sentence for the user; the options before it are set.
    pub fn turn(&mut self, options: &str) -> Result<(), String> {
        let settings = self.settings(options)?;
        self.take(&JobLine::command("$view=auto"))?;
        for (name, value) in &settings.values {
            if *name != "pens" {
                self.take(&JobLine::command(format!("${name}={value}")))?;
            }
        }
        Ok(())
    }

    /// Draws: five numbers for each line, which are x and y of both ends in mm from the lower left
    /// corner of the page, and the pen, from 1.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn draw(&mut self) -> Result<Vec<f32>, String> {
        let settings = self.plotter.machine().settings();
        let steps = settings.page_steps().map(|steps| steps.to_num::<f64>());
        let dot = settings.get(Setting::DotLength).to_num::<f64>();
        let drawing = self.plotter.draw(&mut NeverCancel).map_err(|error| refused(&error))?;
        let mut lines = Vec::with_capacity(5 * drawing.segments.len());
        let point = |number: Number| drawing.points.get(number.get()).copied();
        for segment in drawing.segments {
            let (Some(from), Some(to)) = (point(segment.from()), point(segment.to())) else {
                continue;
            };
            let mm =
                |PagePoint { x, y }: PagePoint| [f64::from(x) / steps[0], f64::from(y) / steps[1]];
            let ends = [mm(from), mm(to)];
            inked(segment.line_type(), ends, dot, |[x1, y1], [x2, y2]| {
                lines.extend([x1, y1, x2, y2].map(|c| c as f32));
                lines.push(f32::from(segment.pen()) + 1.0);
            });
        }
        Ok(lines)
    }

    /// The camera that the options choose, as JSON, or `null` if it has no point that it looks at.
    pub fn camera(&self) -> String {
        let camera = self.plotter.options().camera(self.plotter.model());
        text_of(&camera.and_then(|camera| match camera.pose {
            Pose::Towards { eye, at, up } => Some(CameraPose { eye, at, up }),
            Pose::Turned { .. } => None,
        }))
    }
}

impl Sheet {
    /// The settings that `options` choose for the file that is open.
    fn settings(&mut self, options: &str) -> Result<Settings, String> {
        let options = NamedValues::parse(options)?;
        let settings = options.settings_for(&self.source)?;
        let not_shown = options.not_shown()?;
        self.page = [settings.page.width, settings.page.height];
        let plan = self.source.bounds.map(|bounds| notes::of_plan(&settings, bounds));
        let idle = notes::idle_options(&settings, self.source.bounds.is_some());
        let known = notes::followed(&settings);
        let of_file = self.source.notes.iter().filter(|note| !known.contains(&note.as_str()));
        let all = of_file.cloned().chain(plan.into_iter().flatten()).chain(idle);
        let all = all.map(|note| format!("{}.", sentence(&for_page(&note))));
        self.said = all.chain(not_shown).collect();
        Ok(settings)
    }

    fn take(&mut self, line: &JobLine) -> Result<(), String> {
        self.board.receive(line.sent.as_bytes());
        self.board.receive(b"\n");
        while self.plotter.poll(&mut self.board) || !self.board.has_read_all() {}
        let sent = self.board.take_sent();
        if sent.ends_with(b"ok\r\n") {
            return Ok(());
        }
        let mut reader = ReplyReader::default();
        let mut messages = Vec::new();
        for reply in sent.into_iter().filter_map(|byte| reader.push(byte)) {
            match reply {
                Reply::Message(text) => messages.push(text),
                Reply::Error(number) => return Err(refusal(Some(line), number, &messages)),
                _ => {}
            }
        }
        Ok(())
    }
}

/// A plotter with this room, and its board.
fn started(room: Room) -> (HostBoard<'static>, Plotter<'static, Number>) {
    // The memory is leaked because the plotter and the board borrow from it. A worker makes one
    // sheet and keeps it; only a larger model takes more.
    let ring = Box::leak(Box::new(EventRing::new()));
    let pins = Box::leak(Box::new(PulserState::new()));
    (HostBoard::new(ring, pins), Plotter::new(room.lend(), pins).without_undo())
}

impl Default for Sheet {
    fn default() -> Self {
        Self::new()
    }
}

fn refused(error: &CommandError) -> String {
    refusal(None, error.number(), &[error.to_string()])
}

/// Hands on the parts of a line between `ends` that are inked; a dot is `dot` mm long.
fn inked(
    line_type: LineType,
    ends: [[f64; 2]; 2],
    dot: f64,
    mut ink: impl FnMut([f64; 2], [f64; 2]),
) {
    let [[x1, y1], [x2, y2]] = ends;
    /// The number of units in a mm.
    const UNITS: f64 = 1024.0;
    let moves = (x2 - x1).hypot(y2 - y1) * UNITS;
    let pattern = Pattern::of(line_type, moves as u32, (dot * UNITS) as u32);
    let at = |part: f64| [x1 + (x2 - x1) * part, y1 + (y2 - y1) * part];
    let end_of = |piece: u32| {
        let last = piece + 1 == pattern.pieces();
        if last { 1.0 } else { f64::from(pattern.end_of(piece)) / moves }
    };
    let mut from = 0.0;
    for piece in 0..pattern.pieces() {
        let to = end_of(piece);
        if Pattern::inked(piece) {
            ink(at(from), at(to));
        }
        from = to;
    }
}

/// Lines that several users share.
#[derive(Debug)]
pub(crate) struct Shared(pub Rc<dyn Lines>);

impl Lines for Shared {
    fn count(&self) -> usize {
        self.0.count()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        self.0.line(index)
    }

    fn in_order(&self) -> Box<dyn Iterator<Item = JobLine> + '_> {
        self.0.in_order()
    }
}
