//! Questions to the user of a drawing with several pens, where no keys are taken from a terminal.

use super::*;
use std::io::{self, Seek as _};

/// Starts to plot a line with each of three pens.
fn plot_pens(plotter: &Library, folder: &Path, input: Stdio) -> Child {
    let vertices = "v 10 10 0\nv 60 10 0\nv 10 20 0\nv 60 20 0\nv 10 30 0\nv 60 30 0\n";
    let lines = "usemtl pen1\nl 1 2\nusemtl pen2\nl 3 4\nusemtl pen3\nl 5 6\n";
    fs::write(folder.join("pens.obj"), format!("{vertices}{lines}")).expect("written");
    Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["plot", "pens.obj", "--port", &plotter.device])
        .current_dir(folder)
        .stdin(input)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs")
}

/// Reads what the program notes until it has said this.
fn wait_for(client: &mut Child, words: &str) {
    let (noted, mut said) = (client.stderr.as_mut().expect("a pipe"), Vec::new());
    while !String::from_utf8_lossy(&said).contains(words) {
        let mut byte = [0];
        noted.read_exact(&mut byte).expect("it says more");
        said.extend(byte);
    }
}

/// As in `while read file; do penup plot "$file"; done < list`.
#[test]
fn what_waits_at_the_standard_input_changes_no_pen() {
    let folder = tempfile::tempdir().expect("a folder");
    let list = folder.path().join("list.txt");
    let (mut reader, mut writer) = io::pipe().expect("a pipe");
    for lines in ["next.svg\nlast.svg\n", "\n\n"] {
        fs::write(&list, lines).expect("written");
        let mut file = fs::File::open(&list).expect("readable");
        let plotter = Library::new();
        let input = file.try_clone().expect("cloned").into();
        let (code, _, error) = ended(plot_pens(&plotter, folder.path(), input));
        assert_eq!(code, Some(5), "{error}");
        assert!(error.contains("the machine waits for pen 2"), "{error}");
        assert!(!error.contains("press Enter\n"), "nobody is asked: {error}");
        assert_eq!(file.stream_position().expect("a place"), 0, "the list is left to its reader");
        let plotter = Library::new();
        writer.write_all(lines.as_bytes()).expect("written");
        let input = reader.try_clone().expect("cloned").into();
        let (code, _, error) = ended(plot_pens(&plotter, folder.path(), input));
        assert_eq!(code, Some(5), "{error}");
        assert!(error.contains("the machine waits for pen 2"), "{error}");
        let mut left = vec![0; lines.len()];
        reader.read_exact(&mut left).expect("the lines are left to their reader");
        assert_eq!(left, lines.as_bytes());
    }
}

/// As by `ssh`, or by a program that waits for the question.
#[test]
fn an_empty_line_behind_a_question_answers_it_and_words_do_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plot_pens(&plotter, folder.path(), Stdio::piped());
    let mut input = client.stdin.take().expect("a pipe");
    for pen in 2..=3 {
        wait_for(&mut client, &format!("Put in pen {pen}, then press Enter"));
        input.write_all(b"\n").expect("typed");
    }
    let (code, said, _) = ended(client);
    assert_eq!(code, Some(0));
    assert!(said.starts_with("pens.obj is drawn: 3 strokes"), "{said}");
    let plotter = Library::new();
    let mut client = plot_pens(&plotter, folder.path(), Stdio::piped());
    let mut input = client.stdin.take().expect("a pipe");
    wait_for(&mut client, "Put in pen 2, then press Enter");
    input.write_all(b"next.svg\n").expect("typed");
    drop(input);
    let (code, _, error) = ended(client);
    assert_eq!(code, Some(5), "{error}");
    assert!(error.contains("the machine waits for pen 2"), "{error}");
}

/// The keys are not taken from a terminal where the notes go elsewhere.
#[test]
fn what_was_typed_before_a_question_does_not_answer_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (mut keys, name) = pseudo_terminal();
    let terminal = fs::OpenOptions::new().read(true).write(true).open(&name).expect("opened");
    keys.write_all(b"\n\n").expect("typed");
    let mut client = plot_pens(&plotter, folder.path(), terminal.into());
    wait_for(&mut client, "Put in pen 2, then press Enter");
    // The end of the terminal: nobody is there any more.
    drop(keys);
    let (code, _, error) = ended(client);
    assert_eq!(code, Some(5), "{error}");
    assert!(error.contains("the machine waits for pen 2"), "{error}");
}
