//! Text: counts with nouns, enum values as words, escaping of untrusted text, spelling suggestions and shell quoting.
//!
//! Counts with their nouns, and amounts with their units: [`counted`], [`plural`], [`money`], [`hours`], [`bytes`].
//!
//! Escaping of hidden characters in untrusted text: [`escape_hidden`].
//!
//! A name in a data set, a run or a reply of an endpoint may contain characters that move the cursor of a terminal,
//! reverse the direction of a line, or are invisible. Control characters also make an SVG file invalid XML.
//!
//! Comparison of the name of a model that was asked with the name in its replies: [`is_other_model`], [`is_same_name`].
//!
//! Spelling suggestions for unknown names: [`nearest`].
//!
//! Shell quoting for printed commands: [`shell_word`].
//!
//! [`TomlFault`]: a TOML syntax or type error, worded for messages.

#[cfg(feature = "program")]
pub mod image_mark;
pub mod words;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;

use strsim::{damerau_levenshtein, jaro_winkler};

/// True for the characters of names of enhancers, noise profiles and wordings: letters, digits, `_`, `-` and `.`. Such a
/// name needs no quotes in tables, files and shells.
#[must_use]
pub fn is_in_names(c: char) -> bool {
    c.is_ascii_alphanumeric() || "_-.".contains(c)
}

/// A count with its noun; the plural adds an s: `1 pair`, `2 pairs`.
#[must_use]
pub fn counted(number: usize, noun: &str) -> String {
    plural(number, noun, &format!("{noun}s"))
}

/// A count with its noun, given in singular and plural: `1 reply`, `2 replies`.
#[must_use]
pub fn plural(number: usize, one: &str, several: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { several })
}

/// Formats an amount in dollars with two decimals, or four below one dollar.
#[must_use]
pub fn money(dollars: f64) -> String {
    if dollars > 0.0 && dollars < 0.995 { format!("${dollars:.4}") } else { format!("${dollars:.2}") }
}

/// Formats a time, as in `2.0 h`, `6 min` or `40 s`.
#[must_use]
pub fn hours(seconds: f64) -> String {
    match seconds {
        s if s >= 3600.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 60.0 => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}

/// Formats a number of bytes in MB or GB.
#[must_use]
pub fn bytes(bytes: f64) -> String {
    match bytes {
        b if b >= 1e9 => format!("{:.1} GB", b / 1e9),
        b => format!("{:.1} MB", b / 1e6),
    }
}

/// The terminal styles that this program prints: bold, red, green, yellow, and reset.
const STYLES: [&str; 5] = ["\u{1b}[1m", "\u{1b}[31m", "\u{1b}[32m", "\u{1b}[33m", "\u{1b}[0m"];

/// True for a character that is invisible or changes the text around it: control characters except line feed and tab,
/// line separators, annotation marks, and Unicode's default-ignorable characters (direction marks, invisible letters,
/// tags) except the two variation selectors of emoji.
#[must_use]
pub fn is_hidden(c: char) -> bool {
    matches!(
        c,
        '\u{0}'..='\u{8}' | '\u{b}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}'
            | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{fe00}'..='\u{fe0d}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}'
            | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}'
    )
}

/// A text on one line, cut to `most` characters; a cut text ends in `…`.
#[must_use]
pub fn excerpt(text: &str, most: usize) -> String {
    let line = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    if text.chars().nth(most).is_none() {
        return line.collect();
    }
    let head: String = line.take(most.saturating_sub(1)).collect();
    format!("{head}…")
}

/// Replaces each hidden character by its code, as `⟨U+202E⟩`.
#[must_use]
pub fn escape_hidden(text: &str) -> Cow<'_, str> {
    escape_where(text, is_hidden)
}

/// Replaces each character that `is_escaped` accepts by its code, as `⟨U+0009⟩`.
#[must_use]
pub fn escape_where(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    let Some(first) = text.find(&is_escaped) else {
        return Cow::Borrowed(text);
    };
    let mut escaped = String::with_capacity(text.len() + 8);
    escaped.push_str(&text[..first]);
    for c in text[first..].chars() {
        if is_escaped(c) {
            push_code(&mut escaped, c);
        } else {
            escaped.push(c);
        }
    }
    Cow::Owned(escaped)
}

/// Replaces hidden characters as [`escape_hidden`] does, but keeps the terminal styles that this program prints.
#[must_use]
pub fn escape_hidden_except_styles(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 8);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if let Some(style) = STYLES.iter().find(|style| rest.starts_with(**style)) {
            escaped.push_str(style);
            rest = &rest[style.len()..];
            continue;
        }
        if is_hidden(c) {
            push_code(&mut escaped, c);
        } else {
            escaped.push(c);
        }
        rest = &rest[c.len_utf8()..];
    }
    Cow::Owned(escaped)
}

