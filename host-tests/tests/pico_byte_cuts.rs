//! Tests what the emulated Raspberry Pi Pico keeps when its power goes before any byte that it
//! writes to its flash. `cargo xtask power-soak --bytes` does it for every byte.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_host_tests::pico_byte_cuts::{
    ComputedAgain, Effort, KeptJob, Missing, OldOrNew, RecordedPico, SentDrawing, Tally,
    UploadedModel,
};
use penup_host_tests::pico_cuts::Job;
use penup_host_tests::random::Random;
use penup_host_tests::streamed_drawing::StreamedDrawing;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::thread;
use std::time::Instant;

type TestResult = Result<(), Box<dyn Error>>;

/// A pen that takes little time, and a page on which a job does.
const QUICK: [&str; 4] = ["$212=30", "$213=30", "$page=12x12", "$margin=2"];

/// Some lines of a drawing, each a stroke of its own.
fn strokes(ends: &[[i32; 4]]) -> Vec<String> {
    let vertices = ends.iter().map(|[a, b, c, d]| format!("v {a} {b} 0\nv {c} {d} 0"));
    let lines = (0..ends.len()).map(|at| format!("l {} {}", 2 * at + 1, 2 * at + 2));
    let lines: Vec<String> = vertices.chain(lines).collect();
    let all = QUICK.into_iter().chain(["$plot"]).map(str::to_owned);
    lines.iter().flat_map(|line| line.lines()).map(str::to_owned).chain(all).collect()
}

/// Every byte, divided between so many boards.
fn every_byte(board: u32, boards: u32) -> Effort {
    Effort {
        share: [board, boards],
        bytes: wish("PENUP_STEP", 1) as u32,
        instants: 1000,
        scattered: 5,
        completes_each: true,
        complete: 50,
    }
}

/// The record of settings.
fn cut_settings(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    // Both slots are in use.
    board.order(["$131=300", "$131=301"])?;
    board.record(|board| board.order(["$130=123"]))?;
    let mut settings = OldOrNew { list: ["$$"], values: ["$130=420.000", "$130=123.000"] };
    board.try_all(&mut settings, effort, random)?;
    board.try_instants_of_writes(&mut settings, effort, random)
}

/// The record of parameters.
fn cut_parameters(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    board.order(["G10 L2 P2 X1 Y2", "G10 L2 P1 X3 Y4"])?;
    board.record(|board| board.order(["G10 L2 P1 X5 Y6"]))?;
    let mut parameters = OldOrNew { list: ["$#"], values: ["[G54:3.000", "[G54:5.000"] };
    board.try_all(&mut parameters, effort, random)?;
    board.try_instants_of_writes(&mut parameters, effort, random)
}

/// Draws the old job and records the new one.
fn record_job(board: &mut RecordedPico, job: &KeptJob) -> TestResult {
    // Both slots are in use, and so is the log that the new job takes.
    for _ in 0..2 {
        board.restart()?;
        board.order(job.old.lines.iter().map(String::as_str))?;
        board.finish()?;
    }
    board.restart()?;
    let (plot, lines) = job.new.lines.split_last().ok_or("a job")?;
    board.order(["$clear"].into_iter().chain(lines.iter().map(String::as_str)))?;
    board.record(|board| board.order([plot.as_str()]))
}

/// A job of strokes: its slot, the front of its log, and its progress.
fn cut_job(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    let old = Job::new(strokes(&[[0, 0, 4, 0], [0, 2, 4, 2]]));
    let new = Job::new(strokes(&[[0, 0, 2, 3], [1, 0, 3, 3], [2, 0, 4, 3], [3, 0, 5, 3]]));
    let mut job = KeptJob { old, new };
    record_job(board, &job)?;
    board.try_all(&mut job, effort, random)?;
    board.try_instants(&mut job, effort, random)
}

/// A job of one stroke, which goes on within it.
fn cut_points(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    let old = Job::new(strokes(&[[0, 0, 4, 0], [0, 2, 4, 2]]));
    let zigzag = (0..12).map(|at| format!("v {} {} 0", at % 2 * 12, at));
    let chords = (1..12).map(|from| format!("l {from} {}", from + 1));
    let settings = ["$212=30", "$213=30", "$219=0.02", "$page=20x20", "$margin=2", "$plot"];
    let lines = zigzag.chain(chords).chain(settings.map(str::to_owned)).collect();
    let mut job = KeptJob { old, new: Job::new(lines) };
    record_job(board, &job)?;
    board.try_all(&mut job, effort, random)?;
    board.try_instants(&mut job, effort, random)
}

