//! The first column of the short table: [`NameColumn`].

use std::collections::BTreeSet;

use crate::text::words::shorten_middle;

/// Width of the column of a level, in characters.
pub(super) const LEVEL: usize = 7;

/// The first column of the table: names, cut to a width.
pub(super) struct NameColumn {
    width: usize,
    /// Cut names that several different names share.
    alike: BTreeSet<String>,
}

impl NameColumn {
    /// A column of at most `width` characters for these names.
    pub(super) fn new<'a>(names: impl Iterator<Item = &'a str>, width: usize) -> Self {
        let names: BTreeSet<&str> = names.collect();
        let mut seen = BTreeSet::new();
        let alike = names
            .into_iter()
            .map(|name| shorten_middle(name, width))
            .filter(|name| !seen.insert(name.clone()))
            .collect();
        Self { width, alike }
    }

    /// A line of the table. A name that cannot be told from another one when it is cut has a line of its own above it.
    pub(super) fn line(
        &self,
        name: &str,
        values: impl Iterator<Item = String>,
        reach: &str,
    ) -> String {
        let (width, mut text, mut short) =
            (self.width, String::new(), shorten_middle(name, self.width));
        if self.alike.contains(&short) {
            text = format!(" {name}\n");
            short.clear();
        }
        let values = values
            .map(|value| format!("{value:>LEVEL$}"))
            .collect::<Vec<_>>()
            .concat();
        let line = format!(" {short:<width$}{values}  {reach}");
        text + line.trim_end() + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::NameColumn;

    #[test]
    fn names_that_are_cut_to_the_same_letters_stand_whole() {
        let names = ["vision-one-instruct", "vision-two-instruct", "raw"];
        let column = NameColumn::new(names.into_iter(), 12);
        let line = |name| column.line(name, ["50.0".to_owned()].into_iter(), "−1 +2");
        assert_eq!(
            line(names[0]),
            " vision-one-instruct\n                50.0  −1 +2\n"
        );
        assert_ne!(line(names[0]), line(names[1]));
        assert_eq!(line(names[2]), " raw            50.0  −1 +2\n");
        let single = NameColumn::new(names[..1].iter().copied(), 12);
        let line = single.line(names[0], std::iter::empty(), "");
        assert_eq!(line, " visio…struct\n");
    }
}