/// Appends the code of a character, as `⟨U+202E⟩`.
fn push_code(text: &mut String, c: char) {
    let _ = write!(text, "⟨U+{:04X}⟩", u32::from(c));
}

/// Words of small versions of a model. A name that has one and a name that has none are of two models.
const SMALL: [&str; 6] = ["mini", "nano", "lite", "tiny", "small", "micro"];

/// Words of many models, which do not show that two names are related.
const COMMON: [&str; 14] = [
    "instruct", "chat", "vision", "vl", "it", "preview", "latest", "model", "base", "turbo", "fp", "awq", "gguf", "exp",
];

/// True if the name in the replies is evidently that of another model than the one asked: they have no word in common,
/// or they name different sizes. Servers complete names (`gpt-4o` becomes `gpt-4o-2024-11-20`, `llava` becomes a path),
/// so that other differences mean nothing; and names without a digit, such as `default`, are not judged.
#[must_use]
pub fn is_other_model(asked: &str, served: &str) -> bool {
    let (asked, served) = (name_words(asked), name_words(served));
    let has_version = |words: &BTreeSet<String>| words.iter().any(|word| has_digit(word));
    if !has_version(&asked) || !has_version(&served) {
        return false;
    }
    let (asked_families, served_families) = (model_families(&asked), model_families(&served));
    if asked_families.is_empty() || served_families.is_empty() {
        return false;
    }
    let (asked_sizes, served_sizes) = (model_sizes(&asked), model_sizes(&served));
    let is_other_size = !asked_sizes.is_empty() && !served_sizes.is_empty() && asked_sizes.is_disjoint(&served_sizes);
    asked_families.is_disjoint(&served_families) || is_other_size || is_small(&asked) != is_small(&served)
}

/// True if two names in replies differ only in case or in the path before them.
#[must_use]
pub fn is_same_name(one: &str, other: &str) -> bool {
    last_segment(one).eq_ignore_ascii_case(last_segment(other))
}

/// The name without the folders, the organization or the address before it.
fn last_segment(name: &str) -> &str {
    name.trim().trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or(name)
}

/// The words of a name in lower case, without its path.
fn name_words(name: &str) -> BTreeSet<String> {
    last_segment(name)
        .to_lowercase()
        .split(|c: char| !c.is_alphanumeric() && c != '.')
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn has_digit(word: &str) -> bool {
    word.contains(|c: char| c.is_ascii_digit())
}

/// The letters of each word, without common words and single letters: `qwen` of `qwen2.5-vl-7b`.
fn model_families(words: &BTreeSet<String>) -> BTreeSet<&str> {
    words
        .iter()
        .flat_map(|word| word.split(|c: char| !c.is_alphabetic()))
        .filter(|part| part.chars().count() > 1 && !COMMON.contains(part))
        .collect()
}

/// The sizes in a name, such as `7b`.
fn model_sizes(words: &BTreeSet<String>) -> BTreeSet<&str> {
    words
        .iter()
        .filter(|word| word.strip_suffix(['b', 'm']).is_some_and(|number| number.parse::<f64>().is_ok()))
        .map(String::as_str)
        .collect()
}

fn is_small(words: &BTreeSet<String>) -> bool {
    SMALL.iter().any(|small| words.contains(*small))
}

/// Minimum Jaro–Winkler similarity of two names for a suggestion; chosen.
const MIN_SIMILARITY: f64 = 0.8;

/// The most similar of the known names, ignoring case; the first of equally similar ones, and `None` if none is
/// similar.
pub fn nearest<'a, S: AsRef<str> + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> Option<&'a str> {
    let name = name.to_lowercase();
    known
        .into_iter()
        .map(AsRef::as_ref)
        .map(|other| (jaro_winkler(&name, &other.to_lowercase()), other))
        .filter(|(similarity, _)| *similarity > MIN_SIMILARITY)
        // `min_by` returns the first of equal elements, `max_by` the last.
        .min_by(|(a, _), (b, _)| b.total_cmp(a))
        .map(|(_, other)| other)
}

/// Length in bytes up to which a word may have one typing error; longer words may have two. Chosen.
const SHORT_WORD: usize = 6;

/// True if a word equals a known one except for one typing error, or two in a long word.
pub fn is_nearly(word: &str, known: &str) -> bool {
    let most_errors = if known.len() <= SHORT_WORD { 1 } else { 2 };
    damerau_levenshtein(known, word) <= most_errors
}

/// [`did_you_mean`] for the most similar of the known names.
pub fn suggestion<'a, S: AsRef<str> + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> String {
    did_you_mean(nearest(name, known))
}