/// A drawing of these lines, which is sent while it is drawn.
fn sent(ends: &[[i32; 4]]) -> SentDrawing {
    let lines = strokes(ends);
    let drawing = StreamedDrawing::of(&lines);
    SentDrawing { whole: Job::new(lines).whole, drawing }
}

/// Draws a drawing that is sent, so often that both slots of jobs and both logs are in use.
fn draw_sent(board: &mut RecordedPico) -> TestResult {
    let mut old = sent(&[[0, 0, 4, 0], [0, 2, 4, 2]]);
    board.order(old.drawing.settings.iter().map(String::as_str))?;
    for _ in 0..2 {
        board.order(old.lines(0).iter().map(String::as_str))?;
        board.finish()?;
    }
    board.restart()
}

/// A drawing that is sent while it is drawn, over another one that was.
fn cut_streamed(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    draw_sent(board)?;
    let mut new = sent(&[[0, 0, 2, 3], [1, 0, 3, 3], [2, 0, 4, 3], [3, 0, 5, 3]]);
    let lines = new.lines(0);
    board.record(|board| board.order(lines.iter().map(String::as_str)))?;
    board.try_all(&mut new, effort, random)?;
    board.try_instants(&mut new, effort, random)
}

/// A model that is larger than the memory, over another one.
fn cut_model(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    let vertices = [PICO.memory.vertices + 4, PICO.memory.vertices + 9];
    let options = QUICK.map(str::to_owned).to_vec();
    let models = vertices.map(|count| {
        let corners = ["v 0 0 0", "v 6 0 0", "v 3 5 0"].map(str::to_owned);
        let others = (3..count).map(|number| format!("v {} 0 0", number % 7));
        let face = [String::from("f 1 2 3")];
        corners.into_iter().chain(others).chain(face).collect::<Vec<String>>()
    });
    let jobs = models.each_ref().map(|model| {
        let lines = model.iter().chain(&options).cloned();
        Job::new(lines.chain([String::from("$plot")]).collect())
    });
    let mut scenario = UploadedModel { vertices, options, jobs };
    let draw = |board: &mut RecordedPico, model: &[String]| {
        board.order(["$clear"])?;
        board.order_many(model)?;
        board.order(scenario.options.iter().map(String::as_str))?;
        board.order(["$plot"])
    };
    draw(board, &models[0])?;
    board.finish()?;
    board.restart()?;
    board.record(|board| draw(board, &models[1]))?;
    board.try_all(&mut scenario, effort, random)?;
    board.try_instants_of_writes(&mut scenario, effort, random)
}

/// A job over a drawing that was sent: strokes that the pen begins to draw while their order is
/// computed. There are as few as it takes for that, and some closed ones, which an estimate leaves
/// out.
fn early_ink() -> Vec<String> {
    const STROKES: i32 = 140;
    const CLOSED: i32 = 3;
    let ends = (0..STROKES).flat_map(|at| {
        let [x, y] = [at / 12, at % 12].map(|place| f64::from(place) * 0.7);
        let rise = f64::from(at * 7 % 5) * 0.1;
        [format!("v {x:.1} {y:.1} 0"), format!("v {:.1} {:.1} 0", x + 0.4, y + rise)]
    });
    let corners = (0..CLOSED).flat_map(|at| {
        let y = f64::from(at) * 0.7;
        [format!("v 9 {y:.1} 0"), format!("v 9.5 {y:.1} 0"), format!("v 9.5 {:.1} 0", y + 0.5)]
    });
    let lines = (0..STROKES).map(|at| format!("l {} {}", 2 * at + 1, 2 * at + 2));
    let triangles = (0..CLOSED).map(|at| {
        let first = 2 * STROKES + 3 * at + 1;
        format!("l {first} {} {} {first}", first + 1, first + 2)
    });
    let quick = ["$120=4000", "$121=4000", "$page=14x14", "$plot"];
    let quick = QUICK.into_iter().chain(quick).map(str::to_owned);
    ends.chain(corners).chain(lines).chain(triangles).chain(quick).collect()
}

/// A job that is kept without its order, which is added behind the strokes while the pen draws.
fn cut_early_ink(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    draw_sent(board)?;
    let mut job = ComputedAgain { job: Job::new(early_ink()), missing: Missing::Order };
    let (plot, lines) = job.job.lines.split_last().ok_or("a job")?;
    board.order(lines.iter().map(String::as_str))?;
    board.record(|board| board.order([plot.as_str()]))?;
    // To complete it takes longer than the other jobs.
    let effort = Effort { complete: 4 * effort.complete, ..effort };
    board.try_all(&mut job, effort, random)?;
    board.try_instants(&mut job, effort, random)
}

