//! Jobs that go on after a loss of power, without their client, or behind a broken line.

use super::*;

#[test]
fn a_job_goes_on_after_a_loss_of_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    // It draws some strokes before its power is cut.
    while plotter.strokes(folder.path()) < 3 {}
    plotter.cut.store(true, Ordering::Relaxed);
    while plotter.cut.load(Ordering::Relaxed) {}
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (_, said, _) = run(&["status"]);
    assert!(said.contains("a job has stopped after "), "{said}");
    let (code, _, error) = run(&["resume"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("penup resume --at-origin"), "{error}");
    let (code, stopped) = plotter.json(folder.path(), &["status"]);
    let drawn = stopped["stopped"]["done"].as_u64().expect("a number");
    assert_eq!((code, &stopped["stopped"]["all"]), (Some(0), &120.into()));
    assert!((2..120).contains(&drawn), "{stopped}");
    let (code, said, error) = run(&["resume", "--at-origin"]);
    assert_eq!((code, said.as_str()), (Some(0), "the rest of the job is drawn\n"), "{error}");
    let (_, drawn) = plotter.json(folder.path(), &["status"]);
    assert_eq!(drawn["strokes"], serde_json::json!({ "done": 120, "all": 120 }));
    assert_eq!(drawn["stopped"], serde_json::Value::Null);
    assert!(run(&["resume"]).2.contains("nothing to resume"));
}

/// Sends rows that this computer orders until a loss of power stops them. Returns how many are
/// drawn.
fn cut_rows(plotter: &Library, folder: &Path) -> u64 {
    let mut client = plotter.plot_rows(folder, &["--compute", "host"]);
    plotter.slow.store(true, Ordering::Relaxed);
    while plotter.heard.load(Ordering::Relaxed) < 700 {
        std::thread::sleep(Duration::from_millis(5));
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
    }
    // The plotter has room for all strokes, which come within a second.
    std::thread::sleep(Duration::from_secs(2));
    plotter.slow.store(false, Ordering::Relaxed);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    while plotter.strokes(folder) < 3 {}
    plotter.cut.store(true, Ordering::Relaxed);
    while plotter.cut.load(Ordering::Relaxed) {}
    let (code, stopped) = plotter.json(folder, &["status"]);
    assert_eq!((code, &stopped["stopped"]["all"]), (Some(0), &120.into()));
    stopped["stopped"]["done"].as_u64().expect("a number")
}

/// Plots the rows with these options. Returns the exit status and what it says about it.
fn plot_rows(plotter: &Library, folder: &Path, options: &[&str]) -> (Option<i32>, String) {
    let output = plotter.rows(folder, options).stderr(Stdio::piped()).output();
    let output = output.expect("the program runs");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_drawing_that_is_sent_goes_on_after_a_loss_of_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let drawn = cut_rows(&plotter, folder.path());
    let (code, _, error) = plotter.run(folder.path(), &["resume", "--at-origin"]);
    assert_eq!((code, error.contains("--resume")), (Some(1), true), "{error}");
    let go_on = |options: &[&str]| plot_rows(&plotter, folder.path(), options);
    let (code, error) = go_on(&["--resume"]);
    assert_eq!((code, error.contains("--at-origin")), (Some(1), true), "{error}");
    // What is drawn is not drawn over without a word.
    let (code, error) = go_on(&["--compute", "host"]);
    let advice = "add --resume to go on with it, or --from 0 to draw all of it anew";
    assert_eq!((code, error.contains(advice)), (Some(1), true), "{error}");
    let (code, error) = go_on(&["--resume", "--at-origin", "--scale", "0.9"]);
    assert_eq!((code, error.contains("another drawing")), (Some(1), true), "{error}");
    let (code, error) = go_on(&["--resume", "--at-origin"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains(&format!("{drawn} of 120 strokes are drawn")), "{error}");
    let (_, ended) = plotter.json(folder.path(), &["status"]);
    let rest = 120 - drawn;
    assert_eq!(ended["strokes"], serde_json::json!({ "done": rest, "all": rest }));
    assert_eq!(ended["stopped"], serde_json::Value::Null);
    let (code, error) = go_on(&["--resume"]);
    assert_eq!((code, error.contains("no drawing has stopped")), (Some(1), true), "{error}");
}

/// A setting has changed, so that the drawing cannot go on: that is said before it begins anew.
#[test]
fn a_drawing_that_cannot_go_on_is_named_when_another_one_begins() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    cut_rows(&plotter, folder.path());
    let (code, _, error) = plotter.run(folder.path(), &["set", "100=81"]);
    assert_eq!(code, Some(0), "{error}");
    let (code, _, error) = plotter.run(folder.path(), &["unlock"]);
    assert_eq!(code, Some(0), "{error}");
    let (code, noted) = plot_rows(&plotter, folder.path(), &["--compute", "host"]);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("has stopped a drawing before, which cannot go on now: "), "{noted}");
    assert!(noted.contains("set it back, or begin anew"), "{noted}");
}

