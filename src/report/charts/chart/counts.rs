//! Bar panels of counts by name: [`CountPanel`].

/// Maximum number of bars in a panel (chosen).
const MAX_BARS: usize = 24;

/// Counts by name, drawn as bars.
#[derive(Debug, Clone)]
pub(crate) struct CountPanel {
    pub title: String,
    pub bars: Vec<(String, u64)>,
}

impl CountPanel {
    /// Sorts the counts from the largest and leaves out zeros. If more than [`MAX_BARS`] remain, the smallest are added
    /// up in one bar.
    pub(crate) fn from_counts(title: &str, counts: impl Iterator<Item = (String, u64)>) -> Self {
        let mut bars: Vec<(String, u64)> = counts.filter(|(_, count)| *count > 0).collect();
        bars.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if bars.len() > MAX_BARS {
            let rest = bars.split_off(MAX_BARS - 1);
            bars.push((format!("{} others", rest.len()), rest.iter().map(|(_, count)| count).sum()));
        }
        Self { title: title.to_owned(), bars }
    }
}