/// The end of a message that suggests a name: `; did you mean NAME?`. Empty without a name.
pub fn did_you_mean(meant: Option<&str>) -> String {
    meant.map_or_else(String::new, |meant| format!("; did you mean {meant}?"))
}

/// Quotes a text as one word of a POSIX shell.
///
/// Single quotes are added to an empty text and to one with a character that is neither alphanumeric nor in
/// `-_./:=,@%+`.
pub fn shell_word(text: &str) -> Cow<'_, str> {
    if !text.is_empty() && text.chars().all(|c: char| c.is_alphanumeric() || "-_./:=,@%+".contains(c)) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(format!("'{}'", text.replace('\'', "'\\''")))
}

/// The line and the description of an error in a TOML text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TomlFault {
    /// The line, from 1.
    pub line: usize,
    /// The description on one line; for an unknown key with the most similar known key.
    pub problem: String,
}

impl TomlFault {
    /// Describes the parser's error about a text.
    pub fn new(text: &str, error: &toml::de::Error) -> Self {
        let message: Vec<&str> = error.message().lines().map(str::trim).collect();
        Self {
            line: line_at(text, error.span().map_or(0, |span| span.start)),
            problem: message.join(", ") + &suggested_key(error.message()) + quoting_hint(error.message()),
        }
    }
}

/// The line, from 1, of a byte offset in a text.
pub fn line_at(text: &str, start: usize) -> usize {
    text.get(..start).unwrap_or_default().matches('\n').count() + 1
}

/// Suggestion of the most similar known key if the message is about an unknown one; otherwise empty.
fn suggested_key(message: &str) -> String {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match &*names {
        [unknown, known @ ..] if message.starts_with("unknown field") => suggestion(unknown, known),
        _ => String::new(),
    }
}

