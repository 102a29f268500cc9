//! The options of the page that arrange plans.

use penup_readers::page::Page;
use penup_readers::{Arrangement, PLAN_OPTIONS, Turn};

/// The height of the title's capitals in mm where the user says nothing.
const DEFAULT_TITLE_SIZE: f64 = 5.0;

/// What `options`, pairs of name and value, say about a plan.
///
/// # Errors
/// A value is refused, or two options contradict each other; the sentence names the options.
pub fn arrangement(options: &[(String, String)]) -> Result<Arrangement, String> {
    let given = |name: &str| {
        let option = options.iter().rfind(|(own, _)| own == name);
        option.map(|(_, value)| value.trim())
    };
    let page = given("page").and_then(|page| Page::parse(page).ok());
    let turn = match given("landscape") {
        None => Turn::AsItIs,
        Some("auto") => Turn::Automatic,
        Some(_) => Turn::Landscape,
    };
    let margin = given("margin").and_then(|margin| margin.parse().ok());
    if given("pens") == Some("one") && given("layer-order").is_some() {
        return Err(
            "--pens one draws all layers with one pen: leave out --layer-order, or --pens \
                    one"
            .to_owned(),
        );
    }
    let mut arrangement = Arrangement::on(page, turn, margin);
    if given("fit").is_some() {
        let size = given("title-size").and_then(|size| size.parse().ok());
        let title = given("title").unwrap_or_default();
        arrangement = arrangement.fitted(title, size.unwrap_or(DEFAULT_TITLE_SIZE));
    }
    for option in PLAN_OPTIONS {
        if let Some(value) = given(option.name) {
            if option.changes_size && given("fit").is_some() {
                return Err(format!(
                    "--fit chooses the size and the place: leave out --{}, or --fit",
                    option.name
                ));
            }
            let refused = |reason| format!("--{}: {reason}", option.name);
            arrangement.set(option.name, value).map_err(refused)?;
        }
    }
    Ok(arrangement)
}
