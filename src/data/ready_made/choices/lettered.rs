//! Options with letters in a text: [`find_in_question`], [`split_cell`], [`without_letters`].

use std::sync::LazyLock;

use regex::Regex;

use crate::ready_made::columns::map::split_instructions;
use darkqa_base::types::Choices;
use darkqa_base::types::questions::letter;
use darkqa_base::types::text::excerpt;

/// Letter of an option in a text: `(A)`, `A.`, `A)` or `A:`.
struct OptionLetter {
    /// Byte offset of the mark.
    start: usize,
    /// Byte offset of the option after the mark.
    end: usize,
    letter: char,
}

/// Options with letters in the text of a question.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum LetteredOptions {
    /// The text has no options.
    None,
    Found {
        /// The question, followed by the text after the options.
        question: String,
        options: Vec<String>,
    },
    /// It is not clear where the options begin or end: the error message.
    Unclear(String),
}

/// Words of an instruction how to answer, which distinguish it from an option.
static INSTRUCTION: LazyLock<Option<Regex>> = LazyLock::new(|| {
    Regex::new(concat!(
        r"(?i)\b(?:please|answer (?:with|using|by|in|the|directly|only)|(?:select|choose|pick) (?:the|one|from|your)",
        r"|(?:respond|reply) (?:with|in|by|only)|letter of the)\b"
    ))
    .ok()
});

/// Splits a text into the question and its options.
///
/// The options follow the last sequence of at least two marks A, B, … in order. Each option has a letter or a digit. A
/// mark is at the start, or after space, a comma, a semicolon or a colon. If the other options have one line each, the
/// last option ends with its line, and the rest belongs to the question.
pub(crate) fn find_in_question(text: &str) -> LetteredOptions {
    let (body, _) = split_instructions(text);
    let tail = text[body.len()..].trim();
    let marks = marks(body);
    let mut found = None;
    for start in (0..marks.len()).rev() {
        if marks[start].letter != 'A' {
            continue;
        }
        let run = alphabetical_run(&marks[start..]);
        if run.len() < 2 {
            continue;
        }
        let (options, rest) = match split_options(body, &run) {
            Ok(parts) => parts,
            Err(problem) if found.is_none() => return LetteredOptions::Unclear(problem),
            Err(_) => continue,
        };
        let are_options = options.iter().all(|option| option.contains(char::is_alphanumeric));
        if !are_options {
            continue;
        }
        let are_lines = run.iter().all(|mark| {
            let before = body[..mark.start].trim_end_matches([' ', '\t']);
            before.is_empty() || before.ends_with('\n')
        });
        match &found {
            None => {
                found = Some((run[0].start, options, rest));
                if are_lines {
                    break;
                }
            }
            Some(_) if are_lines => {
                return LetteredOptions::Unclear(
                    "letters of options occur twice in the question, and it is not clear which are meant; write the options in columns of \
                     their own".to_owned(),
                );
            }
            Some(_) => {}
        }
    }
    let Some((start, options, rest)) = found else {
        return LetteredOptions::None;
    };
    let mut parts = vec![without_announcement(&body[..start]), rest, tail];
    parts.retain(|part| !part.is_empty());
    LetteredOptions::Found { question: parts.join("\n"), options }
}

/// Removes the word that announces the options, such as `Options:`, from the end of a text.
fn without_announcement(text: &str) -> &str {
    let text = text.trim();
    let words = ["options:", "option:", "choices:"];
    let announced = words.iter().find_map(|word| {
        let cut = text.len().checked_sub(word.len())?;
        let tail = text.get(cut..)?;
        tail.eq_ignore_ascii_case(word).then(|| text[..cut].trim())
    });
    announced.unwrap_or(text)
}

/// Splits a text into the options of a run of marks, and the text after the last option.
///
/// # Errors
/// If it is not clear where the last option ends.
fn split_options<'a>(text: &'a str, run: &[&OptionLetter]) -> Result<(Vec<String>, &'a str), String> {
    let mut options = option_texts(text, run);
    let Some(last) = options.pop() else {
        return Ok((options, ""));
    };
    let (last_line, rest) = match last.split_once('\n') {
        None => (last.as_str(), ""),
        Some((line, _)) if !options.iter().any(|option| option.contains('\n')) => {
            let end = run.last().map_or(text.len(), |mark| mark.end + line.len());
            (line, text[end..].trim())
        }
        Some(_) => return Err(unclear_end(&last)),
    };
    if is_instruction(last_line) && !options.iter().any(|option| is_instruction(option)) {
        return Err(unclear_end(&last));
    }
    let last_option = last_line.trim_end_matches(|c: char| c.is_whitespace() || c == ',' || c == ';');
    options.push(last_option.to_owned());
    Ok((options, rest))
}

