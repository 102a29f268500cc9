//! Tests of lines with numbers and checksums: how a plotter answers them, and what it must never
//! do.

use penup::protocol::{CommandError, Label, Named, Numbering, Received};
use penup_host_tests::whole_jobs::{Bench, job_lines};
use penup_job::protocol::numbered;
use penup_job::twin;
use penup_readers::lines::JobLine;

/// Starts a plotter and reads its greeting.
fn bench() -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    bench
}

/// Adds RepRap's checksum to a line.
fn xored(line: &str) -> String {
    format!("{line}*{}\n", line.bytes().fold(0, |xor, byte| xor ^ byte))
}

/// Adds a CRC to a line.
fn line(number: i32, text: &str) -> String {
    format!("{}\n", numbered(Some(number), text))
}

/// Adds the CRC to a reply.
fn reply(text: &str) -> String {
    format!("{}\n", numbered(None, text))
}

fn vertices(bench: &Bench) -> usize {
    bench.plotter.model().vertices().len()
}

#[test]
fn a_reprap_sender_is_answered_by_number() {
    let mut bench = bench();
    // Real programs such as pronsole and gscrib begin like this.
    assert_eq!(bench.say("N-1 M110 N-1*125\n"), "ok N-1\n");
    assert_eq!(bench.say(&xored("N0 v 0 0 0")), "ok N0\n");
    assert_eq!(bench.say(&xored("N1 v 1 0 0 ")), "ok N1\n");
    assert_eq!(
        bench.say("N2 v 0 3 0*12\n"),
        "[MSG:the line was damaged on its way: send it again]\nResend: 2\nerror:170\n"
    );
    let out_of_order = "[MSG:line 2 comes next; M110 N0 begins again with line 1]\nResend: 2\n\
                        error:171\n";
    assert_eq!(bench.say(&xored("N3 v 1 1 1")), out_of_order);
    assert_eq!(vertices(&bench), 2);
    assert_eq!(bench.say(&xored("N0 v 0 0 0")), "ok N0\n", "acknowledged again");
    assert_eq!(vertices(&bench), 2, "and not carried out again");
    // The content of the line is refused, so its number is used up.
    let refused = "[MSG:there is no vertex 9: the model has 2]\nerror:110 N2\n";
    assert_eq!(bench.say(&xored("N2 f 1 2 9")), refused);
    assert_eq!(
        bench.say(&xored("N2 f 1 2 9")),
        "[MSG:the line was refused when it came first]\nerror:110 N2\n"
    );
    assert_eq!(bench.say(&xored("N3 $page=80x60")), "ok N3\n");
    // A line that may have lost its checksum or its number is not executed.
    for damaged in ["N4 v 1 2 3\n", "N4 v 1 2 3 12\n", "v 1 2 3*12\n"] {
        assert!(bench.say(damaged).ends_with("Resend: 4\nerror:172\n"), "{damaged}");
    }
    assert_eq!(bench.say("v 1 2 3\n"), "ok\n", "as some do by hand meanwhile");
    assert_eq!(bench.say(&xored("N123 M110 N500")), "ok N123\n");
    assert_eq!(bench.say(&xored("M110")), "Line: 500\nok\n");
    assert_eq!(bench.say(&xored("N501 v 4 4 4")), "ok N501\n");
}

#[test]
fn who_sends_no_checksum_sees_plain_grbl() {
    let mut bench = bench();
    for text in ["N5 G21", "N7 G90 (no * 2)", "v 0 1 0", "M110 N3", "M110", "o a*12"] {
        assert_eq!(bench.say(&format!("{text}\n")), "ok\n", "{text}");
    }
    assert_eq!(bench.say("N1 M2\n"), "[MSG:Pgm End]\nok\n");
    assert!(bench.say("v 0 1 0*12\n").ends_with("]\nerror:2\n"));
    // A checksum alone is compared.
    assert_eq!(bench.say(&xored("G0 X0")), "ok\n");
    assert!(bench.say("G0 X1*12\n").ends_with("]\nerror:170\n"));
}

