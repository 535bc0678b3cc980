//! A figure of counts by name: [`CountPanel`].

/// Most bars of a panel.
const MAX_BARS: usize = 24;

/// Counts by name, drawn as bars.
#[derive(Debug, Clone)]
pub(crate) struct CountPanel {
    pub title: String,
    pub bars: Vec<(String, u64)>,
}

impl CountPanel {
    /// A panel with the largest counts first. If there are more than [`MAX_BARS`], the smallest share one bar.
    pub(crate) fn ranked(title: &str, counts: impl Iterator<Item = (String, u64)>) -> Self {
        let mut bars: Vec<(String, u64)> = counts.filter(|(_, count)| *count > 0).collect();
        bars.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if bars.len() > MAX_BARS {
            let rest = bars.split_off(MAX_BARS - 1);
            bars.push((
                format!("{} others", rest.len()),
                rest.iter().map(|(_, count)| count).sum(),
            ));
        }
        Self {
            title: title.to_owned(),
            bars,
        }
    }
}
