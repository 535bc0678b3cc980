//! What the words of data sets mean: [`meaning()`], from a word to a class of mpcat40.

use std::collections::BTreeMap;
use std::sync::LazyLock;

/// HM3D-Sem's words.
const HM3D: &str = include_str!("hm3d.tsv");
/// What goes before them.
const OVERRIDES: &str = include_str!("overrides.tsv");
/// AI2-THOR's types.
const THOR: &str = include_str!("thor.tsv");

/// The class of what no table has.
pub(crate) const UNKNOWN: &str = "misc";

type NameTable = BTreeMap<&'static str, &'static str>;

fn table(text: &'static str) -> NameTable {
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.filter_map(|line| line.split_once('\t')).collect()
}

static TABLES: LazyLock<[NameTable; 3]> = LazyLock::new(|| [OVERRIDES, HM3D, THOR].map(table));

/// What a word means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// A class of mpcat40.
    Class(&'static str),
    /// Nothing: the data set itself does not know.
    Nothing,
    /// It stands in no table.
    Unlisted,
}

/// A word in the one spelling of the tables: lower case, single spaces, no underscores.
fn spelled(word: &str) -> String {
    let lower = word.to_lowercase().replace('_', " ");
    lower.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What a word of a data set means; the suffixes `/otherroom` and `/outside` say where, not what.
pub(crate) fn meaning(word: &str) -> Meaning {
    let word = spelled(word);
    let bare = [
        "/otherroom",
        "/ otherroom",
        "/other room",
        "/outside",
        "/ outside",
    ]
    .iter()
    .find_map(|suffix| word.strip_suffix(suffix))
    .map_or(word.as_str(), str::trim_end);
    if bare.is_empty() {
        return Meaning::Nothing;
    }
    let [overrides, hm3d, _] = &*TABLES;
    let found = [&word[..], bare]
        .into_iter()
        .find_map(|word| overrides.get(word).or_else(|| hm3d.get(word)));
    match found {
        Some(class) => Meaning::Class(class),
        None if bare.starts_with("unknown") || bare == "unlabeled" => Meaning::Nothing,
        None => Meaning::Unlisted,
    }
}

/// The class of a word of a data set, which is counted as `shown` where it stands in no table; `None` where it means nothing.
pub(crate) fn class_of(
    word: &str,
    shown: &str,
    count: usize,
    unlisted: &mut BTreeMap<String, usize>,
) -> Option<&'static str> {
    match meaning(word) {
        Meaning::Nothing => None,
        Meaning::Class(class) => Some(class),
        Meaning::Unlisted => {
            *unlisted.entry(shown.to_owned()).or_insert(0) += count;
            Some(UNKNOWN)
        }
    }
}

/// The class that goes before what a data set's own table says of a word.
pub(crate) fn overridden(word: &str) -> Option<&'static str> {
    TABLES[0].get(spelled(word).as_str()).copied()
}

/// A type of AI2-THOR (`CoffeeTable`) in words (`coffee table`), with its class.
pub(crate) fn thor(kind: &str) -> (String, &'static str) {
    let mut words = String::new();
    let mut before = ' ';
    for letter in kind.chars() {
        if letter.is_uppercase() && before.is_lowercase() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
        before = letter;
    }
    let class = TABLES[2]
        .get(kind)
        .copied()
        .unwrap_or_else(|| match meaning(&words) {
            Meaning::Class(class) => class,
            Meaning::Nothing | Meaning::Unlisted => "objects",
        });
    (words, class)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::canonical;

    #[test]
    fn every_line_is_a_word_and_a_class() {
        for text in [HM3D, OVERRIDES, THOR] {
            let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
            assert_eq!(table(text).len(), lines.len());
            for (word, class) in table(text) {
                assert!(canonical().contains(class), "{word}: {class}");
            }
            let mut sorted = lines.clone();
            sorted.sort_unstable_by_key(|line| line.split('\t').next());
            assert_eq!(sorted, lines);
        }
        assert_eq!(table(HM3D).len(), 2295);
    }

    #[test]
    fn words_are_found_in_any_spelling() {
        for (word, class) in [
            ("Bed", "bed"),
            (" kitchen  cabinet ", "cabinet"),
            ("bed/otherroom", "bed"),
            ("bed /outside", "bed"),
            ("painting", "picture"),
            ("night_stand", "chest_of_drawers"),
            ("bathroom accessory", "misc"),
        ] {
            assert_eq!(meaning(word), Meaning::Class(class), "{word}");
        }
        for word in [
            "",
            "  ",
            "/otherroom",
            "unknown",
            "unknown/ probably nothing",
            "unlabeled",
        ] {
            assert_eq!(meaning(word), Meaning::Nothing, "{word}");
        }
        assert_eq!(meaning("flux capacitor"), Meaning::Unlisted);
    }

    #[test]
    fn types_become_words() {
        for (kind, words, class) in [
            ("CoffeeTable", "coffee table", "table"),
            ("TVStand", "tvstand", "furniture"),
            ("StoveBurner", "stove burner", "appliances"),
            ("Apple", "apple", "objects"),
            ("Bed", "bed", "bed"),
        ] {
            assert_eq!(thor(kind), (words.to_owned(), class));
        }
    }
}
