//! Classes of the words of data sets: [`meaning()`] maps a word to a class of mpcat40.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::types::images::OTHER_PLACES;

/// Table of the words of HM3D-Sem.
const HM3D: &str = include_str!("hm3d.tsv");
/// Table of words that override HM3D-Sem's.
const OVERRIDES: &str = include_str!("overrides.tsv");
/// Table of the object types of AI2-THOR.
const THOR: &str = include_str!("thor.tsv");

/// Class of words that are in no table.
pub const UNKNOWN: &str = "misc";

type NameTable = BTreeMap<&'static str, &'static str>;

fn parse_table(text: &'static str) -> NameTable {
    text.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once('\t')).collect()
}

static TABLES: LazyLock<[NameTable; 3]> = LazyLock::new(|| [OVERRIDES, HM3D, THOR].map(parse_table));

/// Meaning of a word of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// A class of mpcat40.
    Class(&'static str),
    /// No class: the word is empty or means unknown.
    Nothing,
    /// No table has the word.
    Unlisted,
}

/// A word in the spelling of the tables: lower case, single spaces, no underscores.
fn normalized(word: &str) -> String {
    let lower = word.to_lowercase().replace('_', " ");
    lower.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The meaning of a word of a data set. The suffixes `/otherroom` and `/outside` are ignored, because they give the
/// place only.
pub fn meaning(word: &str) -> Meaning {
    let word = normalized(word);
    let bare = OTHER_PLACES.iter().find_map(|suffix| word.strip_suffix(suffix)).map_or(word.as_str(), str::trim_end);
    if bare.is_empty() {
        return Meaning::Nothing;
    }
    let [overrides, hm3d, _] = &*TABLES;
    let found = [&word[..], bare].into_iter().find_map(|word| overrides.get(word).or_else(|| hm3d.get(word)));
    match found {
        Some(class) => Meaning::Class(class),
        None if bare.starts_with("unknown") || bare == "unlabeled" => Meaning::Nothing,
        None => Meaning::Unlisted,
    }
}

/// The class of a word of a data set; `None` if the word is empty or means unknown. A word that is in no table has the
/// class [`UNKNOWN`], and `count` is added to its entry `original` in `unlisted`.
pub fn class_of(
    word: &str,
    original: &str,
    count: usize,
    unlisted: &mut BTreeMap<String, usize>,
) -> Option<&'static str> {
    match meaning(word) {
        Meaning::Nothing => None,
        Meaning::Class(class) => Some(class),
        Meaning::Unlisted => {
            *unlisted.entry(original.to_owned()).or_insert(0) += count;
            Some(UNKNOWN)
        }
    }
}

/// The class that overrides the data set's class of a word; `None` if that class is kept.
pub fn class_override(word: &str) -> Option<&'static str> {
    TABLES[0].get(normalized(word).as_str()).copied()
}

/// An object type of AI2-THOR (`CoffeeTable`) in words (`coffee table`), and its class.
pub fn thor(kind: &str) -> (String, &'static str) {
    let mut words = String::new();
    let mut before = ' ';
    for letter in kind.chars() {
        if letter.is_uppercase() && before.is_lowercase() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
        before = letter;
    }
    let class = TABLES[2].get(kind).copied().unwrap_or_else(|| match meaning(&words) {
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
            assert_eq!(parse_table(text).len(), lines.len());
            for (word, class) in parse_table(text) {
                assert!(canonical().contains(class), "{word}: {class}");
            }
            let mut sorted = lines.clone();
            sorted.sort_unstable_by_key(|line| line.split('\t').next());
            assert_eq!(sorted, lines);
        }
        assert_eq!(parse_table(HM3D).len(), 2295);
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
        for word in ["", "  ", "/otherroom", "unknown", "unknown/ probably nothing", "unlabeled"] {
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
