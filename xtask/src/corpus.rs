//! Draws every file of public collections by `penup preview`, and says what became of each.
//!
//! The collections are the test files of other programs, at fixed commits, which are fetched into
//! `target/corpus`. A file may be refused, with a sentence. It must not make the client panic, keep
//! it busy without end, or leave an empty page without a word.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use crate::command::{cargo, output, run, run_within};

/// A collection of files.
struct Corpus {
    name: &'static str,
    /// The repository on GitHub, and the commit.
    repository: &'static str,
    commit: &'static str,
    /// The extensions of the files that are drawn.
    extensions: &'static [&'static str],
}

/// The extensions of HP-GL.
const HPGL: &[&str] = &["hpg", "hpgl", "plt"];

/// The collections.
const CORPORA: [Corpus; 21] = [
    Corpus {
        name: "resvg",
        repository: "linebender/resvg",
        commit: "08c79a3148df4ce8ab08fca72204b142b95423dd",
        extensions: &["svg"],
    },
    Corpus {
        name: "vpype",
        repository: "abey79/vpype",
        commit: "8dad3ec678e8298145b4533dffe8acfca3c70005",
        extensions: &["svg"],
    },
    Corpus {
        name: "saxi",
        repository: "nornagon/saxi",
        commit: "48bc62b42c983803809b3926e697678c78ef788c",
        extensions: &["svg"],
    },
    Corpus {
        name: "dxf",
        repository: "skymakerolof/dxf",
        commit: "9895f4f23dbda0ce504dc7b5cc1715a3c66f5ba8",
        extensions: &["dxf"],
    },
    Corpus {
        name: "axidraw",
        repository: "evil-mad/axidraw",
        commit: "a0df054f41f8e3ae8d408e08e7b2656968e375f1",
        extensions: &["svg"],
    },
    Corpus {
        name: "inkcut",
        repository: "inkcut/inkcut",
        commit: "c7a0c68980d03444f03bc019a3b4d82202efea32",
        extensions: &["svg"],
    },
    Corpus {
        name: "kibot",
        repository: "INTI-CMNB/KiBot",
        commit: "7362376188c458db5d38f5bee256d4cd52ee16b8",
        extensions: &["svg"],
    },
    Corpus {
        name: "drawio",
        repository: "jgraph/drawio-diagrams",
        commit: "4e36051b6d58c12fa3e6f105f6b28cd093ee9bad",
        extensions: &["svg"],
    },
    Corpus {
        name: "logos",
        repository: "gilbarbara/logos",
        commit: "42037415f0df19cd82b3853c18a967a81783f921",
        extensions: &["svg"],
    },
    Corpus {
        name: "openscad",
        repository: "openscad/openscad",
        commit: "e4fdec49730103274a4e21c2390b9a12882f01aa",
        extensions: &["dxf", "svg"],
    },
    Corpus {
        name: "ezdxf",
        repository: "mozman/ezdxf",
        commit: "5ffc690746f1a993ff0c10f4dcd408b4ecedde59",
        extensions: &["dxf"],
    },
    Corpus {
        name: "hpgl-plotter",
        repository: "VK2BEA/HPGL-Plotter",
        commit: "9189b0342abff627fe88d2c0005e17cbcaf94bc6",
        extensions: HPGL,
    },
    Corpus {
        name: "hpgl-viewer",
        repository: "bblanchon/HpglViewer",
        commit: "cf8146f2da49cd5fac019172bd3a52ef96dd43a5",
        extensions: HPGL,
    },
    Corpus {
        name: "chiplotle",
        repository: "drepetto/chiplotle",
        commit: "c3b9faacd316bae1039da06f316f3bf9a79c1f54",
        extensions: HPGL,
    },
    Corpus {
        name: "hpgl2ps",
        repository: "jwilk-archive/hpgl2ps",
        commit: "68f42d158eb5c4a24f6e2b5cf5742be965a23a28",
        extensions: HPGL,
    },
    Corpus {
        name: "monoplots",
        repository: "h42i/monoplots",
        commit: "faa7a598a07c21a4ec097da400e380da706b413a",
        extensions: HPGL,
    },
    Corpus {
        name: "kicad-hpgl",
        repository: "DylanVanAssche/java-hpgl2gcode",
        commit: "7fda3f97736acf756707f60d3b2d8a131fcbc305",
        extensions: HPGL,
    },
    Corpus {
        name: "kicad-laser",
        repository: "temagrin/KicadHPGL2Gcode",
        commit: "fedd2c40eac161f1768f20ee07255367a0b14b87",
        extensions: HPGL,
    },
    Corpus {
        name: "tinyobjloader",
        repository: "tinyobjloader/tinyobjloader",
        commit: "b5346fac929c8a862a1c1d4d89db5477d30b7e6f",
        extensions: &["obj"],
    },
    Corpus {
        name: "common-3d-test-models",
        repository: "alecjacobson/common-3d-test-models",
        commit: "8a4f8642acaf43f9cd7b67858a1502e1055ef202",
        extensions: &["obj"],
    },
    Corpus {
        name: "online-3d-viewer",
        repository: "kovacsv/Online3DViewer",
        commit: "f4260cc7be355b3cfe0fa6cb421d2864bc396133",
        extensions: &["obj", "ply", "stl"],
    },
];

