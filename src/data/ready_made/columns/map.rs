//! Column mapping given by the user with `--map`: [`ColumnMap`].
//!
//! Known names of columns and known instructions in questions: [`ColumnRole`], [`known_names`], [`split_instructions`].

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use regex::{Match, Regex};
use serde::Deserialize;

use crate::ready_made::choices::AnswerFormat;
use darkqa_base::types::shell_word;

/// Value of `--map`: roles and their columns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnMap {
    text: String,
    pub entries: Vec<MapEntry>,
}

/// One `role=column` entry of a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapEntry {
    pub(super) role: ColumnRole,
    /// One column, several (for options or images) or a template with `{Column}`; empty turns the role off.
    pub columns: Vec<String>,
    /// Text of `columns` before it was split at commas. A column with exactly this name takes precedence.
    pub(super) unsplit: String,
    pub format: CellFormat,
}

/// Format of the cells in a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CellFormat {
    /// Not given, to be inferred.
    Inferred,
    /// Options in one cell, separated by this text.
    Split(String),
    /// Answers in this format.
    Answer(AnswerFormat),
}

/// Writes a `--map` flag for one column, quoted for the shell, with the format of answers if one is given.
pub(crate) fn map_flag(role: ColumnRole, column: &str, format: Option<AnswerFormat>) -> String {
    let suffix = match format {
        Some(format) => format!(":{}", format.name()),
        // A colon ends a column name that contains colons: the text after the last colon is the format, and an empty
        // one is inferred.
        None if column.contains(':') && matches!(role, ColumnRole::Options | ColumnRole::Answer) => ":".to_owned(),
        None => String::new(),
    };
    let value = format!("{column}{suffix}");
    format!("--map {}={}", role.name(), shell_word(&value))
}

impl ColumnMap {
    /// Merges maps. An entry replaces earlier ones of the same role.
    pub fn merge<'a>(maps: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut merged = Self::default();
        for map in maps {
            for entry in &map.entries {
                merged.entries.retain(|known| known.role != entry.role);
                merged.entries.push(entry.clone());
            }
        }
        merged
    }

    /// Entry of a role; `None` if the map does not have the role.
    pub fn entry(&self, role: ColumnRole) -> Option<&MapEntry> {
        self.entries.iter().find(|entry| entry.role == role)
    }
}

impl fmt::Display for ColumnMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for ColumnMap {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let starts = entry_starts(text);
        if starts.first() != Some(&0) {
            let roles = ColumnRole::ALL.map(ColumnRole::name).join(", ");
            return Err(format!("role=column expected, with one of the roles {roles}"));
        }
        let ends = starts[1..].iter().map(|start| start - 1).chain([text.len()]);
        let mut entries: Vec<MapEntry> = Vec::new();
        for (start, end) in starts.iter().zip(ends) {
            let entry = parse_entry(&text[*start..end])?;
            if entries.iter().any(|known| known.role == entry.role) {
                return Err(format!("{} occurs twice", entry.role.name()));
            }
            entries.push(entry);
        }
        Ok(Self { text: text.to_owned(), entries })
    }
}

/// Byte offsets of the entries: each `role=` at the start of the text or after a comma.
fn entry_starts(text: &str) -> Vec<usize> {
    std::iter::once(0)
        .chain(text.match_indices(',').map(|(comma, _)| comma + 1))
        .filter(|start| {
            text[*start..]
                .split_once('=')
                .is_some_and(|(name, _)| ColumnRole::ALL.iter().any(|role| role.name() == name.trim()))
        })
        .collect()
}

