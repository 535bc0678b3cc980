//! Known names of columns and known instructions in questions: [`Role`], [`known_names`], [`split_instructions`].

use std::collections::BTreeMap;
use std::sync::LazyLock;

use regex::{Match, Regex};
use serde::Deserialize;

/// Names and instructions in TOML.
const COLUMNS: &str = include_str!("../columns.toml");

/// Role of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
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

impl Role {
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
    roles: BTreeMap<Role, Vec<String>>,
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
pub(crate) fn known_names(role: Role) -> &'static [String] {
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

    #[test]
    fn names_in_the_file_are_normalized() {
        let known = toml::from_str::<KnownColumns>(COLUMNS).unwrap();
        // Groups have no known names, because only the user assigns them.
        for role in Role::ALL.iter().filter(|role| **role != Role::Group) {
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