/// How long fetching a collection may take.
const FETCH_LIMIT: Duration = Duration::from_secs(900);

/// What is drawn.
#[derive(clap::Args)]
pub struct Arguments {
    /// The only collection to draw.
    #[arg(long, value_parser = CORPORA.map(|corpus| corpus.name))]
    only: Option<String>,
    /// After how many seconds a file takes too long.
    #[arg(long, default_value_t = 300)]
    limit: u64,
}

/// What became of a file.
enum Fate {
    Drawn,
    /// Refused with this sentence.
    Refused(String),
    Panicked(String),
    TookTooLong,
    /// Nothing is drawn, and nothing is said about it.
    Empty,
}

/// Draws all files of the collections, and prints a table.
///
/// # Errors
/// A collection cannot be fetched, or a file made the client panic, took too long, or was drawn as
/// an empty page in silence. The other collections and files are drawn first.
pub fn draw_all(arguments: &Arguments) -> Result<()> {
    let mut build = cargo();
    build.current_dir(crate::root()).args(["build", "--quiet", "--package", "penup-client"]);
    run(build.args(["--bin", "penup"]))?;
    let client = crate::root().join("target/debug/penup");
    let limit = Duration::from_secs(arguments.limit);
    let (mut rows, mut sentences, mut faults) = (Vec::new(), BTreeMap::new(), Vec::new());
    let is_chosen =
        |corpus: &&Corpus| arguments.only.as_deref().is_none_or(|only| only == corpus.name);
    for corpus in CORPORA.iter().filter(is_chosen) {
        let folder = match fetch(corpus) {
            Ok(folder) => folder,
            Err(reason) => {
                rows.push(format!("| {} | not fetched | | | | | |", corpus.name));
                faults.push(format!("{} is not fetched: {reason:#}", corpus.name));
                continue;
            }
        };
        let mut files = Vec::new();
        find(&folder, corpus.extensions, &mut files)?;
        ensure!(!files.is_empty(), "{} has no files to draw", corpus.name);
        files.sort();
        say!("penup: drawing {} files of {}", files.len(), corpus.name)?;
        let mut counts = [0; 5];
        for (file, fate) in files.iter().zip(draw(&client, &files, limit)?) {
            let shown = format!("{}/{}", corpus.name, file.strip_prefix(&folder)?.display());
            let column = match fate {
                Fate::Drawn => 0,
                Fate::Refused(sentence) => {
                    let (count, example) = sentences.entry(sentence).or_insert((0, shown));
                    let _: &String = example;
                    *count += 1;
                    1
                }
                Fate::Panicked(message) => {
                    faults.push(format!("{shown} panicked: {message}"));
                    2
                }
                Fate::TookTooLong => {
                    faults.push(format!("{shown} took more than {} s", arguments.limit));
                    3
                }
                Fate::Empty => {
                    faults.push(format!("{shown} is empty, and nothing is said about it"));
                    4
                }
            };
            counts[column] += 1;
        }
        let [drawn, refused, panicked, late, empty] = counts;
        let (name, all) = (corpus.name, files.len());
        rows.push(format!(
            "| {name} | {all} | {drawn} | {refused} | {panicked} | {late} | {empty} |"
        ));
    }
    say!("| files of | all | drawn | refused | panicked | took too long | empty in silence |")?;
    say!("|---|---|---|---|---|---|---|")?;
    for row in rows {
        say!("{row}")?;
    }
    let mut sentences: Vec<_> = sentences.into_iter().collect();
    sentences.sort_by_key(|(_, (count, _))| std::cmp::Reverse(*count));
    say!("\n| refused | with the sentence | for example |\n|---|---|---|")?;
    for (sentence, (count, example)) in sentences {
        say!("| {count} | {sentence} | {example} |")?;
    }
    if !faults.is_empty() {
        bail!("this went wrong:\n{}", faults.join("\n"));
    }
    Ok(())
}