#[test]
fn a_job_goes_on_without_its_client_and_is_joined_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    // The port is the client's as long as it lives.
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    plotter.slow.store(true, Ordering::Relaxed);
    plotter.wait_for_drawing(&mut client);
    assert_eq!(client.try_wait().expect("a state"), None, "it has drawn already");
    let (code, _, _) = run(&["status"]);
    assert_eq!(code, Some(3), "two programs at one port");
    client.kill().expect("killed");
    client.wait().expect("it ends");
    let (code, paused) = plotter.json(folder.path(), &["pause"]);
    assert_eq!(
        (code, &paused["state"], &paused["standing"]),
        (Some(0), &"Hold".into(), &true.into())
    );
    let (code, said, _) = run(&["status"]);
    assert_eq!(code, Some(0));
    assert!(said.starts_with("it holds with the pen up"), "{said}");
    assert!(said.contains("of 120 strokes are drawn") && said.contains(" are left"), "{said}");
    let (code, _, error) = run(&["jog", "1", "1"]);
    assert_eq!(
        (code, error.contains("the plotter is not ready: it reports Hold")),
        (Some(4), true)
    );
    assert_eq!(run(&["resume"]).0, Some(0));
    plotter.slow.store(false, Ordering::Relaxed);
    let (code, ended) = plotter.json(folder.path(), &["watch"]);
    assert_eq!((code, &ended["state"]), (Some(0), &"Idle".into()));
    assert_eq!(ended["strokes"], serde_json::json!({ "done": 120, "all": 120 }));
    assert_eq!(run(&["watch"]).1, "nothing is being drawn\n");
}

#[test]
fn a_cable_that_is_pulled_costs_neither_the_upload_nor_the_job() {
    for bytes in [300, 1500, 4000, usize::MAX] {
        let folder = tempfile::tempdir().expect("a folder");
        let plotter = Library::at_a_bad_line(folder.path());
        let mut client = plotter.plot_rows(folder.path(), &[]);
        let is_due = || match bytes {
            usize::MAX => plotter.drawing.load(Ordering::Relaxed),
            bytes => plotter.heard.load(Ordering::Relaxed) >= bytes,
        };
        while !is_due() {
            assert_eq!(client.try_wait().expect("a state"), None, "it ended before");
            std::thread::sleep(Duration::from_millis(1));
        }
        plotter.replug.store(true, Ordering::Relaxed);
        let (code, said, noted) = ended(client);
        assert_eq!(code, Some(0), "{bytes}: {noted}");
        assert!(said.starts_with("rows.obj is drawn: 120 strokes, 12000.0 mm drawn"), "{said}");
        assert!(noted.contains("penup: the port of the plotter is gone: waiting up to 300 s"));
        assert!(noted.contains("penup: the plotter is back"), "{noted}");
    }
}

#[test]
fn a_plotter_that_falls_silent_is_watched_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::at_a_bad_line(folder.path());
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    plotter.deaf.store(true, Ordering::Relaxed);
    // Longer than a client waits for an answer that never comes.
    std::thread::sleep(Duration::from_secs(6));
    plotter.deaf.store(false, Ordering::Relaxed);
    let (code, _, noted) = ended(client);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("penup: the plotter does not answer: waiting up to 300 s"), "{noted}");
    assert!(noted.contains("penup: the plotter is back"), "{noted}");
}

#[test]
fn a_port_that_stays_away_ends_the_waiting_in_time() {
    for (seconds, is_told) in [("1", true), ("0", false)] {
        let folder = tempfile::tempdir().expect("a folder");
        let plotter = Library::new();
        let mut client = plotter.plot_rows(folder.path(), &["--rejoin", seconds]);
        plotter.slow.store(true, Ordering::Relaxed);
        plotter.wait_for_drawing(&mut client);
        drop(plotter);
        let (code, _, noted) = ended(client);
        assert_eq!(code, Some(5), "{noted}");
        assert!(noted.contains("the line to the plotter broke: "), "{noted}");
        assert_eq!(noted.contains("waiting up to 1 s"), is_told, "{noted}");
    }
}

/// The plotter waits for the rest, and no option is needed to go on.
#[test]
fn a_port_that_stays_away_while_strokes_are_sent_is_told_as_such() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let client = plotter.plot_rows(folder.path(), &["--compute", "host", "--rejoin", "1"]);
    plotter.slow.store(true, Ordering::Relaxed);
    while plotter.heard.load(Ordering::Relaxed) < 1000 {
        std::thread::sleep(Duration::from_millis(5));
    }
    drop(plotter);
    let (code, _, noted) = ended(client);
    assert_eq!(code, Some(5), "{noted}");
    assert!(noted.contains("once it answers, do the same again"), "{noted}");
    assert!(!noted.contains("--from"), "{noted}");
}

