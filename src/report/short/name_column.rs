//! Column of names in the short table: [`NameColumn`].

use std::collections::BTreeSet;

use crate::report::text::words::shorten_middle;

/// Width of the column of a level, in characters.
pub(super) const LEVEL_WIDTH: usize = 7;

/// First column of the table: names, shortened to a width.
pub(super) struct NameColumn {
    width: usize,
    /// Shortened names that several different names have in common.
    ambiguous: BTreeSet<String>,
}

impl NameColumn {
    /// Column of at most `width` characters for some names.
    pub(super) fn new<'a>(names: impl Iterator<Item = &'a str>, width: usize) -> Self {
        let names: BTreeSet<&str> = names.collect();
        let mut seen = BTreeSet::new();
        let ambiguous = names
            .into_iter()
            .map(|name| shorten_middle(name, width))
            .filter(|name| !seen.insert(name.clone()))
            .collect();
        Self { width, ambiguous }
    }

    /// Formats a row: name, values, and the reach of the widest interval. A name that is ambiguous when shortened gets
    /// its own line above the values.
    pub(super) fn line(&self, name: &str, values: impl Iterator<Item = String>, reach: &str) -> String {
        let width = self.width;
        let mut text = String::new();
        let mut short = shorten_middle(name, width);
        if self.ambiguous.contains(&short) {
            text = format!(" {name}\n");
            short.clear();
        }
        let values: String = values.map(|value| format!("{value:>LEVEL_WIDTH$}")).collect();
        let line = format!(" {short:<width$}{values}  {reach}");
        text + line.trim_end() + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::NameColumn;

    #[test]
    fn ambiguous_names_are_not_shortened() {
        let names = ["vision-one-instruct", "vision-two-instruct", "raw"];
        let column = NameColumn::new(names.into_iter(), 12);
        let [first, second, third] = names.map(|name| column.line(name, ["50.0".to_owned()].into_iter(), "−1 +2"));
        assert_eq!(first, " vision-one-instruct\n                50.0  −1 +2\n");
        assert_ne!(first, second);
        assert_eq!(third, " raw            50.0  −1 +2\n");
        let single = NameColumn::new(names[..1].iter().copied(), 12);
        let line = single.line(names[0], std::iter::empty(), "");
        assert_eq!(line, " visio…struct\n");
    }
}