/// A drawing in two parts, the second of which is its title, of a model in flash.
fn cut_parts(board: &mut RecordedPico, effort: Effort, random: &mut Random) -> TestResult {
    const TITLE: [&str; 4] = ["$page=14x20", "$title-size=2", "$title=Il", "$plot"];
    draw_sent(board)?;
    let corners = ["v 0 0 0", "v 6 0 0", "v 3 5 0", "v 8 1 0", "v 9 5 0", "v 10 1 0"];
    let others = (corners.len()..PICO.memory.vertices + 4).map(|at| format!("v {} 0 0", at % 7));
    let faces = ["f 1 2 3", "f 4 5 6"].into_iter().chain(QUICK).chain(TITLE);
    let lines = corners.into_iter().map(str::to_owned).chain(others);
    let lines = lines.chain(faces.map(str::to_owned)).collect();
    let mut job = ComputedAgain { job: Job::new(lines), missing: Missing::Strokes };
    let (plot, lines) = job.job.lines.split_last().ok_or("a job")?;
    board.order_many(lines)?;
    // The model is complete before the record.
    board.ask("$model")?;
    board.record(|board| board.order([plot.as_str()]))?;
    board.try_all(&mut job, effort, random)?;
    board.try_instants(&mut job, effort, random)
}

type Portion = fn(&mut RecordedPico, Effort, &mut Random) -> TestResult;

const PORTIONS: [(&str, Portion); 8] = [
    ("settings", cut_settings),
    ("parameters", cut_parameters),
    ("job", cut_job),
    ("points", cut_points),
    ("streamed", cut_streamed),
    ("model", cut_model),
    ("early", cut_early_ink),
    ("parts", cut_parts),
];

/// Tries a few cuts of a portion, in each of its operations, and completes some.
fn try_few(portion: Portion) -> TestResult {
    let few = Effort {
        bytes: 1000,
        instants: 1,
        scattered: 0,
        completes_each: false,
        complete: 4,
        share: [0, 1],
    };
    let mut board = RecordedPico::start()?;
    portion(&mut board, few, &mut Random::new(2211))?;
    eprintln!("{:?}", board.tally);
    assert!(board.tally.completed > 0, "{:?}", board.tally);
    Ok(())
}

#[test]
fn a_few_cuts_of_a_job_leave_the_old_one_or_the_new_one() -> TestResult {
    try_few(cut_job)
}

#[test]
fn a_few_cuts_of_a_drawing_in_parts_leave_the_old_job_or_the_new_one() -> TestResult {
    try_few(cut_parts)
}

/// One of several boards, which try the cuts of a portion between them. Returns what it did.
fn share_of(portion: Portion, seed: u64, board: u32, boards: u32) -> Result<Tally, String> {
    let tried = || {
        let mut pico = RecordedPico::start()?;
        portion(&mut pico, every_byte(board, boards), &mut Random::new(seed))?;
        Ok(pico.tally)
    };
    tried().map_err(|error: Box<dyn Error>| error.to_string())
}

/// Prints how many cuts there were of each kind. Each core of the computer emulates a board.
#[test]
#[ignore = "`cargo xtask power-soak --bytes` runs it for three quarters of an hour or more"]
fn before_every_byte() -> TestResult {
    let seed = wish("PENUP_SEED", 1);
    let only = std::env::var("PENUP_PORTION").ok();
    let wanted = |(name, _): &(&str, Portion)| only.as_deref().is_none_or(|only| only == *name);
    assert!(PORTIONS.iter().any(wanted), "there is no portion {only:?}");
    let boards = thread::available_parallelism().map_or(1, |cores| cores.get() as u32);
    for (name, portion) in PORTIONS.into_iter().filter(wanted) {
        println!("{name}: begins, on {boards} boards");
        let begun = Instant::now();
        let mut tally = Tally::default();
        thread::scope(|scope| {
            let share = |board| scope.spawn(move || share_of(portion, seed, board, boards));
            let shares: Vec<_> = (0..boards).map(share).collect();
            shares.into_iter().try_for_each(|share| {
                let share = share.join().map_err(|_| "a board has failed".to_owned())?;
                tally.add(&share.map_err(|error| format!("seed {seed}: {name}: {error}"))?);
                Ok::<(), String>(())
            })
        })?;
        let took = begun.elapsed();
        println!("{name}: {} cuts in {took:?}: {tally:?}", tally.all());
    }
    Ok(())
}
