//! Checks that docs/memory.md agrees with the library.

use penup::plotter::budget::{BUDGETS, Budget};

/// The table of docs/memory.md.
fn table() -> String {
    type Row = (&'static str, fn(&Budget) -> usize);
    let rows: [Row; 10] = [
        ("vertices, at most", |budget| budget.vertex_limit),
        ("corners of faces and ends of bars, at most", |budget| budget.corner_limit),
        ("**model, bytes**", |budget| budget.model),
        ("**working memory, bytes**", |budget| budget.working),
        ("view", |budget| budget.view),
        ("visibility, at least", |budget| budget.visibility),
        ("lines as they are found", |budget| budget.lines),
        ("drawing", |budget| budget.drawing),
        ("order: the tour", |budget| budget.tour),
        ("order: exact matching", |budget| budget.matching),
    ];
    let boards: String = BUDGETS.iter().map(|budget| format!(" {} |", budget.board)).collect();
    let mut table = format!("| |{boards}\n|---|---|---|\n");
    for (name, bytes) in rows {
        let cells: String = BUDGETS.iter().map(|budget| format!(" {} |", bytes(budget))).collect();
        table += &format!("| {name} |{cells}\n");
    }
    table
}

#[test]
fn the_document_says_what_the_library_has() {
    let document = include_str!("../../docs/memory.md");
    assert!(document.contains(&table()), "docs/memory.md needs this table:\n{}", table());
}
