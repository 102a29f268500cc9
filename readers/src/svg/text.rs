//! The fonts of the texts of an SVG: which serve, and which are missing.
//!
//! A text is drawn in the first of its families that there is. Where there is none, another font
//! serves, and the user is told which one stands for which.

use crate::counted;
use crate::fonts::Fonts;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, PoisonError};
use usvg::fontdb::{Database, Family, ID, Query, Stretch, Style, Weight};
use usvg::{Font, FontFamily, FontResolver, Text};

/// The family of a text that names none, as browsers choose it.
const USUAL: &str = "serif";

/// What became of the fonts of a file.
#[derive(Debug, Default)]
struct Chosen {
    /// For each font that a text asks for, the families that are missing and the one that serves.
    served: HashMap<Font, Served>,
    /// Letters that none of the fonts has, at least one for each piece of a text with such.
    missing_letters: BTreeSet<char>,
}

/// The family that serves for a font.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Served {
    /// The families that were asked for, if there is none of them.
    missing: Vec<String>,
    /// The family that serves.
    by: String,
}

/// The fonts for one file, and notes on what became of them.
#[derive(Debug)]
pub(super) struct TextFonts {
    database: Arc<Database>,
    chosen: Arc<Mutex<Chosen>>,
}

impl TextFonts {
    /// Looks for `fonts`; `None` if the caller knows none.
    pub(super) fn find(fonts: Fonts) -> Option<Self> {
        let database = Arc::new(fonts.find()?);
        Some(Self { database, chosen: Arc::default() })
    }

    /// Lets `usvg` draw texts in these fonts.
    pub(super) fn serve(&self, options: &mut usvg::Options<'_>) {
        let (of_font, of_letter) = (self.chosen.clone(), self.chosen.clone());
        let fallback = FontResolver::default_fallback_selector();
        options.fontdb = self.database.clone();
        USUAL.clone_into(&mut options.font_family);
        options.font_resolver = FontResolver {
            select_font: Box::new(move |font, database| {
                let (id, served) = select(font, database)?;
                lock(&of_font).served.insert(font.clone(), served);
                Some(id)
            }),
            select_fallback: Box::new(move |letter, used, database| {
                let found = fallback(letter, used, database);
                // `usvg` also asks for letters without a shape, such as spaces. They are drawn as
                // nothing, and so are not missing.
                if found.is_none() && !letter.is_control() && !letter.is_whitespace() {
                    lock(&of_letter).missing_letters.insert(letter);
                }
                found
            }),
        };
    }

    /// Returns sentences about the fonts and letters of `texts` that are missing.
    pub(super) fn notes(&self, texts: &[&Text]) -> Vec<String> {
        let chosen = lock(&self.chosen);
        let mut replaced: BTreeMap<Served, usize> = BTreeMap::new();
        for text in texts {
            let spans = text.chunks().iter().flat_map(|chunk| chunk.spans());
            let served = spans.filter_map(|span| chosen.served.get(span.font()));
            let missing: BTreeSet<&Served> =
                served.filter(|served| !served.missing.is_empty()).collect();
            for served in missing {
                *replaced.entry(served.clone()).or_default() += 1;
            }
        }
        let mut notes = Vec::new();
        for (Served { missing, by }, number) in replaced {
            let fonts = if missing.len() == 1 { "the font" } else { "none of the fonts" };
            let is = if missing.len() == 1 { "is missing" } else { "is there" };
            notes.push(format!(
                "{} drawn in {by}, because {fonts} {} {is}",
                counted(number, ["text is", "texts are"]),
                missing.join(", ")
            ));
        }
        if !chosen.missing_letters.is_empty() {
            let letters: Vec<String> =
                chosen.missing_letters.iter().take(20).map(char::to_string).collect();
            // For each piece of a text, `usvg` asks only for the first missing letter.
            notes.push(format!(
                "letters are not drawn as such, because no font has them, among them: {}",
                letters.join(" ")
            ));
        }
        notes
    }
}

fn lock(chosen: &Mutex<Chosen>) -> std::sync::MutexGuard<'_, Chosen> {
    chosen.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The face that serves for `font`, and what is said about it; `None` if there are no fonts.
fn select(font: &Font, database: &Database) -> Option<(ID, Served)> {
    let query = |families: &[Family<'_>]| {
        database.query(&Query {
            families,
            weight: Weight(font.weight()),
            stretch: Stretch::from(font.stretch()),
            style: Style::from(font.style()),
        })
    };
    let asked: Vec<Family<'_>> = font.families().iter().map(family).collect();
    if let Some(id) = query(&asked) {
        return Some((id, Served { missing: Vec::new(), by: name(database, id)? }));
    }
    let generic = [Family::SansSerif, Family::Serif, Family::Monospace];
    let names: BTreeSet<&str> = database
        .faces()
        .filter_map(|face| face.families.first())
        .map(|(name, _)| name.as_str())
        .collect();
    let any: Vec<Family<'_>> = names.into_iter().map(Family::Name).collect();
    let id = query(&generic).or_else(|| query(&any))?;
    // A file that asks for any font with serifs misses nothing when another one serves.
    let is_named =
        |family: &&FontFamily| matches!(family, FontFamily::Named(name) if name != USUAL);
    let named = font.families().iter().filter(is_named);
    let missing = named.map(ToString::to_string).map(|name| name.replace('"', "")).collect();
    Some((id, Served { missing, by: name(database, id)? }))
}

/// The name of the family to which a face belongs.
fn name(database: &Database, id: ID) -> Option<String> {
    let face = database.face(id)?;
    face.families.first().map(|(name, _)| name.clone())
}

fn family(family: &FontFamily) -> Family<'_> {
    match family {
        FontFamily::Serif => Family::Serif,
        FontFamily::SansSerif => Family::SansSerif,
        FontFamily::Cursive => Family::Cursive,
        FontFamily::Fantasy => Family::Fantasy,
        FontFamily::Monospace => Family::Monospace,
        FontFamily::Named(name) if name == USUAL => Family::Serif,
        FontFamily::Named(name) => Family::Name(name),
    }
}
