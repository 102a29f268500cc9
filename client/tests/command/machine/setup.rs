//! `penup setup`, which asks about a new machine and sets it up.

use super::*;

/// Runs `penup setup` with these answers.
fn set_up(plotter: &Library, answers: &str) -> (Option<i32>, serde_json::Value, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["setup", "--json", "--port", &plotter.device])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut typed = program.stdin.take().expect("a pipe");
    typed.write_all(answers.as_bytes()).expect("written");
    drop(typed);
    let (code, said, noted) = ended(program);
    (code, serde_json::from_str(&said).expect(&noted), noted)
}

#[test]
fn a_machine_is_set_up_by_questions() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    // x runs the other way, 100 mm are 98 and 101, and the pen is lowered less.
    let answers = "\nleft\nup\nbanana\nright\nup\n\n98\n\n101,0\n\n200\n90\n\n\nyes\n";
    let (code, said, noted) = set_up(&plotter, answers);
    assert_eq!(code, Some(0), "{noted}");
    let expected = serde_json::json!({ "3": 1.0, "100": 81.633, "101": 79.208, "211": 90.0 });
    assert_eq!(said["settings"], expected, "{noted}");
    assert!(noted.contains("Please type right, left, up, down, not at all."), "{noted}");
    assert!(noted.contains("Please type a number from 0 to 127."), "{noted}");
    assert!(noted.contains("both diagonals are the same"), "{noted}");
    let (_, shown, _) = plotter.run(folder.path(), &["settings", "show"]);
    for setting in ["  3 = 1 ", "100 = 81.633 ", "101 = 79.20", " 20 = 1 ", "211 = 90 "] {
        assert!(shown.contains(setting), "{setting}: {shown}");
    }
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
}

#[test]
fn a_machine_is_set_up_whatever_it_reports_and_whatever_lowers_its_pen() {
    let folder = tempfile::tempdir().expect("a folder");
    for settings in [["10=0", "13=1", "206=2"], ["10=2", "13=0", "206=3"]] {
        let plotter = Library::new();
        let (code, _, error) = plotter.run(folder.path(), &[&["set"], &settings[..]].concat());
        assert_eq!(code, Some(0), "{error}");
        let (code, said, noted) = set_up(&plotter, "\nright\nup\n\n\n\n\n\n\n\nyes\n");
        assert_eq!(code, Some(0), "{settings:?}: {noted}");
        assert_eq!(said["settings"], serde_json::json!({}), "{noted}");
    }
}

/// The motors of a polargraph are 1000 mm apart; the left one runs the wrong way.
#[test]
fn a_polargraph_is_set_up_by_its_own_measures() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (code, _, error) = plotter.run(folder.path(), &["set", "230=2"]);
    assert_eq!(code, Some(0), "{error}");
    let measures = "1000\n1200\n250\n650\n500\n900\n600\n40\n3200\n";
    let rest = "\nup\nright\nright\nup\n\n90\n\nyes\n";
    let (code, said, noted) = set_up(&plotter, &format!("{measures}{rest}"));
    assert_eq!(code, Some(0), "{noted}");
    let expected = serde_json::json!({
        "3": 1.0, "130": 500.0, "131": 600.0, "211": 90.0, "231": 1000.0, "232": 250.0,
        "233": 650.0,
    });
    assert_eq!(said["settings"], expected, "80 steps in a mm are the default: {noted}");
    assert!(noted.contains("Please type a number from 0 to 1000."), "{noted}");
    assert!(noted.contains("Please type a number from 1 to 649."), "{noted}");
    let parts: Vec<&str> = noted.lines().filter(|line| line.contains(" of 5: ")).collect();
    assert_eq!(parts.len(), 5, "{noted}");
    assert!(parts.iter().zip(1..).all(|(part, number)| part.starts_with(&format!("{number} of"))));
    assert!(!noted.contains("steps in a mm.\n"), "the axes have no steps: {noted}");
    assert!(noted.contains("both diagonals are the same"), "{noted}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
}

/// The settings that are named in a sentence, such as `3=1 (inverted directions)`.
fn settings_in(said: &str) -> Vec<(String, f64)> {
    let words = said.split([' ', '\n', ',']).filter_map(|word| word.split_once('='));
    words.filter_map(|(number, value)| Some((number.to_owned(), value.parse().ok()?))).collect()
}

