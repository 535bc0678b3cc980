//! Built-in label spaces, by name: [`space`]; custom label spaces, in `classes.json`: `read`.
//!
//! Classes of the words of data sets: [`meaning()`] maps a word to a class of mpcat40.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::files;
use crate::error::{Error, Result};
use crate::types::images::OTHER_PLACES;
use crate::types::{Label, Labels};

/// The schema of `classes.json`.
const SCHEMA: &str = "darkqa.classes/1";

/// The built-in label spaces: name, table and void numbers.
const SPACES: [(&str, &str, &[u16]); 4] = [
    ("ade150", include_str!("labels/ade150.tsv"), &[0]),
    ("mpcat40", include_str!("labels/mpcat40.tsv"), &[0, 41]),
    ("nyu13", include_str!("labels/nyu13.tsv"), &[0]),
    ("nyu40", include_str!("labels/nyu40.tsv"), &[0]),
];

/// The names of the built-in label spaces.
#[must_use]
pub fn names() -> Vec<&'static str> {
    SPACES.iter().map(|(name, ..)| *name).collect()
}

/// A built-in label space by name; `None` if the name is unknown.
#[must_use]
pub fn space(name: &str) -> Option<Labels> {
    let (_, table, void) = SPACES.iter().find(|(known, ..)| *known == name)?;
    let (mut labels, mut expressible) = (BTreeMap::new(), BTreeSet::new());
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        let mut cells = line.split('\t');
        let [id, word, canonical] = [(); 3].map(|()| cells.next().unwrap_or_default().to_owned());
        if cells.next().is_none() {
            expressible.insert(canonical.clone());
        }
        let label = Label { name: word, canonical };
        labels.insert(id.parse().ok()?, label);
    }
    Some(Labels { space: name.to_owned(), void: void.iter().copied().collect(), labels, expressible })
}

/// The canonical classes: mpcat40 without `void` and `unlabeled`.
#[must_use]
pub fn canonical() -> BTreeSet<String> {
    space("mpcat40").map_or_else(BTreeSet::new, |labels| labels.expressible)
}

/// The content of `classes.json`.
#[derive(Debug, Serialize, Deserialize)]
struct ClassesFile {
    schema: String,
    space: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    void_id: Option<u16>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    void_ids: Vec<u16>,
    classes: Vec<ClassEntry>,
}

/// One class of `classes.json`.
#[derive(Debug, Serialize, Deserialize)]
struct ClassEntry {
    id: u16,
    name: String,
    canonical: String,
    /// True if an image whose map lacks the canonical class shows no object of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expressible: Option<bool>,
}

/// Reads a `classes.json`: `{"schema": "darkqa.classes/1", "space", "void_ids": [0], "classes": [{"id", "name",
/// "canonical", "expressible"}]}`.
///
/// A canonical class is expressible if one of its labels is marked so. If no label of the file has such a mark, the
/// built-in space of the same name decides. Without such a space, every class with a label is expressible.
///
/// # Errors
/// With the file, for invalid JSON, another schema, a repeated number, or a canonical class that mpcat40 does not have.
pub fn read(path: &Path) -> Result<Labels> {
    let file: ClassesFile = files::json(path)?;
    file.labels().map_err(|problem| Error::data(path.display(), problem))
}

impl ClassesFile {
    fn labels(self) -> Result<Labels, String> {
        if self.schema != SCHEMA {
            return Err(format!("schema {:?}; {SCHEMA:?} expected", self.schema));
        }
        let known = canonical();
        let mut labels = Labels {
            space: self.space,
            void: self.void_ids.into_iter().chain(self.void_id).collect(),
            ..Labels::default()
        };
        let stated = self.classes.iter().any(|class| class.expressible.is_some());
        for class in self.classes {
            let ClassEntry { id, name, canonical, expressible } = class;
            if !known.contains(&canonical) {
                return Err(format!(
                    "class {id} ({name:?}) has the canonical class {canonical:?}, which mpcat40 does not have; one of {} expected",
                    known.into_iter().collect::<Vec<_>>().join(", ")
                ));
            }
            if expressible.unwrap_or(!stated) {
                labels.expressible.insert(canonical.clone());
            }
            if labels.labels.insert(id, Label { name, canonical }).is_some() {
                return Err(format!("two classes have the number {id}"));
            }
        }
        if let Some(preset) = space(&labels.space).filter(|_| !stated) {
            labels.expressible.retain(|class| preset.expressible.contains(class));
        }
        Ok(labels)
    }
}

