//! Replays the inputs that the fuzzers kept, and gives the same targets random ones.
//!
//! `PENUP_INPUTS` sets the number of random inputs for each target; the default is 60. `PENUP_SEED`
//! makes them others.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::machine::SETTINGS;
use penup::plotter::help;
use penup_client::files::parse;
use penup_host_tests::fuzz_targets::TARGETS;
use penup_host_tests::fuzz_targets::files::{check, is_accepted, names};
use penup_host_tests::fuzz_targets::sender::outcome;
use penup_host_tests::fuzz_targets::session::{output, sessions};
use penup_host_tests::fuzz_targets::stored::{KeptJob, interrupted_jobs};
use penup_host_tests::random::Random;
use penup_host_tests::wish::wish;
use penup_readers::Arrangement;
use penup_readers::files::Files;
use std::panic::catch_unwind;
use std::path::PathBuf;

/// The folder of the inputs for a target.
fn folder(target: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target)
}

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = folder(target);
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|file| file.expect("a file").path())
        .collect();
    files.sort();
    files.iter().map(|file| std::fs::read(file).expect("an input")).collect()
}

#[test]
fn the_kept_inputs_break_no_promise() {
    for (name, target) in TARGETS {
        let inputs = corpus(name);
        assert!(!inputs.is_empty(), "there are inputs for {name}");
        for input in inputs {
            target(&input);
        }
    }
}

#[test]
fn damaged_and_joined_inputs_break_no_promise() {
    let mut random = Random::new(wish("PENUP_SEED", 1980));
    for (name, target) in TARGETS {
        let inputs = corpus(name);
        for _ in 0..wish("PENUP_INPUTS", 60) {
            let mut input = inputs[random.below(inputs.len() as u64) as usize].clone();
            let other = &inputs[random.below(inputs.len() as u64) as usize];
            let cut = random.below(input.len() as u64 + 1) as usize;
            input.truncate(cut);
            input.extend(&other[random.below(other.len() as u64 + 1) as usize..]);
            input.truncate(4096);
            for _ in 0..random.below(9) {
                if let Some(last) = input.len().checked_sub(1) {
                    input[random.below(last as u64 + 1) as usize] = random.below(256) as u8;
                }
            }
            target(&input);
        }
    }
}

/// A layout that changes has another mark, and a record with the old one is refused at once: then
/// no input that is kept reaches the code that goes on.
#[test]
fn a_stopped_job_of_each_kind_is_kept_in_its_present_layout() {
    let jobs = interrupted_jobs();
    if std::env::var_os("PENUP_WRITE_INPUTS").is_some() {
        for (name, job) in &jobs {
            let file = folder("stored").join(name);
            std::fs::write(file, job.input()).expect("an input can be written");
        }
    }
    let kept: Vec<KeptJob> =
        corpus("stored").iter().filter_map(|input| KeptJob::from_input(input)).collect();
    for (index, (name, job)) in jobs.iter().enumerate() {
        assert!(jobs[..index].iter().all(|(_, other)| !other.is_like(job)), "{name}: as another");
        let mut alike = kept.iter().filter(|kept| kept.is_like(job));
        assert!(job.clone().goes_on(), "{name}: the target makes another job of it");
        assert!(
            alike.any(|kept| kept.clone().goes_on()),
            "{name}: fuzz/corpus/stored has no such job with the present marks {:?} with which a \
             plotter goes on; write one anew with \
             PENUP_WRITE_INPUTS=1 cargo test -p penup-host-tests --test fuzz_corpus",
            job.marks()
        );
    }
}

/// The fuzzer finds a whole file of a binary format only if it begins with one.
#[test]
fn each_reader_accepts_an_input_of_the_corpus() {
    let inputs = corpus("files");
    for name in names() {
        let is_read = inputs.iter().any(|input| is_accepted(&name, input));
        assert!(is_read, "fuzz/corpus/files has no file that is accepted as {name}");
    }
}