/// Parses one entry: `role=column`, or `role=column:format` for options and answers.
fn parse_entry(text: &str) -> Result<MapEntry, String> {
    let (name, value) = text.split_once('=').ok_or("role=column expected")?;
    let name = name.trim();
    let role =
        ColumnRole::ALL.into_iter().find(|role| role.name() == name).ok_or_else(|| format!("no role {name:?}"))?;
    let (column, format) = match (role, value.rsplit_once(':')) {
        (ColumnRole::Options | ColumnRole::Answer, Some((column, ""))) => (column, CellFormat::Inferred),
        (ColumnRole::Options, Some((column, split))) => {
            let separator = split
                .strip_prefix("split(")
                .and_then(|rest| rest.strip_suffix(')'))
                .filter(|separator| !separator.is_empty())
                .ok_or("options=COLUMN:split(|) expected, with the signs between options")?;
            let separator = separator.replace("\\n", "\n").replace("\\t", "\t");
            (column, CellFormat::Split(separator))
        }
        (ColumnRole::Answer, Some((column, name))) => {
            let format = AnswerFormat::from_name(name).ok_or_else(|| {
                let names = AnswerFormat::ALL.map(AnswerFormat::name).join(", ");
                format!("answer=COLUMN:HOW expected, with one of {names}")
            })?;
            (column, CellFormat::Answer(format))
        }
        _ => (value, CellFormat::Inferred),
    };
    let is_list = matches!(role, ColumnRole::Options | ColumnRole::Image) && !column.contains('{');
    let columns = if column.is_empty() {
        Vec::new()
    } else if is_list {
        column.split(',').map(|column| column.trim().to_owned()).collect()
    } else {
        vec![column.trim().to_owned()]
    };
    Ok(MapEntry { role, columns, unsplit: column.trim().to_owned(), format })
}

/// Names and instructions in TOML.
const COLUMNS: &str = include_str!("../columns.toml");

/// Role of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColumnRole {
    Question,
    Image,
    Options,
    Answer,
    Id,
    Hint,
    Family,
    Group,
    Scene,
    Evidence,
}

impl ColumnRole {
    /// Roles that `--map` accepts.
    pub(super) const ALL: [Self; 9] = [
        Self::Question,
        Self::Image,
        Self::Options,
        Self::Answer,
        Self::Id,
        Self::Hint,
        Self::Family,
        Self::Group,
        Self::Scene,
    ];

    /// Name in `--map` and messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Question => "question",
            Self::Image => "image",
            Self::Options => "options",
            Self::Answer => "answer",
            Self::Id => "id",
            Self::Hint => "hint",
            Self::Family => "family",
            Self::Group => "group",
            Self::Scene => "scene",
            Self::Evidence => "evidence",
        }
    }
}

/// Content of `columns.toml`.
#[derive(Deserialize)]
struct KnownColumns {
    roles: BTreeMap<ColumnRole, Vec<String>>,
    instructions: Instructions,
}

#[derive(Deserialize)]
struct Instructions {
    /// Regular expressions of instructions at the end of a question.
    endings: Vec<String>,
}

/// Parsed `columns.toml`. A test checks that it can be parsed.
static KNOWN: LazyLock<Option<KnownColumns>> = LazyLock::new(|| toml::from_str(COLUMNS).ok());

/// Regular expressions that match an instruction at the end of a text.
static ENDINGS: LazyLock<Vec<Regex>> = LazyLock::new(|| {
    KNOWN
        .iter()
        .flat_map(|known| &known.instructions.endings)
        .filter_map(|ending| Regex::new(&format!(r"(?i)\s*(?:{ending})\s*$")).ok())
        .collect()
});

/// Known column names of a role, normalized, in order of preference.
pub(crate) fn known_names(role: ColumnRole) -> &'static [String] {
    KNOWN.as_ref().and_then(|known| known.roles.get(&role)).map_or(&[], Vec::as_slice)
}

