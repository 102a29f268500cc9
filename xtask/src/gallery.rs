//! Makes the gallery: a page with the figures of the papers, drawn by penup, and the picture that
//! README begins with.

use std::fmt::Write as _;
use std::fs;

use anyhow::{Context, Result, bail};

use crate::command::{cargo, run};

/// The scene of README's picture, and the options with which it is drawn.
const GEARS: [&str; 11] = [
    "scenes/gears.obj",
    "--board",
    "pico",
    "--eye=-22.3,-118.7,88.9",
    "--at=0,-3,4",
    "--crease",
    "40",
    "--page",
    "240x158",
    "--margin",
    "6",
];

/// A figure of the page.
struct Figure {
    /// The figure's number and caption in the paper.
    title: &'static str,
    /// The name of the scene's file, without its ending.
    scene: &'static str,
    /// The options with which it is drawn.
    view: &'static [&'static str],
    /// Whether the figure is drawn once, with only these options. Otherwise it is drawn twice: with
    /// hidden lines dotted, and erased.
    alone: bool,
}

/// A figure that is drawn with hidden lines dotted, and again with hidden lines erased.
const fn hidden(title: &'static str, scene: &'static str, view: &'static [&'static str]) -> Figure {
    Figure { title, scene, view, alone: false }
}

/// A figure that is drawn once.
const fn plain(title: &'static str, scene: &'static str, view: &'static [&'static str]) -> Figure {
    Figure { title, scene, view, alone: true }
}

/// The chapters of the page, with their figures.
const CHAPTERS: [(&str, &[Figure]); 6] = [
    (
        "Projections (Harrison, chapter 2)",
        &[
            plain("Figure 3: a rotating cube", "rotating", &["--see", "wire"]),
            plain("Figure 4: a non-convex polyhedron", "notched", &["--see", "wire"]),
            plain("Figure 5: a wire frame", "lattice2", &["--see", "wire"]),
            plain("Figure 6: a wire frame", "icosahedron", &["--see", "wire"]),
            plain("Figure 7: the effect of perspective, from near", "lattice3", &["--eye=-2,-4,6"]),
            plain("and from afar", "lattice3", &["--eye=-20,-40,60"]),
            plain("Isometric", "lblock", &["--projection", "isometric"]),
            plain("Cavalier", "lblock", &["--projection", "cavalier"]),
        ],
    ),
    (
        "Convex solids, from their vertices alone (Harrison, chapter 3)",
        &[
            hidden("Figures 8 and 14: a cube", "cube", &["--see", "vertices"]),
            hidden("Figures 9 and 11: an icosahedron", "icosahedron", &["--see", "vertices"]),
            hidden("Figures 10, 12 and 17: an octahedron", "octahedron", &["--see", "vertices"]),
            hidden("Figures 13 and 15: 18 faces", "eighteen", &["--see", "vertices"]),
        ],
    ),
    (
        "A convex solid, from its edges (Zámožík and Zaťková)",
        &[hidden("The dodecahedron", "dodecahedron", &["--see", "edges"])],
    ),
    (
        "Any solids (Harrison, chapters 3 and 4)",
        &[
            hidden("Figure 16: a rotating cube", "rotating", &[]),
            hidden("Figures 18 and 19: a block cut to an L", "lblock", &[]),
            hidden("Figures 20 and 21: a notch", "notched", &["--eye=5.5,9,5", "--at=2,1.5,1"]),
            hidden("Figures 22 and 23: eight cubes", "lattice2", &["--eye=-6.37,-8.71,10.13"]),
            hidden("Figures 24 and 25: boxes through each other", "interpen", &[]),
        ],
    ),
    ("Curves (Allard and Bown)", &[plain("Isobars, after their figure 11", "isobars", &["--fit"])]),
    (
        "Titles",
        &[plain(
            "A title in the Hershey font",
            "notched",
            &["--title", "Figure 20 – détail", "--title-size=4"],
        )],
    ),
];

/// Draws every figure into `docs/gallery` and writes the page, and draws README's picture.
pub fn make() -> Result<()> {
    draw_figures()?;
    draw_gears()
}

