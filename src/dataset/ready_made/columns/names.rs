//! The names of columns and the instructions in questions that are known: [`Role`], [`known`], [`without_endings`].

use std::collections::BTreeMap;
use std::sync::LazyLock;

use regex::{Match, Regex};
use serde::Deserialize;

/// The file of names and instructions.
const COLUMNS: &str = include_str!("../columns.toml");

/// The role of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::dataset::ready_made) enum Role {
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
    /// The roles that `--map` knows.
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

    /// The name in `--map` and messages.
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

/// The content of the file.
#[derive(Deserialize)]
struct Columns {
    roles: BTreeMap<Role, Vec<String>>,
    instructions: Instructions,
}

#[derive(Deserialize)]
struct Instructions {
    endings: Vec<String>,
}

/// The file, read once. A test holds that it can be read.
static KNOWN: LazyLock<Option<Columns>> = LazyLock::new(|| toml::from_str(COLUMNS).ok());

/// The instructions as expressions that match at the end of a text.
static ENDINGS: LazyLock<Vec<Regex>> = LazyLock::new(|| {
    KNOWN
        .iter()
        .flat_map(|known| &known.instructions.endings)
        .filter_map(|ending| Regex::new(&format!(r"(?i)\s*(?:{ending})\s*$")).ok())
        .collect()
});

/// The names of the columns of a role, plain, the best first.
pub(in crate::dataset::ready_made) fn known(role: Role) -> &'static [String] {
    let known = KNOWN.as_ref().and_then(|known| known.roles.get(&role));
    known.map_or(&[], Vec::as_slice)
}

/// A name in lower case, letters and digits alone.
pub(in crate::dataset::ready_made) fn plain(name: &str) -> String {
    name.chars()
        .filter(|c| c.is_alphanumeric())
        .flat_map(char::to_lowercase)
        .collect()
}

/// A text without the instructions at its end, and these, the last first. An instruction is a sentence or a line of its own, with
/// something before it.
pub(in crate::dataset::ready_made) fn without_endings(text: &str) -> (&str, Vec<String>) {
    let (mut text, mut cut) = (text.trim_end(), Vec::new());
    loop {
        let own = |ending: &Match<'_>| {
            let before = text[..ending.start()].chars().next_back();
            let begins = ending.as_str().len() - ending.as_str().trim_start().len();
            let has_line = ending.as_str()[..begins].contains('\n');
            before.is_some_and(|before| has_line || !before.is_alphanumeric())
        };
        let mut endings = ENDINGS.iter().filter_map(|ending| ending.find(text));
        let Some(ending) = endings.find(own) else {
            return (text, cut);
        };
        cut.push(ending.as_str().trim().to_owned());
        text = text[..ending.start()].trim_end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_can_be_read_and_every_name_in_it_is_plain() {
        let known = toml::from_str::<Columns>(COLUMNS).unwrap();
        // Questions have a group by the word of the user alone.
        for role in Role::ALL.iter().filter(|role| **role != Role::Group) {
            assert!(!known.roles[role].is_empty(), "{role:?}");
        }
        let names = known.roles.values().flatten();
        assert!(names.clone().all(|name| plain(name) == *name));
        assert_eq!(ENDINGS.len(), known.instructions.endings.len());
    }

    #[test]
    fn only_an_instruction_at_the_end_is_cut() {
        for (text, rest, count) in [
            ("Is it? Please answer yes or no.", "Is it?", 1),
            (
                "Is it?\nAnswer the question using a single word or phrase. Please answer yes or no.",
                "Is it?",
                2,
            ),
            (
                "Did he answer yes or no to that?",
                "Did he answer yes or no to that?",
                0,
            ),
            (
                "Do they always answer yes or no",
                "Do they always answer yes or no",
                0,
            ),
            ("Answer yes or no.", "Answer yes or no.", 0),
            ("A. x\nB. y\nPlease answer yes or no.", "A. x\nB. y", 1),
        ] {
            let (cut, endings) = without_endings(text);
            assert_eq!((cut, endings.len()), (rest, count), "{text}");
        }
    }
}