/// Hint to quote a text that the parser tried to read as a number or a date; empty for other errors, which need no
/// hint.
fn quoting_hint(message: &str) -> &'static str {
    let is_number =
        ["invalid fraction", "invalid float", "invalid integer"].iter().any(|problem| message.starts_with(problem));
    let is_date = message.starts_with("invalid type: map, expected a string");
    if is_number || is_date { "; a text stands in quotes" } else { "" }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[test]
    fn hidden_characters_become_codes() {
        for (text, expected) in [
            ("plain\ttext\n", "plain\ttext\n"),
            ("a\u{202e}b", "a⟨U+202E⟩b"),
            ("\u{1b}[31mred", "⟨U+001B⟩[31mred"),
            ("a\r\u{e0041}ü\u{ad}", "a⟨U+000D⟩⟨U+E0041⟩ü⟨U+00AD⟩"),
            ("a\u{3164}\u{34f}\u{e0101}", "a⟨U+3164⟩⟨U+034F⟩⟨U+E0101⟩"),
            ("⚠\u{fe0f} עברית", "⚠\u{fe0f} עברית"),
        ] {
            assert_eq!(escape_hidden(text), expected);
        }
    }

    #[test]
    fn own_styles_are_kept() {
        let text = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m \u{1b}[2J\u{1b}[8mhidden\r";
        let expected = "\u{1b}[1m\u{1b}[32m✓\u{1b}[0m ⟨U+001B⟩[2J⟨U+001B⟩[8mhidden⟨U+000D⟩";
        assert_eq!(escape_hidden_except_styles(text), expected);
        assert_eq!(escape_hidden_except_styles("as it is"), "as it is");
    }

    #[test]
    fn other_models_are_recognized() {
        for (asked, served) in [
            ("gpt-4o", "qwen2-vl-2b-instruct"),
            ("gpt-4o", "gpt-4o-mini-2024-07-18"),
            ("qwen2-vl-72b", "Qwen/Qwen2-VL-7B-Instruct"),
            ("llava-1.6", "phi-3.5-vision-instruct"),
            ("org/gemma-3-27b-it", "gemma-3-4b-it"),
            ("claude-sonnet-4-5", "gpt-4.1"),
        ] {
            assert!(is_other_model(asked, served), "{asked} {served}");
        }
    }

    #[test]
    fn completed_names_are_no_other_models() {
        for (asked, served) in [
            ("gpt-4o", "gpt-4o-2024-11-20"),
            ("gpt-4o-mini", "gpt-4o-mini-2024-07-18"),
            ("claude-3-5-sonnet-latest", "claude-3-5-sonnet-20241022"),
            ("gemini-flash-latest", "gemini-2.5-flash"),
            ("qwen2.5vl:7b", "Qwen/Qwen2.5-VL-7B-Instruct"),
            ("qwen2.5-vl-7b", "/models/Qwen2.5-VL-7B-Instruct-Q4_K_M.gguf"),
            ("Qwen2.5-VL-7B", "C:\\models\\qwen2.5-vl-7b-q8_0.gguf"),
            ("meta-llama/Llama-3.2-11B-Vision-Instruct", "llama-3.2-11b-vision"),
            ("google/gemini-2.5-flash", "gemini-2.5-flash"),
            ("openai/gpt-4o:free", "openai/gpt-4o"),
            ("my-deployment", "gpt-4o-2024-08-06"),
            ("gpt-4o", "default"),
            ("tiny", "tiny-text.gguf"),
            ("m", "mock-1"),
            ("", ""),
        ] {
            assert!(!is_other_model(asked, served), "{asked} {served}");
        }
    }

    #[test]
    fn path_and_case_are_ignored() {
        assert!(is_same_name("Qwen/Qwen2-VL", "qwen2-vl"));
        assert!(!is_same_name("gpt-4o-2024-08-06", "gpt-4o-2024-11-20"));
    }

    #[test]
    fn only_similar_names_are_suggested() {
        let known = ["lift", "gray-gain", "speed", "angle", "ruas-lol", "ruas-upe"];
        for (name, meant) in [
            ("lfit", "lift"),
            ("Lift", "lift"),
            ("graygain", "gray-gain"),
            ("sped", "speed"),
            ("angel", "angle"),
            ("ruas", "ruas-lol"),
        ] {
            assert_eq!(nearest(name, &known), Some(meant), "{name}");
        }
        for name in ["zoom", "", "darkir"] {
            assert_eq!(nearest(name, &known), None, "{name}");
        }
        assert_eq!(suggestion("sped", &known), "; did you mean speed?");
        assert_eq!(suggestion("zoom", &known), "");
    }

    #[test]
    fn quotes_only_where_needed() {
        for plain in ["set/a-1.png", "C:/x", "options=A,B:index0", "été"] {
            assert_eq!(shell_word(plain), plain);
        }
        for (text, word) in [
            ("", "''"),
            ("a b", "'a b'"),
            ("it's", "'it'\\''s'"),
            ("$HOME", "'$HOME'"),
            ("a(1)", "'a(1)'"),
            ("{id}.jpg", "'{id}.jpg'"),
            ("~x", "'~x'"),
        ] {
            assert_eq!(shell_word(text), word);
        }
    }

    #[cfg(unix)]
    #[test]
    fn sh_reads_the_original_text_back() {
        for text in ["a b", "it's", "$(id) `id` \\ \"x\"", "a\nb", "*?[!]#&;|<>"] {
            let command = format!("printf %s {}", shell_word(text));
            let mut shell = std::process::Command::new("sh");
            let output = shell.args(["-c", &command]).output().unwrap();
            assert_eq!(output.stdout, text.as_bytes(), "{text:?}");
        }
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Known {
        #[expect(dead_code)]
        range_in: Option<String>,
        #[expect(dead_code)]
        multiple: Option<u32>,
    }

    #[test]
    fn faults_have_a_line_and_a_hint() {
        for (text, line, part) in [
            ("\nrange = \"0..1\"", 2, "; did you mean range_in?"),
            ("range_in = 0..1", 1, "; a text stands in quotes"),
            ("multiple = 2\nrange_in = nchw", 2, "; a text stands in quotes"),
            ("range_in = 2024-01-01", 1, "; a text stands in quotes"),
        ] {
            let fault = TomlFault::new(text, &toml::from_str::<Known>(text).unwrap_err());
            assert_eq!(fault.line, line, "{fault:?}");
            assert!(fault.problem.ends_with(part), "{fault:?}");
            assert!(!fault.problem.contains('\n'), "{fault:?}");
        }
        for text in [
            "multiple = \"2\"",
            "zoom = 1 # far",
            "multiple = true",
            "multiple = 1_0.5",
            "range_in = [1]",
            "multiple = True",
            "range_in = gpt-4o",
            "range_in = \"a\" \"b=c\"",
            "range_in == \"a\"",
            "\"a=b\" = 3 4",
            "zoom = 2024-01-01",
        ] {
            let fault = TomlFault::new(text, &toml::from_str::<Known>(text).unwrap_err());
            assert!(!fault.problem.contains(';'), "{fault:?}");
        }
    }
}