/// Fetches a collection, unless it is there, and returns its folder.
fn fetch(corpus: &Corpus) -> Result<PathBuf> {
    let folder = crate::root().join("target/corpus").join(corpus.name);
    let path = folder.display().to_string();
    let here = output("git", &["-C", &path, "rev-parse", "--verify", "HEAD"]);
    // A folder without a repository of its own belongs to that of penup.
    if folder.join(".git").exists() && here.as_deref() == Some(corpus.commit) {
        return Ok(folder);
    }
    ensure!(output("git", &["--version"]).is_some(), "there is no git: install it");
    say!("penup: fetching {} into {path}", corpus.repository)?;
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let git = |arguments: &[&str]| {
        let mut git = Command::new("git");
        git.current_dir(&folder).args(arguments);
        run_within(FETCH_LIMIT, &mut git)
    };
    let address = format!("https://github.com/{}", corpus.repository);
    git(&["init", "--quiet"])?;
    git(&["fetch", "--quiet", "--depth", "1", &address, corpus.commit])
        .with_context(|| format!("cannot fetch {address}"))?;
    // What lies in a large-file store is left out: its pointers are no drawings.
    git(&["-c", "advice.detachedHead=false", "checkout", "--quiet", corpus.commit])?;
    Ok(folder)
}

/// Finds all files with these extensions.
fn find(folder: &Path, extensions: &[&str], files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_dir() {
            find(&path, extensions, files)?;
        } else if extensions.contains(&&*extension) && !is_pointer(&path)? {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether the file only says where a large-file store has it.
fn is_pointer(path: &Path) -> Result<bool> {
    const POINTER: &[u8] = b"version https://git-lfs.github.com/";
    Ok(fs::metadata(path)?.len() < 1024 && fs::read(path)?.starts_with(POINTER))
}

/// Draws the files, as many at once as there are cores, and returns what became of each.
fn draw(client: &Path, files: &[PathBuf], limit: Duration) -> Result<Vec<Fate>> {
    let (next, fates) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let scratch = crate::root().join("target/corpus/scratch");
    fs::create_dir_all(&scratch)?;
    let workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        let worker = |number: usize| {
            let (next, fates, scratch) = (&next, &fates, &scratch);
            scope.spawn(move || -> Result<()> {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(file) = files.get(index) else { return Ok(()) };
                    let fate = draw_one(client, file, &scratch.join(number.to_string()), limit)?;
                    if let Ok(mut fates) = fates.lock() {
                        fates.insert(index, fate);
                    }
                }
            })
        };
        let workers: Vec<_> = (0..workers).map(worker).collect();
        for worker in workers {
            worker.join().map_err(|_| anyhow::anyhow!("a worker panicked"))??;
        }
        Ok::<_, anyhow::Error>(())
    })?;
    Ok(fates.into_inner().unwrap_or_default().into_values().collect())
}