#[test]
fn the_first_number_is_0_or_1_or_the_one_after_that_of_m110() {
    for (first, expected) in [(0, "ok N0\n"), (1, "ok N1\n")] {
        assert_eq!(bench().say(&xored(&format!("N{first} v 1 2 3"))), expected);
    }
    for first in ["N2", "N17", "N-1"] {
        let mut bench = bench();
        assert!(bench.say(&xored(&format!("{first} v 1 2 3"))).ends_with("Resend: 1\nerror:171\n"));
        assert_eq!(vertices(&bench), 0);
    }
    let mut bench = bench();
    assert_eq!(bench.say("M110 N16\n"), "ok\n");
    assert_eq!(bench.say(&xored("N17 v 0 1 0 0")), "ok N17\n");
}

#[test]
fn lines_with_a_crc_are_answered_with_a_crc() {
    let mut bench = bench();
    assert_eq!(bench.say(&line(0, "M110")), reply("ok N0"));
    assert_eq!(bench.say(&line(1, "v 0 1 0")), reply("ok N1"));
    assert_eq!(bench.say(&line(3, "v 0 1 0")), reply("Resend: 2") + "error:171\n");
    let answer = bench.say(&line(2, "f 1 2 3"));
    assert!(answer.ends_with(&reply("error:110 N2")), "{answer}");
    assert_eq!(bench.say(&line(3, "$title=a*B")), reply("ok N3"));
    // A refusal is repeated when the last number is queried, in case the reply was lost.
    let last = format!("{}\n", numbered(None, "M110"));
    assert!(bench.say(&last).ends_with(&reply("error:110 N2")));
    assert_eq!(bench.say(&line(3, "M110 N0")), reply("ok N3"));
    assert_eq!(bench.say(&last), reply("Line: 0") + "ok\n");
}

#[test]
fn after_a_crc_nothing_else_is_carried_out_until_that_is_ended() {
    let mut bench = bench();
    bench.say(&(line(0, "M110") + &line(1, "v 0 0 0")));
    for other in ["v 1 1 1\n", "$page=10x10\n", "2 v 1 1 1\n", "N2 v 1 1 1\n", "$clear\n"] {
        let answer = bench.say(other);
        assert!(answer.ends_with(&(reply("Resend: 2") + "error:172\n")), "{other}: {answer}");
        assert!(answer.starts_with("[MSG:"), "a user at a terminal is told why: {answer}");
    }
    // One wrong line in 256 would pass with this one.
    assert_eq!(bench.say(&xored("N2 v 1 1 1")), reply("Resend: 2") + "error:170\n");
    assert_eq!(bench.say("\n"), "ok\n", "a doubled line end");
    assert_eq!(vertices(&bench), 1);
    assert_eq!(bench.say(&line(2, "M2")), "[MSG:Pgm End]\n".to_owned() + &reply("ok N2"));
    assert_eq!(bench.say("v 1 1 1\n"), "ok\n");
    bench.say(&line(3, "v 2 2 2"));
    assert!(bench.say("v 1 1 1\n").ends_with("error:172\n"));
    assert!(bench.say("\x18").contains("Grbl"));
    assert_eq!(bench.say("v 1 1 1\n"), "ok\n");
    assert_eq!(vertices(&bench), 4);
}

#[test]
fn number_and_checksum_do_not_count_in_the_length_of_a_line() {
    let mut bench = bench();
    bench.say(&line(-123_456_789, "M110"));
    let text = format!("o {}", "x".repeat(254));
    assert_eq!(bench.say(&line(-123_456_788, &text)), reply("ok N-123456788"));
    let answer = bench.say(&line(-123_456_787, &format!("{text}x")));
    assert!(answer.ends_with("error:11\n"), "{answer}");
    assert!(answer.starts_with(&reply("Resend: -123456787")), "{answer}");
    // With a short number the line is read, and refused for its length.
    bench.say(&line(0, "M110"));
    let answer = bench.say(&line(1, &format!("{text}x")));
    assert!(answer.ends_with(&reply("error:11 N1")), "{answer}");
}

