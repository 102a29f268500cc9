//! What all instances of a problem came to, as one cell of a table.

use std::fmt::{Display, Formatter, Result};

/// Numbers of which a table shows the median, and in brackets the least and the greatest.
pub struct Sample {
    sorted: Vec<f64>,
    decimals: usize,
}

impl Sample {
    /// Numbers to be shown with so many decimals.
    pub fn new(numbers: impl Iterator<Item = f64>, decimals: usize) -> Self {
        let mut sorted: Vec<f64> = numbers.collect();
        sorted.sort_by(f64::total_cmp);
        Self { sorted, decimals }
    }

    /// Whole numbers.
    pub fn of_counts(numbers: impl Iterator<Item = u64>) -> Self {
        Self::new(numbers.map(|number| number as f64), 0)
    }
}

impl Display for Sample {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> Result {
        let count = self.sorted.len();
        let (Some(least), Some(greatest)) = (self.sorted.first(), self.sorted.last()) else {
            return formatter.write_str("-");
        };
        // Of an even count the mean of the two in the middle.
        let median = (self.sorted[(count - 1) / 2] + self.sorted[count / 2]) / 2.0;
        let decimals = self.decimals;
        write!(formatter, "{median:.decimals$}")?;
        if least < greatest {
            write!(formatter, " ({least:.decimals$} to {greatest:.decimals$})")?;
        }
        Ok(())
    }
}
