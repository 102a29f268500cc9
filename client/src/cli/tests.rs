use super::*;
use clap::CommandFactory;

#[test]
fn the_options_do_not_contradict_each_other() {
    Cli::command().debug_assert();
}

#[test]
fn a_tape_has_steps_that_a_plotter_makes() {
    let steps = |steps: &str| {
        Cli::try_parse_from(["penup", "tape", "show", "f.tape", "--steps", steps])
            .map(drop)
            .map_err(|error| error.to_string())
    };
    for good in ["2", "80", "4000", "88.9"] {
        assert_eq!(steps(good), Ok(()));
    }
    for (bad, reason) in [
        ("0", "2 to 4000 steps"),
        ("-80", "2 to 4000 steps"),
        ("1e300", "2 to 4000 steps"),
        ("nan", "\"nan\" is not a number"),
    ] {
        let error = steps(bad).expect_err("refused");
        assert!(error.contains(reason) && error.contains("--steps <N>"), "{error}");
    }
}

/// What the value of an option would not reach is refused, and the option that it needs is
/// named.
#[test]
fn an_option_that_needs_another_one_is_refused_without_it() {
    let parse = |line: &str| {
        let words = line.split(' ');
        Cli::try_parse_from(words).map(drop).map_err(|error| error.to_string())
    };
    for (line, needed) in [
        ("penup preview f.obj --repeat 3", "--json <FILE>"),
        ("penup plot f.obj --rejoin 9", "--port <DEVICE>"),
        ("penup plot f.obj --board pico --rejoin 9", "cannot be used with"),
        ("penup plot f.obj --resume", "--port <DEVICE>"),
        ("penup plot f.obj --port auto --at-origin", "--resume"),
        ("penup plot f.obj --rejoin 9 --svg f.svg", "cannot be used with"),
        ("penup plot f.obj --rejoin 9 --png f.png", "cannot be used with"),
        ("penup plot f.obj --resume --svg f.svg", "cannot be used with"),
        ("penup plot f.obj --resume --png f.png", "cannot be used with"),
        ("penup plot f.obj --resume --board pico", "cannot be used with"),
        ("penup plot f.obj --at-origin --svg f.svg", "cannot be used with"),
        ("penup plot f.obj --at-origin --board pico", "cannot be used with"),
        ("penup plot f.obj --port auto --at-origin --from 3", "cannot be used with"),
        ("penup plot f.obj --port auto --at-origin --multipass 2", "cannot be used with"),
    ] {
        let error = parse(line).expect_err(line);
        assert!(error.contains(needed), "{error}");
    }
    for line in [
        "penup preview f.obj",
        "penup preview f.obj --json f.json --repeat 3",
        "penup plot f.obj --board pico",
        "penup plot f.obj --port auto --rejoin 9",
        "penup plot f.obj --port auto --resume --at-origin",
        "penup watch --rejoin 9",
    ] {
        assert_eq!(parse(line), Ok(()), "{line}");
    }
}

#[test]
fn a_preview_runs_at_least_once() {
    for times in ["0", "-1"] {
        let line = ["penup", "preview", "f.obj", "--json", "f.json", "--repeat", times];
        let error = Cli::try_parse_from(line).expect_err("refused").to_string();
        assert!(error.contains(&format!("{times} is not in 1..")), "{error}");
        assert!(error.contains("'--repeat "), "{error}");
    }
}