/// Writes `scenes/gears.obj`, and draws it into `docs/gears.svg`.
fn draw_gears() -> Result<()> {
    let mut example = cargo();
    example.args(["run", "--quiet", "--package", "penup-host-tests", "--example", "gears"]);
    let made = example.current_dir(crate::root()).output().context("cannot run cargo")?;
    if !made.status.success() {
        bail!("the scene cannot be made: {}", String::from_utf8_lossy(&made.stderr).trim());
    }
    let [scene, options @ ..] = GEARS;
    let path = crate::root().join(scene);
    fs::write(&path, made.stdout).with_context(|| format!("cannot write {}", path.display()))?;
    say!("penup: docs/gears.svg")?;
    let picture = crate::root().join("docs/gears.svg");
    let words = [path.display().to_string(), format!("--svg={}", picture.display())];
    let words: Vec<_> = words.into_iter().chain(options.map(str::to_owned)).collect();
    run(&mut crate::client("preview", &words))
}

/// Draws every figure into `docs/gallery` and writes the page.
fn draw_figures() -> Result<()> {
    let folder = crate::root().join("docs/gallery");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut page = String::from(
        "# Gallery\n\nThe figures of the papers, or their like, as penup draws them. Ink is dark, \
         moves with the pen up\nare faint. `cargo xtask gallery` makes this page.\n\n\
         ## A scene of our own\n\n\
         ![A train of gears that a crank turns](../gears.svg)\n\n",
    );
    let scene = count_vertices("gears")?;
    writeln!(
        page,
        "[gears.obj](../../scenes/gears.obj), {scene} vertices, which `host-tests/src/gear_train` \
         makes."
    )?;
    for (chapter, figures) in CHAPTERS {
        write!(page, "\n## {chapter}\n\n| | | |\n|---|---|---|\n")?;
        for figure in figures {
            let (vertices, scene) = (count_vertices(figure.scene)?, figure.scene);
            write!(
                page,
                "| {}; [{scene}.obj](../../scenes/{scene}.obj), {vertices} vertices |",
                figure.title
            )?;
            let hidden_lines: &[&str] = if figure.alone { &[""] } else { &["dotted", "erased"] };
            for hidden in hidden_lines {
                let name = [scene, &words(figure.view), hidden].join("-");
                let name = format!("{}.svg", name.trim_end_matches('-').replace("--", "-"));
                say!("penup: docs/gallery/{name}")?;
                draw(figure, hidden, &folder.join(&name).display().to_string())?;
                write!(page, " ![{} {hidden}]({name}) |", figure.title)?;
            }
            page += if figure.alone { " |\n" } else { "\n" };
        }
    }
    fs::write(folder.join("README.md"), page).context("cannot write the page")
}

/// Draws a figure into the file `to`, with hidden lines drawn as `hidden` says, if it is not empty.
fn draw(figure: &Figure, hidden: &str, to: &str) -> Result<()> {
    let file = crate::root().join(format!("scenes/{}.obj", figure.scene)).display().to_string();
    let mut options = vec![file, format!("--svg={to}"), "--page=80x80".into(), "--margin=3".into()];
    options.extend(figure.view.iter().map(|word| (*word).to_owned()));
    if !hidden.is_empty() {
        options.push(format!("--hidden={hidden}"));
    }
    run(&mut crate::client("preview", &options))
}

/// The part of a file's name that the options give.
fn words(view: &[&str]) -> String {
    let text = view.join("-").replace(['=', ',', ' '], "-");
    let plain = |letter: &char| letter.is_ascii_alphanumeric() || ".-".contains(*letter);
    text.trim_start_matches('-').chars().filter(plain).collect()
}

/// The number of vertices of a scene.
fn count_vertices(scene: &str) -> Result<usize> {
    let path = crate::root().join(format!("scenes/{scene}.obj"));
    let text =
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(text.lines().filter(|line| line.starts_with("v ")).count())
}

#[cfg(test)]
mod tests {
    use super::GEARS;

    #[test]
    fn readme_says_how_its_picture_was_drawn() {
        let readme = include_str!("../../README.md");
        let words = readme.split_whitespace().filter(|&word| word != "\\").collect::<Vec<_>>();
        assert!(words.windows(GEARS.len()).any(|part| part == GEARS), "not {GEARS:?}");
    }
}
