//! Marks that models and chat templates put around parts of a reply, recognized by their form: special tokens, tags and
//! bracketed names ([`marks`]).

use std::collections::HashSet;
use std::sync::LazyLock;

use regex::{Captures, Regex};
use serde::Deserialize;

use super::plain::compiled;

/// Words in the names of marks, a table of `reasoning.toml`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MarkWords {
    thought: Vec<String>,
    answer: HashSet<String>,
    /// Words of the titles of answers.
    title: HashSet<String>,
    template: HashSet<String>,
    bare: HashSet<String>,
    html: HashSet<String>,
}

/// Words that say that a mark begins, or ends, a part.
const BEGIN_WORDS: [&str; 5] = ["begin", "start", "open", "bos", "sop"];
const END_WORDS: [&str; 8] = ["end", "close", "stop", "finish", "eos", "eot", "eom", "eop"];

/// Words in names that say nothing.
const FILLERS: [&str; 2] = ["of", "the"];

/// The longest word of [`MarkWords::thought`] that must match a whole word, in bytes; chosen: "cot" is not in
/// "cottage".
const WHOLE_WORD: usize = 3;

/// A mark: `<|x|>`, `<|x>`, `<x|>`, `[|x|]`, `◁x▷`, then `<x>`, then `[x]`.
static MARK: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"<[|｜](?P<full>[^<>|｜\n]{1,60})[|｜]>|<[|｜](?P<left>[^<>|｜\s]{1,40})>|<(?P<right>[^<>|｜\s]{1,40})[|｜]>",
        r"|\[[|｜](?P<barred>[^\[\]|｜\n]{1,40})[|｜]\]|[◁⟨⟦](?P<signs>[^◁▷⟨⟩⟦⟧\n]{1,40})[▷⟩⟧]",
        r#"|<(?P<tag>/?\p{L}[\p{L}\p{N}_:.\-]{0,40})(?:\s+[\w:\-]+="[^"<>\n]*")*\s*/?>"#,
        r"|\[(?P<bracket>/?\p{L}[\p{L}\p{N}_:.\- ]{1,40})\]"
    ))
});

/// The name of a role or channel after a token that begins a turn, alone on its line.
static TURN_NAME: LazyLock<Regex> = LazyLock::new(|| compiled(r"\A[ \t]*(\p{L}{2,20})[ \t]*(?:\r?\n|<)"));

/// Form of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// A token of a tokenizer: `<|x|>`, `<x|>`, `◁x▷`, `<x_start>`, `<unused94>`, `</s>`.
    Special,
    /// `<x>` or `</x>`.
    Tag,
    /// `[x]` or `[/x]`.
    Bracket,
}

/// Whether a mark begins or ends a part of the reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MarkRole {
    /// The name says that a part begins: `<|x_start|>`, `[BEGIN X]`, `<|x>`.
    Begin,
    /// A slash or the name says that a part ends.
    End,
    /// Neither: `<|x|>`, `<x>`, `[x]`.
    Single,
}

/// What a mark encloses, by the words of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MarkMeaning {
    Thought,
    Answer,
    /// A turn, a role, an image.
    Template,
    /// Layout, in HTML.
    Layout,
    /// Not known.
    Other,
}

/// One mark in a text.
#[derive(Debug, Clone)]
pub(super) struct Mark<'t> {
    pub(super) start: usize,
    pub(super) end: usize,
    pub(super) form: Form,
    pub(super) role: MarkRole,
    pub(super) meaning: MarkMeaning,
    /// The name without brackets and slash.
    pub(super) name: &'t str,
    /// The words of the name without those of the role.
    pub(super) core: String,
    /// True if the name ends with a number, as of reserved tokens.
    pub(super) is_numbered: bool,
}

impl Mark<'_> {
    /// True if this mark ends what `begin` begins, by its name.
    pub(super) fn ends(&self, begin: &Self) -> bool {
        self.role == MarkRole::End && self.core == begin.core
    }

    /// True for a token of a tokenizer, which is no part of the answer.
    pub(super) fn is_token(&self) -> bool {
        let is_end_of_answer = self.meaning == MarkMeaning::Answer && self.role == MarkRole::End;
        self.form == Form::Special || (self.form == Form::Bracket && is_end_of_answer && self.core.contains(' '))
    }
}

/// The marks in a text, in order. A single letter in brackets is a choice and no mark.
pub(super) fn marks<'t>(text: &'t str, words: &MarkWords) -> Vec<Mark<'t>> {
    // Every mark has one of these.
    if !text.contains(['<', '[', '◁', '⟨', '⟦']) {
        return Vec::new();
    }
    MARK.captures_iter(text).filter_map(|found| mark(text, &found, words)).collect()
}

