//! Counts elements of one kind, for what the user is told.

use super::runs;
use usvg::roxmltree::{Document, Node};

/// How many elements of one kind there are, and in which line the first one begins.
#[derive(Debug, Default)]
pub(super) struct Count {
    number: usize,
    line: u32,
}

impl Count {
    pub(super) fn add(&mut self, document: &Document<'_>, node: Node<'_, '_>) {
        if self.number == 0 {
            // Only once for each kind, because the position is counted from the beginning.
            self.line = document.text_pos_at(node.range().start).row;
        }
        self.number += runs::count(node);
    }

    pub(super) fn say(&self, said: &mut Vec<String>, [one, many]: [&str; 2], what: &str) {
        let Self { number, line } = self;
        match number {
            0 => {}
            1 => said.push(format!("1 {one} {what} (line {line})")),
            _ => said.push(format!("{number} {many} {what} (the first in line {line})")),
        }
    }
}