fn unclear_end(last: &str) -> String {
    format!(
        "it is not clear where the last option ends: {:?}; write a line break behind it, or the options in columns of their own",
        excerpt(last, 80)
    )
}

/// True if a text has the words of an instruction how to answer.
fn is_instruction(text: &str) -> bool {
    INSTRUCTION.as_ref().is_some_and(|words| words.is_match(text))
}

/// Splits a cell that has only options, such as `(a) Open (b) Closed`; `None` for other texts.
pub(super) fn split_cell(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    let marks = bracket_marks(text);
    let run = alphabetical_run(&marks);
    let is_only_options = run.len() > 1 && run.len() == marks.len() && run[0].start == 0;
    is_only_options.then(|| option_texts(text, &run))
}

/// Removes the letters before the options, if each option has its own: `A. yes`, `B) no`, `(C) maybe`, `D: never`.
pub(super) fn without_letters(options: Vec<String>) -> Vec<String> {
    options
        .iter()
        .enumerate()
        .map(|(index, option)| after_letter(option, index))
        .collect::<Option<Vec<String>>>()
        .unwrap_or(options)
}

/// Text after the letter of the option with this index; `None` if the text does not start with the letter.
fn after_letter(text: &str, index: usize) -> Option<String> {
    if index >= Choices::MOST {
        return None;
    }
    let text = text.trim();
    let text = text.strip_prefix(['(', '（']).unwrap_or(text);
    let rest = text.strip_prefix([letter(index), full_width(letter(index))])?;
    let rest = rest.strip_prefix(CLOSING_MARKS)?.trim();
    (!rest.is_empty()).then(|| rest.to_owned())
}

/// Characters after the letter of an option, with the full-width ones of Chinese and Japanese sets.
const CLOSING_MARKS: [char; 8] = ['.', ')', ':', '．', '。', '）', '：', '、'];

/// Full-width form of an ASCII character.
fn full_width(c: char) -> char {
    char::from_u32(c as u32 + 0xFEE0).unwrap_or(c)
}

/// Converts a capital letter in either width to ASCII; `None` for other characters.
fn capital_letter(c: char) -> Option<char> {
    ('A'..='Z').find(|letter| [*letter, full_width(*letter)].contains(&c))
}

/// Marks A, B, … in alphabetical order, starting at the first mark, which must be A. Other marks are skipped.
fn alphabetical_run(marks: &[OptionLetter]) -> Vec<&OptionLetter> {
    let mut run: Vec<&OptionLetter> = Vec::new();
    for mark in marks {
        if run.len() < Choices::MOST && mark.letter == letter(run.len()) {
            run.push(mark);
        }
    }
    run
}

/// Texts between the marks of a run, without commas and semicolons at their ends.
fn option_texts(text: &str, run: &[&OptionLetter]) -> Vec<String> {
    let ends = run[1..].iter().map(|mark| mark.start).chain([text.len()]);
    run.iter()
        .zip(ends)
        .map(|(mark, end)| {
            text[mark.end..end.max(mark.end)]
                .trim_end_matches(|c: char| c.is_whitespace() || ",;，；".contains(c))
                .to_owned()
        })
        .collect()
}

/// All marks with capital letters in a text.
fn marks(text: &str) -> Vec<OptionLetter> {
    let mut marks = Vec::new();
    let mut before = None;
    for (start, c) in text.char_indices() {
        let is_separate = before.is_none_or(|b: char| b.is_whitespace() || ",;:，；：。？、".contains(b));
        before = Some(c);
        if !is_separate {
            continue;
        }
        let rest = &text[start..];
        let opened = rest.strip_prefix(['(', '（']);
        let mut chars = opened.unwrap_or(rest).chars();
        let name = chars.next().and_then(capital_letter);
        let (Some(name), Some(close)) = (name, chars.next()) else {
            continue;
        };
        let is_closed = match opened {
            Some(_) => matches!(close, ')' | '）'),
            None => CLOSING_MARKS.contains(&close),
        };
        if is_closed {
            let end = text.len() - chars.as_str().len();
            marks.push(OptionLetter::new(text, start, end, name));
        }
    }
    marks
}