fn mark<'t>(text: &'t str, found: &Captures<'t>, words: &MarkWords) -> Option<Mark<'t>> {
    let whole = found.get(0)?;
    let (group, name) = ["full", "left", "right", "barred", "signs", "tag", "bracket"]
        .into_iter()
        .find_map(|group| Some((group, found.name(group)?.as_str())))?;
    let bare = name.trim().trim_start_matches('/');
    let has_slash = bare.len() < name.trim().len();
    let parts = name_words(bare);
    let is_numbered = bare.ends_with(|c: char| c.is_ascii_digit());
    // Signs such as ◁ are in no token of a turn.
    let begins = matches!(group, "left" | "signs") || parts.iter().any(|word| BEGIN_WORDS.contains(&&**word));
    let ends = has_slash || group == "right" || parts.iter().any(|word| END_WORDS.contains(&&**word));
    let role = match (begins, ends) {
        (_, true) => MarkRole::End,
        (true, false) => MarkRole::Begin,
        (false, false) => MarkRole::Single,
    };
    let core: Vec<&str> = parts
        .iter()
        .map(|word| &**word)
        .filter(|word| !BEGIN_WORDS.contains(word) && !END_WORDS.contains(word) && !FILLERS.contains(word))
        .collect();
    let has_role_word = core.len() < parts.len() && role != MarkRole::Single;
    let lower = bare.to_lowercase();
    let (form, meaning) = match group {
        "tag" if words.bare.contains(&lower) => (Form::Special, MarkMeaning::Template),
        "tag" if words.html.contains(&lower) => (Form::Tag, MarkMeaning::Layout),
        "tag" if is_numbered || (has_role_word && bare.contains('_')) => (Form::Special, words.meaning(&core)),
        "tag" => (Form::Tag, words.meaning(&core)),
        "bracket" => (Form::Bracket, words.meaning(&core)),
        _ => (Form::Special, words.meaning(&core)),
    };
    if form == Form::Tag && bare.chars().count() == 1 {
        return None;
    }
    let mark = Mark {
        start: whole.start(),
        end: whole.end(),
        form,
        role,
        meaning,
        name: bare,
        core: core.join(" "),
        is_numbered,
    };
    Some(with_turn_name(mark, &text[whole.end()..], words))
}

/// Adds the name of a channel or role to a token that begins a turn: `<|im_start|>think`.
fn with_turn_name<'t>(mark: Mark<'t>, after: &'t str, words: &MarkWords) -> Mark<'t> {
    if mark.form != Form::Special || mark.meaning != MarkMeaning::Template || mark.role == MarkRole::End {
        return mark;
    }
    let Some(name) = TURN_NAME.captures(after).and_then(|found| found.get(1)) else {
        return mark;
    };
    match words.meaning(&[&*name.as_str().to_lowercase()]) {
        meaning @ (MarkMeaning::Thought | MarkMeaning::Answer) => {
            Mark { end: mark.end + name.end(), role: MarkRole::Begin, meaning, ..mark }
        }
        _ => mark,
    }
}

/// The words of a name in lower case, without numbers: `BEGIN FINAL RESPONSE`, `endofturn`, `startThinking`.
fn name_words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut is_after_lower = false;
    for c in name.chars() {
        if !c.is_alphabetic() || (c.is_uppercase() && is_after_lower) {
            words.push(String::new());
        }
        if let (true, Some(word)) = (c.is_alphabetic(), words.last_mut()) {
            word.extend(c.to_lowercase());
        }
        is_after_lower = c.is_lowercase();
    }
    words
        .into_iter()
        .flat_map(|word| {
            let joined = ["endof", "startof", "beginof"].iter().find_map(|prefix| {
                Some([prefix[..prefix.len() - 2].to_owned(), word.strip_prefix(prefix)?.to_owned()])
            });
            joined.map_or_else(|| vec![word], Vec::from)
        })
        .filter(|word| !word.is_empty())
        .collect()
}

impl MarkWords {
    /// The meaning of a mark with these words in its name. Without any word it belongs to the template: `<|end|>`.
    pub(super) fn meaning(&self, words: &[&str]) -> MarkMeaning {
        if words.iter().any(|word| self.is_thought(word)) {
            MarkMeaning::Thought
        } else if words.iter().any(|word| self.answer.contains(*word)) {
            MarkMeaning::Answer
        } else if words.iter().all(|word| self.template.contains(*word)) {
            MarkMeaning::Template
        } else {
            MarkMeaning::Other
        }
    }

    fn is_thought(&self, word: &str) -> bool {
        self.thought.iter().any(|stem| word == stem || (stem.len() > WHOLE_WORD && word.starts_with(&**stem)))
    }

    /// The meaning of the title of a section: `Thought process`, `Final answer`.
    pub(super) fn title_meaning(&self, title: &str) -> MarkMeaning {
        let words = name_words(title);
        if words.iter().any(|word| self.is_thought(word)) {
            MarkMeaning::Thought
        } else if words.iter().any(|word| self.title.contains(word)) {
            MarkMeaning::Answer
        } else {
            MarkMeaning::Other
        }
    }
}