/// Normalizes a name: only letters and digits, in lower case.
pub(crate) fn normalize(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Splits the instructions off the end of a text. Returns the rest and the instructions, the last one first.
pub(crate) fn split_instructions(text: &str) -> (&str, Vec<String>) {
    let (mut text, mut instructions) = (text.trim_end(), Vec::new());
    loop {
        let instruction =
            ENDINGS.iter().filter_map(|ending| ending.find(text)).find(|ending| is_separate(text, ending));
        let Some(instruction) = instruction else {
            return (text, instructions);
        };
        instructions.push(instruction.as_str().trim().to_owned());
        text = text[..instruction.start()].trim_end();
    }
}

/// True if the text before an instruction is not empty and ends with its own sentence or line.
fn is_separate(text: &str, instruction: &Match<'_>) -> bool {
    let matched = instruction.as_str();
    let space = &matched[..matched.len() - matched.trim_start().len()];
    let before = text[..instruction.start()].chars().next_back();
    before.is_some_and(|before| space.contains('\n') || !before.is_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "id=nr,question=frage,image=pics/{bild}.png,options=auswahl:split(|),answer=richtig:index1,family=";

    #[test]
    fn map_names_columns_by_role() {
        let map: ColumnMap = TEXT.parse().unwrap();
        assert_eq!(map.to_string(), TEXT);
        assert_eq!(map.entry(ColumnRole::Image).unwrap().columns.clone(), ["pics/{bild}.png"]);
        assert_eq!(map.entry(ColumnRole::Family).unwrap().columns.clone(), Vec::<String>::new());
        assert_eq!(map.entry(ColumnRole::Options).unwrap().format, CellFormat::Split("|".into()));
        assert_eq!(map.entry(ColumnRole::Answer).unwrap().format, CellFormat::Answer(AnswerFormat::Index1));
        assert_eq!(map.entry(ColumnRole::Hint), None);
    }

    #[test]
    fn option_columns_split_at_commas() {
        assert!("options=first,second:x,third".parse::<ColumnMap>().is_err());
        let cells: ColumnMap = "options=first,second,answer=truth".parse().unwrap();
        assert_eq!(cells.entry(ColumnRole::Options).unwrap().columns, ["first", "second"]);
        let comma: ColumnMap = "options=all:split(,)".parse().unwrap();
        assert_eq!(comma.entry(ColumnRole::Options).unwrap().format, CellFormat::Split(",".into()));
        let line_break: ColumnMap = r"options=all:split(\n)".parse().unwrap();
        assert_eq!(line_break.entry(ColumnRole::Options).unwrap().format, CellFormat::Split("\n".into()));
    }

    #[test]
    fn later_map_replaces_roles() {
        let map: ColumnMap = TEXT.parse().unwrap();
        let both = ColumnMap::merge([&map, &"id=,answer=x".parse().unwrap()]);
        assert_eq!(both.entry(ColumnRole::Id).unwrap().columns, Vec::<String>::new());
        assert_eq!(both.entry(ColumnRole::Question).unwrap().columns, ["frage"]);
    }

    #[test]
    fn wrong_map_error_names_expected() {
        for (text, expected) in [
            ("frage", "one of the roles question, image"),
            ("colour=frage", "one of the roles question, image"),
            ("id=a,id=b", "id occurs twice"),
            ("answer=a:second", "one of letter, text, index0, index1"),
            ("options=a:split()", "split(|) expected"),
        ] {
            let problem = text.parse::<ColumnMap>().unwrap_err();
            assert!(problem.contains(expected), "{text}: {problem}");
        }
    }

    #[test]
    fn names_in_the_file_are_normalized() {
        let known = toml::from_str::<KnownColumns>(COLUMNS).unwrap();
        // Groups have no known names, because only the user assigns them.
        for role in ColumnRole::ALL.iter().filter(|role| **role != ColumnRole::Group) {
            assert!(!known.roles[role].is_empty(), "{role:?}");
        }
        assert!(known.roles.values().flatten().all(|name| normalize(name) == *name));
        assert_eq!(ENDINGS.len(), known.instructions.endings.len());
    }

    #[test]
    fn only_an_instruction_at_the_end_is_cut() {
        for (text, rest, count) in [
            ("Is it? Please answer yes or no.", "Is it?", 1),
            ("Is it?\nAnswer the question using a single word or phrase. Please answer yes or no.", "Is it?", 2),
            ("Did he answer yes or no to that?", "Did he answer yes or no to that?", 0),
            ("Do they always answer yes or no", "Do they always answer yes or no", 0),
            ("Answer yes or no.", "Answer yes or no.", 0),
            ("A. x\nB. y\nPlease answer yes or no.", "A. x\nB. y", 1),
        ] {
            let (before, instructions) = split_instructions(text);
            assert_eq!((before, instructions.len()), (rest, count), "{text}");
        }
    }
}