/// All marks with a letter in brackets in a text. Letters of either case become capitals.
fn bracket_marks(text: &str) -> Vec<OptionLetter> {
    text.match_indices(['(', '（'])
        .filter_map(|(start, open)| {
            let mut chars = text[start + open.len()..].chars();
            let (name, close) = (chars.next()?, chars.next()?);
            let name = capital_letter(name.to_ascii_uppercase())?;
            let end = text.len() - chars.as_str().len();
            matches!(close, ')' | '）').then(|| OptionLetter::new(text, start, end, name))
        })
        .collect()
}

impl OptionLetter {
    /// A mark whose option begins at the first character after `end` that is not a space.
    fn new(text: &str, start: usize, end: usize, letter: char) -> Self {
        let rest = &text[end..];
        let end = end + rest.len() - rest.trim_start().len();
        Self { start, end, letter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_at_the_end_of_a_question_are_found() {
        for (text, question, options) in [
            ("Which?\nOptions: A: red, B: green, C: blue", "Which?", vec!["red", "green", "blue"]),
            ("Which?\nA. red\nB. green", "Which?", vec!["red", "green"]),
            ("Which? (A) red (B) a.b; (C) no", "Which?", vec!["red", "a.b", "no"]),
            ("Is A. or B. better?\nA) one\nB) two", "Is A. or B. better?", vec!["one", "two"]),
            ("Which?\nChoices:\nA.1\nB.2", "Which?", vec!["1", "2"]),
            ("走哪边？\nA、左\nB、右", "走哪边？", vec!["左", "右"]),
            ("走哪边？（A）左，（B）右", "走哪边？", vec!["左", "右"]),
            ("Which?\n(A) red\n(B) blue\nThink of it first.", "Which?\nThink of it first.", vec!["red", "blue"]),
            (
                "Which? (A) red (B) blue\nThink of it.\n\nAnswer with the letter.",
                "Which?\nThink of it.\nAnswer with the letter.",
                vec!["red", "blue"],
            ),
            (
                "Which? (A) red (B) blue. Please answer yes or no.",
                "Which?\nPlease answer yes or no.",
                vec!["red", "blue."],
            ),
            (
                "Which?\n(A) red\n(B) blue\nAnswer with (A) or (B).",
                "Which?\nAnswer with (A) or (B).",
                vec!["red", "blue"],
            ),
        ] {
            let found = LetteredOptions::Found {
                question: question.to_owned(),
                options: options.iter().map(ToString::to_string).collect(),
            };
            assert_eq!(find_in_question(text), found, "{text}");
        }
        for text in [
            "Which?",
            "What is A.?",
            "Vitamin A. and no more",
            "B. one C. two",
            "e.g.A.x",
            "Is person (A) left of person (B)?",
            "Which? (A) (B)",
        ] {
            assert_eq!(find_in_question(text), LetteredOptions::None, "{text}");
        }
        for text in [
            "Which? (A) red (B) blue Answer with the right one.",
            "Which?\nA. one\nof two\nB. three\nof four",
            "Which?\nA. one\nB. two\nSay (A) or (B) only",
        ] {
            let found = find_in_question(text);
            assert!(matches!(found, LetteredOptions::Unclear(_)), "{text}: {found:?}");
        }
    }

    #[test]
    fn cell_with_only_options_is_split() {
        assert_eq!(split_cell("(a) Open (b) Closed").unwrap(), ["Open", "Closed"]);
        assert_eq!(split_cell("（A）开（B）关").unwrap(), ["开", "关"]);
        for text in ["(a) Open", "see (a) x (b) y", "(b) x (a) y", "(a) f(x) (b) y (x) z", "red|green"] {
            assert_eq!(split_cell(text), None, "{text}");
        }
    }

    #[test]
    fn letters_are_removed_if_every_option_has_its_own() {
        let cut = |options: &[&str]| without_letters(options.iter().map(ToString::to_string).collect());
        assert_eq!(cut(&["A. yes", "(B) no"]), ["yes", "no"]);
        for own in [
            ["（A） 直走。", "（B） 左转。"],
            ["A、直走。", "B、左转。"],
            ["Ａ．直走。", "Ｂ．左转。"],
            ["A：直走。", "B：左转。"],
            ["A）直走。", "(B) 左转。"],
        ] {
            assert_eq!(cut(&own), ["直走。", "左转。"], "{own:?}");
        }
        for kept in [["A. yes", "no"], ["B. yes", "A. no"], ["A.", "B."]] {
            assert_eq!(cut(&kept), kept);
        }
    }
}