/// An SVG is read on a stack of its own, where the client takes a panic for a file that cannot be
/// read.
#[test]
fn a_reader_that_panics_is_found() {
    let image = br#"<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm">
        <image href="other.svg" width="9" height="9"/></svg>"#;
    let found = || {
        let panics = Files::read_by(|_| panic!("as a reader with a mistake"));
        let arrangement = Arrangement::default().with_files(panics);
        let refused = parse("a.svg".to_owned(), image.to_vec(), &arrangement);
        let refusal = refused.expect_err("a file that cannot be read").to_string();
        assert!(refusal.contains("simplify it"), "{refusal}");
        check("a.svg", image, &arrangement);
    };
    let panic = catch_unwind(found).expect_err("the target takes the panic for a refusal");
    assert_eq!(panic.downcast_ref(), Some(&"as a reader with a mistake"));
}

/// The sessions of the corpus that were written by hand still do what they were written for.
#[test]
fn whole_sessions_are_kept() {
    for (name, session, says) in sessions() {
        let file = folder("session").join(name);
        if std::env::var_os("PENUP_WRITE_INPUTS").is_some() {
            std::fs::write(&file, session).expect("an input can be written");
        }
        let kept = std::fs::read(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        let output = output(&kept);
        assert!(output.contains(says), "{name}: {output}");
        let sets_ends = name.starts_with("settings-");
        assert!(sets_ends || !output.contains("error:"), "{name}: {output}");
    }
}

#[test]
fn each_setting_is_set_to_both_ends_of_its_range() {
    let inputs = corpus("session");
    for info in SETTINGS {
        for end in [info.least, info.greatest] {
            let line = format!("\n${}={end}\n", info.number());
            let has_line =
                |input: &Vec<u8>| input.windows(line.len()).any(|part| part == line.as_bytes());
            assert!(
                inputs.iter().any(has_line),
                "fuzz/corpus/session has no input with {line}: write one by \
                 PENUP_WRITE_INPUTS=1 cargo test -p penup-host-tests --test fuzz_corpus"
            );
        }
    }
}

/// The words in the dictionary of this target, as they stand between quotation marks.
fn dictionary(target: &str) -> Vec<String> {
    let file = folder("../dictionaries").join(format!("{target}.dict"));
    let text = std::fs::read_to_string(&file).expect("a dictionary");
    let words = text.lines().filter(|line| !line.starts_with('#'));
    let between = |word: &str| Some(word.strip_prefix('"')?.strip_suffix('"')?.to_owned());
    words.map(|word| between(word).unwrap_or_else(|| panic!("{target}: {word}"))).collect()
}

#[test]
fn dictionaries_have_all_settings_and_commands() {
    for target in ["session", "edits"] {
        let words = dictionary(target);
        let number = |word: &String| word.strip_prefix('$')?.strip_suffix('=')?.parse::<u16>().ok();
        let found: Vec<u16> = words.iter().filter_map(number).collect();
        let expected: Vec<u16> = SETTINGS.iter().map(|info| info.number()).collect();
        assert_eq!(found, expected, "the settings in {target}.dict are not those of the table");
        help(&mut |usage, _| {
            let usage = usage.to_string();
            let end = usage.find(['=', ' ']).map_or(usage.len(), |at| at + 1);
            let command = usage[..end].trim_end();
            let is_known = words.iter().any(|word| word.starts_with(command));
            assert!(!command.starts_with('$') || is_known, "{target}.dict lacks {command}");
        });
    }
}

/// Otherwise the fuzzer would change conversations that have ended before they have begun.
#[test]
fn each_conversation_with_a_real_plotter_comes_to_its_end() {
    for name in
        ["draws", "streams", "streams-gcode", "rejoins", "watches", "pauses", "resumes", "sets"]
    {
        let file = folder("sender").join(format!("real-{name}"));
        let input = std::fs::read(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        outcome(&input).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    let damaged = std::fs::read(folder("sender").join("real-damaged")).expect("an input");
    outcome(&damaged).expect("a conversation that goes on behind damage");
}