#[test]
fn a_job_that_a_loss_of_power_has_stopped_is_not_taken_for_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    plotter.slow.store(true, Ordering::Relaxed);
    while plotter.strokes(folder.path()) < 3 {}
    let watch = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["watch", "--port", &plotter.device])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let heard = plotter.heard.load(Ordering::Relaxed);
    while plotter.heard.load(Ordering::Relaxed) < heard + 5 {}
    plotter.cut.store(true, Ordering::Relaxed);
    let (code, _, noted) = ended(watch);
    assert_eq!(code, Some(5), "{noted}");
    assert!(noted.contains("again") || noted.contains("the job has stopped after "), "{noted}");
}

/// Plots the waves with these options until the plotter has heard so many bytes from this client,
/// which ends then. Returns how many strokes are drawn, of what has come, once the machine waits.
fn leave_waves(plotter: &Library, folder: &Path, options: &[&str], bytes: usize) -> u64 {
    let before = plotter.heard.load(Ordering::Relaxed);
    let mut client = plotter.plot_waves(folder, options);
    while plotter.heard.load(Ordering::Relaxed) < before + bytes {
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before");
        std::thread::sleep(Duration::from_millis(1));
    }
    client.kill().expect("killed");
    client.wait().expect("it ends");
    // What has come is drawn, and then the machine waits with the pen up.
    let mut seen = (u64::MAX, 0);
    while seen.0 != seen.1 || seen.0 == 0 {
        std::thread::sleep(Duration::from_millis(500));
        seen = (plotter.strokes(folder), seen.0);
    }
    seen.0
}

#[test]
fn strokes_that_stop_coming_come_again_from_the_same_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let drawn = leave_waves(&plotter, folder.path(), &[], 30_000);
    assert!((1..70).contains(&drawn), "{drawn}");
    let (code, said, noted) = ended(plotter.plot_waves(folder.path(), &[]));
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("the plotter draws this already: the last "), "{noted}");
    assert!(said.starts_with("waves.obj is drawn: "), "{said}");
    let status = plotter.json(folder.path(), &["status"]).1;
    assert_eq!(status["state"], "Idle", "{status}");
}

/// The client of the rest ends, too: the same command sends what is left of the rest.
#[test]
fn the_rest_of_a_drawing_that_went_on_is_joined_again() {
    join_rest_again("219=0");
}

/// The rest begins within a stroke.
#[test]
fn a_rest_within_a_stroke_is_joined_again() {
    join_rest_again("219=0.05");
}

fn join_rest_again(setting: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    assert_eq!(plotter.run(folder.path(), &["set", setting]).0, Some(0));
    leave_waves(&plotter, folder.path(), &[], 30_000);
    plotter.cut.store(true, Ordering::Relaxed);
    while plotter.cut.load(Ordering::Relaxed) {}
    let stopped = plotter.json(folder.path(), &["status"]).1;
    let first = stopped["stopped"]["done"].as_u64().expect("a number");
    let rest = stopped["stopped"]["all"].as_u64().expect("a number") - first;
    let second = leave_waves(&plotter, folder.path(), &["--resume", "--at-origin"], 30_000);
    assert!(first > 0 && (1..rest).contains(&second), "{first}, {second} of {rest}");
    let (code, said, noted) = ended(plotter.plot_waves(folder.path(), &["--resume"]));
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("the plotter draws this already: the last "), "{noted}");
    assert!(said.starts_with("waves.obj is drawn: "), "{said}");
    let ended = plotter.json(folder.path(), &["status"]).1;
    assert_eq!(ended["strokes"], serde_json::json!({ "done": rest, "all": rest }), "{ended}");
    assert_eq!((&ended["state"], &ended["stopped"]), (&"Idle".into(), &serde_json::Value::Null));
}

#[test]
fn a_drawing_goes_on_at_the_stroke_that_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let file = "v 10 10 0\nv 60 10 0\nv 10 20 0\nv 60 20 0\nl 1 2\nl 3 4\n";
    fs::write(folder.path().join("a.obj"), file).expect("written");
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let plot = |from: &str| run(&["plot", "a.obj", "--port", "auto", "--from", from]);
    let (code, _, noted) = plot("1");
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("it sends 1 stroke with 2 points"), "{noted}");
    let (code, _, noted) = plot("2");
    assert_ne!(code, Some(0), "there is nothing behind the last stroke: {noted}");
}