/// The text of `classes.json` for a label space.
pub fn json(labels: &Labels) -> String {
    let classes = labels.labels.iter().map(|(&id, label)| ClassEntry {
        id,
        name: label.name.clone(),
        canonical: label.canonical.clone(),
        expressible: Some(labels.expressible.contains(&label.canonical)),
    });
    let file = ClassesFile {
        schema: SCHEMA.to_owned(),
        space: labels.space.clone(),
        void_id: None,
        void_ids: labels.void.iter().copied().collect(),
        classes: classes.collect(),
    };
    // Serialization of names and numbers cannot fail.
    serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
}

/// Table of the words of HM3D-Sem.
const HM3D: &str = include_str!("labels/names/hm3d.tsv");

/// Table of words that override HM3D-Sem's.
const OVERRIDES: &str = include_str!("labels/names/overrides.tsv");

/// Table of the object types of AI2-THOR.
const THOR: &str = include_str!("labels/names/thor.tsv");

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
    use std::fs;

    use super::*;

    fn parse(text: &str) -> Result<Labels> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        read(file.path())
    }

    #[test]
    fn the_built_in_spaces_are_complete() {
        let sizes = [150, 40, 13, 40];
        for (name, size) in names().into_iter().zip(sizes) {
            let labels = space(name).unwrap();
            let ids: Vec<u16> = labels.labels.keys().copied().collect();
            assert_eq!(ids, (1..=size).collect::<Vec<u16>>(), "{name}");
            for label in labels.labels.values() {
                assert!(canonical().contains(&label.canonical), "{name}: {label:?}");
            }
            assert_eq!(parse(&json(&labels)).unwrap(), labels, "{name}");
        }
        assert_eq!(canonical().len(), 40);
    }

    #[test]
    fn classes_that_a_space_cannot_express_are_known() {
        let nyu13 = space("nyu13").unwrap().expressible;
        for class in ["sink", "toilet", "cabinet", "tv_monitor"] {
            assert!(!nyu13.contains(class), "{class}");
        }
        let nyu40 = space("nyu40").unwrap().expressible;
        for class in ["plant", "stool", "fireplace", "appliances", "shower"] {
            assert!(!nyu40.contains(class), "{class}");
        }
        assert!(nyu40.contains("sink") && nyu13.contains("chair"));
    }

    #[test]
    fn built_in_space_decides_without_expressible_marks() {
        assert_eq!(expressible("nyu40", ""), ["chair"]);
        assert_eq!(expressible("mine", ""), ["appliances", "chair"]);
        let mark = r#","expressible":true"#;
        assert_eq!(expressible("nyu40", mark), ["appliances"]);
    }

    /// The expressible classes of a file with the classes `appliances`, with `mark`, and `chair`, without a mark.
    fn expressible(space: &str, mark: &str) -> Vec<String> {
        let text = format!(
            r#"{{"schema":"{SCHEMA}","space":"{space}","void_id":0,"classes":[
                {{"id":24,"name":"x","canonical":"appliances"{mark}}},
                {{"id":5,"name":"x","canonical":"chair"}}]}}"#
        );
        parse(&text).unwrap().expressible.into_iter().collect()
    }

    #[test]
    fn errors_name_the_fault() {
        for (text, problem) in [
            ("{", "EOF"),
            (r#"{"schema":"x","space":"","classes":[]}"#, "schema \"x\""),
            (
                r#"{"schema":"darkqa.classes/1","space":"","classes":[{"id":1,"name":"a","canonical":"desk"}]}"#,
                "class 1 (\"a\") has the canonical class \"desk\"",
            ),
            (
                r#"{"schema":"darkqa.classes/1","space":"","classes":[{"id":1,"name":"a","canonical":"bed"},{"id":1,"name":"b","canonical":"bed"}]}"#,
                "two classes have the number 1",
            ),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
    }

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
