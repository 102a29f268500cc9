//! A table in Markdown.

use std::fmt::{Display, Formatter, Result};

/// Text in columns, right-aligned.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(heading: &[&str]) -> Self {
        Self { rows: vec![heading.iter().map(ToString::to_string).collect()] }
    }

    pub fn row(&mut self, cells: &[&dyn Display]) {
        self.rows.push(cells.iter().map(ToString::to_string).collect());
    }
}

impl Display for Table {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> Result {
        let columns = self.rows[0].len();
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max();
        let widths: Vec<usize> = (0..columns).filter_map(width).collect();
        for (number, row) in self.rows.iter().enumerate() {
            for (cell, &width) in row.iter().zip(&widths) {
                write!(formatter, "| {cell:>width$} ")?;
            }
            writeln!(formatter, "|")?;
            if number == 0 {
                for &width in &widths {
                    write!(formatter, "|{:->1$}:", "", width + 1)?;
                }
                writeln!(formatter, "|")?;
            }
        }
        Ok(())
    }
}