/// Starts to plot rows with these options, and stops the client by Ctrl-C once some are drawn.
/// Returns what it has noted.
fn interrupted(plotter: &Library, folder: &Path, options: &[&str]) -> String {
    plotter.slow.store(true, Ordering::Relaxed);
    let mut client = plotter.plot_rows(folder, options);
    match options.contains(&"host") {
        true => wait_for_strokes(plotter, &mut client),
        false => plotter.wait_for_drawing(&mut client),
    }
    plotter.slow.store(false, Ordering::Relaxed);
    std::thread::sleep(Duration::from_millis(700));
    let sent = Command::new("kill").args(["-INT", &client.id().to_string()]).status();
    assert!(sent.expect("kill runs").success());
    let (code, _, noted) = ended(client);
    assert_eq!(code, Some(130), "{noted}");
    noted
}

/// Waits until most strokes of the rows have come from this client.
fn wait_for_strokes(plotter: &Library, client: &mut Child) {
    while plotter.heard.load(Ordering::Relaxed) < 1000 {
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The plotter computes a drawing in another order than this computer, so that its strokes are not
/// those that --from counts.
#[test]
fn strokes_of_a_drawing_that_the_plotter_has_computed_are_not_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    interrupted(&plotter, folder.path(), &[]);
    let plot = |options: &[&str]| plot_rows(&plotter, folder.path(), options);
    let (code, error) = plot(&["--from", "3"]);
    assert_eq!(code, Some(1), "{error}");
    assert!(error.contains("`penup resume` goes on with it"), "{error}");
    assert!(error.contains("add --compute host"), "{error}");
    // Whoever says that this computer has counted is believed, and told what is counted.
    let (code, noted) = plot(&["--from", "117", "--compute", "host"]);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("it sends 3 strokes"), "{noted}");
    assert!(noted.contains("--from 117 counts in the order of --compute host"), "{noted}");
    // No drawing has stopped any more.
    let (code, noted) = plot(&["--from", "119"]);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("--from 119 counts in the order of --compute host"), "{noted}");
}

/// The user says where the pen is, and the plotter believes that it is elsewhere.
#[test]
fn a_pen_at_the_origin_is_not_believed_to_be_elsewhere() {
    for computer in ["board", "host"] {
        let folder = tempfile::tempdir().expect("a folder");
        let plotter = Library::new();
        interrupted(&plotter, folder.path(), &["--compute", computer]);
        let go_on = |options: &[&str]| match computer {
            "board" => plotter.run(folder.path(), &[&["resume"], options].concat()),
            _ => {
                let options = [&["--resume"], options].concat();
                let mut client = plotter.rows(folder.path(), &options);
                ended(client.stderr(Stdio::piped()).spawn().expect("the program runs"))
            }
        };
        let (code, _, error) = go_on(&["--at-origin"]);
        assert_eq!(code, Some(4), "{computer}: {error}");
        assert!(error.contains("leave out --at-origin; if the pen was moved by hand"), "{error}");
        let (code, _, error) = go_on(&[]);
        assert_eq!(code, Some(0), "{computer}: {error}");
    }
}

#[test]
fn passes_that_are_left_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let noted = interrupted(&plotter, folder.path(), &["--multipass", "3"]);
    assert!(noted.contains("--multipass 2"), "{noted}");
    // It is unknown which pass it was.
    let plotter = Library::new();
    let options = ["--compute", "host", "--multipass", "3"];
    let mut client = plotter.plot_rows(folder.path(), &options);
    wait_for_strokes(&plotter, &mut client);
    std::thread::sleep(Duration::from_millis(500));
    client.kill().expect("killed");
    client.wait().expect("it ends");
    let (code, said, noted) = ended(plotter.plot_rows(folder.path(), &options));
    assert_eq!((code, said.as_str()), (Some(5), ""), "{noted}");
    assert!(noted.contains("in place of --multipass 3"), "{noted}");
    assert_eq!(plotter.json(folder.path(), &["status"]).1["state"], "Idle");
}

#[test]
fn a_setting_that_has_changed_since_a_drawing_stopped_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    interrupted(&plotter, folder.path(), &["--compute", "host"]);
    assert_eq!(plotter.run(folder.path(), &["set", "3=1"]).0, Some(0));
    let mut client = plotter.rows(folder.path(), &["--resume"]);
    let (code, _, error) = ended(client.stderr(Stdio::piped()).spawn().expect("it runs"));
    assert_eq!(code, Some(1), "{error}");
    assert!(error.contains("setting 3 of the machine to 0"), "{error}");
    assert!(error.contains("`penup plot FILE --port DEVICE`"), "{error}");
    assert!(!error.contains("penup again"), "{error}");
}