/// Checks that what differs from a new machine is what was told, and that soft limits are on.
fn assert_told(plotter: &Library, folder: &Path, told: &[(String, f64)]) {
    let (_, now) = plotter.json(folder, &["settings", "show"]);
    let (_, new) = Library::new().json(folder, &["settings", "show"]);
    let (said, new) = (now, &new["settings"]);
    assert!(said["settings"].is_object(), "{said}");
    let now = said["settings"].as_object().expect("a table");
    let differs: Vec<(&String, f64)> = now
        .iter()
        .filter(|(number, value)| new[number.as_str()] != **value)
        .map(|(number, value)| (number, value.as_f64().expect("a number")))
        .collect();
    assert_eq!(differs.len(), told.len(), "{differs:?} {told:?}");
    for (number, value) in differs {
        let (_, told) = told.iter().find(|(told, _)| told == number).expect("it is told");
        assert!((told - value).abs() < 0.001, "{number}: {told} {value}");
    }
    assert_eq!(now["20"], 1.0, "soft limits are on as before");
}

#[test]
fn a_setup_that_is_broken_off_says_what_is_stored() {
    let all = "\nleft\nup\nright\nup\n\n98\n\n101\n\n90\n\n\n";
    let ends = all.match_indices('\n').map(|(at, _)| at + 1);
    let folder = tempfile::tempdir().expect("a folder");
    for end in std::iter::once(0).chain(ends) {
        let plotter = Library::new();
        let (code, said, noted) = set_up(&plotter, &all[..end]);
        assert_eq!(code, Some(5), "{noted}");
        let error = said["error"].as_str().expect("an error");
        assert!(error.starts_with("the setup is broken off; "), "{error}");
        assert_told(&plotter, folder.path(), &settings_in(error));
    }
}

/// Ctrl-C breaks the setup off wherever it comes: at a question, or while the pen moves.
#[test]
fn a_setup_is_broken_off_by_ctrl_c() {
    let folder = tempfile::tempdir().expect("a folder");
    for (answers, question) in
        [("", "Press Enter when it is there"), ("\nleft\nup\nright\nup\n\n", "How many mm did")]
    {
        let plotter = Library::new();
        plotter.slow.store(true, Ordering::Relaxed);
        let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
            .args(["setup", "--port", &plotter.device])
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let mut typed = program.stdin.take().expect("a pipe");
        typed.write_all(answers.as_bytes()).expect("written");
        let mut noted = String::new();
        let mut said = program.stderr.take().expect("a pipe");
        let mut bytes = [0; 256];
        while !noted.contains(question) {
            let count = said.read(&mut bytes).expect("text");
            assert!(count > 0, "it ended: {noted}");
            noted += &String::from_utf8_lossy(&bytes[..count]);
        }
        let interrupted = Command::new("kill").args(["-INT", &program.id().to_string()]).status();
        assert!(interrupted.expect("kill runs").success());
        said.read_to_string(&mut noted).expect("text");
        assert_eq!(program.wait().expect("it ends").code(), Some(130), "{noted}");
        let (_, told) = noted.split_once("penup: the setup is broken off; ").expect(&noted);
        plotter.slow.store(false, Ordering::Relaxed);
        assert_told(&plotter, folder.path(), &settings_in(told));
    }
}

#[test]
fn the_test_square_depends_on_no_earlier_job_and_changes_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let job = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n$projection=isometric\n$hidden=dashed\n\
               $page=100x90\n$title=old\n$eye=3,4,5\n$margin=7\n";
    let all = |said: &str| said.split("ok").collect::<Vec<_>>().join("");
    let said = console(&plotter, job);
    assert_eq!(said.matches("ok\r\n").count(), 10, "{said}");
    let before = all(&console(&plotter, "$options\n$model\n"));
    let (code, _, noted) = set_up(&plotter, "\nright\nup\n\n\n\n\n\n\n\nyes\n");
    assert_eq!(code, Some(0), "{noted}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
    assert_eq!(status["ink_mm"], serde_json::json!({ "done": 160, "all": 160 }), "{status}");
    let after = all(&console(&plotter, "$options\n$model\n"));
    let kept = |said: &str| {
        let lines = said.lines().filter(|line| line.contains('=') || line.contains("MODEL:"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(before.contains("title=old") && before.contains("vertices 3 "), "{before}");
    assert_eq!(kept(&after), kept(&before));
}

/// A plotter that was left elsewhere has no room for the moves of the setup.
#[test]
fn a_setup_says_where_its_moves_have_no_room() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (_, settings) = plotter.json(folder.path(), &["settings", "show"]);
    let travel = settings["settings"]["130"].as_f64().expect("a number");
    assert_eq!(plotter.run(folder.path(), &["jog", &(travel - 50.0).to_string(), "0"]).0, Some(0));
    let (code, _, noted) = set_up(&plotter, "\n");
    assert_eq!(code, Some(5), "{noted}");
    assert!(noted.contains("Switch it off and on"), "{noted}");
}