/// All variants of a line with a single fault or with one run of lost bytes.
fn damaged(line: &[u8]) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    for at in 0..line.len() {
        let with = |middle: &[u8]| [&line[..at], middle, &line[at + 1..]].concat();
        all.push(with(&[line[at]; 2]));
        all.extend((0..=u8::MAX).map(|byte| with(&[byte])));
        all.extend((at + 1..=line.len()).map(|end| [&line[..at], &line[end..]].concat()));
    }
    all.retain(|damaged| damaged != line);
    all
}

#[test]
fn no_single_fault_makes_another_line_of_one_with_a_crc() {
    let label = Label { checksum: None, named: Named::Nothing };
    let mut numbering = Numbering::default();
    let start = numbered(Some(0), "M110");
    assert!(matches!(numbering.receive(Ok(&start)), Received::Answer(Ok(()), _)));
    let texts = ["v 0 1 0", "f 1 2 3", "$title=a*12", "$plot", "M110", "$page=210x297"];
    let mut count = 0;
    for text in texts {
        let whole = numbered(Some(1), text);
        let next = numbered(Some(2), "v 7 8 9");
        // A line that has lost its end arrives joined to the next one.
        let both = format!("{whole}{next}");
        for bytes in damaged(whole.as_bytes()).into_iter().chain(damaged(both.as_bytes())) {
            let Ok(line) = core::str::from_utf8(&bytes) else { continue };
            count += 1;
            let mut after = numbering;
            let received = after.receive(Ok(line));
            // The rest may still be the whole line.
            let is_right = line == whole || line == next;
            let is_refused = matches!(received, Received::Answer(Err(_), _));
            let is_empty = line.is_empty() && received == Received::Line("", label);
            assert!(is_right || is_refused || is_empty, "{line}: {received:?}");
        }
    }
    assert!(count > 20_000);
}

#[test]
fn a_number_in_a_line_of_nine_digits_is_read_and_a_longer_one_is_not() {
    let mut numbering = Numbering::default();
    let longest = numbered(Some(999_999_999), "M110");
    assert!(matches!(numbering.receive(Ok(&longest)), Received::Answer(Ok(()), _)));
    // The number after it cannot be represented, so nothing is executed.
    let head = "N1000000000 $plot";
    let next = numbered(None, head);
    let received = numbering.receive(Ok(&next));
    assert!(matches!(received, Received::Answer(Err(CommandError::Unnumbered), _)), "{received:?}");
}

#[test]
fn the_checksums_of_model_and_options_are_those_that_the_client_expects() {
    let mut seen = Vec::new();
    for scene in ["lattice3.obj", "isobars.obj", "interpen.obj"] {
        let mut lines = job_lines(scene, &["$page=60x80", "$title=Für Ada"]);
        lines.pop();
        let mut bench = bench();
        for line in &lines {
            assert_eq!(bench.say(&format!("{line}\n")), "ok\n");
        }
        let report = bench.say("$model\n");
        let job: Vec<JobLine> = lines.into_iter().map(JobLine::command).collect();
        let contents = twin::contents(&job, job.len());
        let expected = contents.map(|[model, options]| {
            format!("\n[MODEL:checksum {model:08X}, options {options:08X}]\n")
        });
        assert!(expected.is_some_and(|expected| report.contains(&expected)), "{report}");
        seen.extend(contents.map(|[model, _]| model));
        // Another position, another checksum.
        bench.say("$margin=9\n$move=1,9,9,9\n");
        assert_ne!(bench.say("$model\n"), report);
    }
    seen.dedup();
    assert_eq!(seen.len(), 3);
}