/// Draws a file.
fn draw_one(client: &Path, file: &Path, scratch: &Path, limit: Duration) -> Result<Fate> {
    let [said, picture] = ["txt", "svg"].map(|extension| scratch.with_extension(extension));
    let log = fs::File::create(&said)?;
    let mut child = Command::new(client)
        .arg("preview")
        .arg(file)
        .arg("--svg")
        .arg(&picture)
        .stdin(Stdio::null())
        .stdout(log.try_clone()?)
        .stderr(log)
        .spawn()
        .with_context(|| format!("cannot run {}", client.display()))?;
    let deadline = Instant::now() + limit;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if Instant::now() > deadline {
            // It fails only if the child has just ended by itself.
            let _ = child.kill();
            child.wait()?;
            return Ok(Fate::TookTooLong);
        }
        thread::sleep(Duration::from_millis(5));
    };
    let said = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
    let path = file.display().to_string();
    Ok(judge(status.code(), &said, &path))
}

/// What became of the file, by the exit code of the client and by what it said.
fn judge(code: Option<i32>, said: &str, path: &str) -> Fate {
    if let Some(panic) = said.lines().find(|line| line.contains("panicked at")) {
        return Fate::Panicked(panic.to_owned());
    }
    let mut told = said.lines().filter_map(|line| line.strip_prefix("penup: "));
    let refusal = told.rfind(|told| !told.starts_with("note: "));
    match (code, refusal) {
        // A panic of the client is 101; no code is a signal, such as that of a full stack.
        (None | Some(101), _) => Fate::Panicked(said.lines().last().unwrap_or("").to_owned()),
        (Some(0), _) => match strokes(said) {
            Some(0) | None => Fate::Empty,
            Some(_) => Fate::Drawn,
        },
        (Some(_), Some(refusal)) => Fate::Refused(sentence(refusal, path)),
        (Some(code), None) => Fate::Panicked(format!("it ended with {code} without a word")),
    }
}

/// How many strokes the client says that it has drawn.
fn strokes(said: &str) -> Option<u64> {
    let counts = (said.lines())
        .filter_map(|line| line.split_once(" strokes, ").or(line.split_once(" stroke, ")))
        .map(|(before, _)| before);
    counts.filter_map(|before| before.rsplit(' ').next()?.parse().ok()).next_back()
}

/// The sentence of a refusal without what belongs to the file: its path, and numbers.
fn sentence(refusal: &str, path: &str) -> String {
    let text = refusal.replace(path, "");
    let mut sentence = String::new();
    for letter in text.trim_start_matches([':', ' ']).chars() {
        let letter = if letter.is_ascii_digit() { '0' } else { letter };
        if letter != '0' || !sentence.ends_with('0') {
            sentence.push(letter);
        }
    }
    sentence.trim_start_matches(['0', ':', ' ']).replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_judged_by_what_the_client_says() {
        let drawn = "a.svg: 5 strokes, 470.4 mm drawn, 98.4 mm between them";
        assert!(matches!(judge(Some(0), drawn, "a.svg"), Fate::Drawn));
        let empty = "a.svg: 0 strokes, 0.0 mm drawn";
        assert!(matches!(judge(Some(0), empty, "a.svg"), Fate::Empty));
        assert!(matches!(judge(Some(0), "", "a.svg"), Fate::Empty));
        let panic = "thread 'main' panicked at src/a.rs:1:2:\nno\n";
        assert!(matches!(judge(Some(101), panic, "a.svg"), Fate::Panicked(_)));
        assert!(matches!(judge(None, "", "a.svg"), Fate::Panicked(_)));
        assert!(matches!(judge(Some(2), "", "a.svg"), Fate::Panicked(_)));
        let noted =
            "penup: note: a.svg: it sends the strokes, and more\na.svg: 1 stroke, 9 mm drawn";
        assert!(matches!(judge(Some(0), noted, "a.svg"), Fate::Drawn));
        let refused =
            "penup: note: /b/a.obj: no unit\npenup: /b/a.obj:12: face 7 has 2 corners\n    f 1 2\n";
        match judge(Some(1), refused, "/b/a.obj") {
            Fate::Refused(sentence) => assert_eq!(sentence, "face 0 has 0 corners"),
            _ => panic!("it is refused"),
        }
    }
}
