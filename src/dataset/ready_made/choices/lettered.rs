//! Options with their letters in a text: [`in_question`], [`in_cell`], [`without_letters`].

use std::sync::LazyLock;

use regex::Regex;

use crate::dataset::ready_made::columns::names::without_endings;
use crate::types::Choices;
use crate::types::questions::letter;
use crate::types::text::excerpt;

/// A letter of an option in a text: `(A)`, `A.`, `A)` or `A:`.
struct Mark {
    /// Where the mark begins.
    start: usize,
    /// Where the text of the option begins.
    end: usize,
    letter: char,
}

/// The form of options with letters in a question.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum Lettered {
    None,
    /// The question, with what stands behind the options as its last line, and the options.
    Found {
        question: String,
        options: Vec<String>,
    },
    /// It cannot be told where the options begin or end; in words.
    Unclear(String),
}

/// Words of a sentence that states how to answer, by which it is told from an option.
static INSTRUCTION: LazyLock<Option<Regex>> = LazyLock::new(|| {
    Regex::new(concat!(
        r"(?i)\b(?:please|answer (?:with|using|by|in|the|directly|only)|(?:select|choose|pick) (?:the|one|from|your)",
        r"|(?:respond|reply) (?:with|in|by|only)|letter of the)\b"
    ))
    .ok()
});

/// The question and the options of a text that holds options: those of the last run of the marks A, B, … in order, at least two, whose
/// options have a letter or a digit each. A mark stands at the start, or after space, a comma, a semicolon or a colon. The last option
/// ends with its line, if the others stand on one line each; what follows belongs to the question.
pub(in crate::dataset::ready_made) fn in_question(text: &str) -> Lettered {
    let (body, _) = without_endings(text);
    let tail = text[body.len()..].trim();
    let marks = marks(body);
    let begins_line = |mark: &&Mark| {
        let before = body[..mark.start].trim_end_matches([' ', '\t']);
        before.is_empty() || before.ends_with('\n')
    };
    let runs = (0..marks.len())
        .rev()
        .filter(|&at| marks[at].letter == 'A')
        .map(|start| run(&marks[start..]))
        .filter(|run| run.len() > 1);
    let mut found = None;
    for run in runs {
        let (options, rest) = match split(body, &run) {
            Ok(parts) => parts,
            Err(problem) if found.is_none() => return Lettered::Unclear(problem),
            Err(_) => continue,
        };
        let are_options = options
            .iter()
            .all(|option| option.contains(char::is_alphanumeric));
        if !are_options {
            continue;
        }
        let are_lines = run.iter().all(begins_line);
        match &found {
            None => {
                found = Some((run[0].start, options, rest));
                if are_lines {
                    break;
                }
            }
            Some(_) if are_lines => {
                return Lettered::Unclear(
                    "letters of options occur twice in the question, and it is not clear which are meant; write the options in columns of \
                     their own".to_owned(),
                );
            }
            Some(_) => {}
        }
    }
    let Some((start, options, rest)) = found else {
        return Lettered::None;
    };
    let parts = [head(&body[..start]), rest, tail];
    let parts = parts.into_iter().filter(|part| !part.is_empty());
    Lettered::Found {
        question: parts.collect::<Vec<&str>>().join("\n"),
        options,
    }
}

/// The text before options, without the word that announces them.
fn head(text: &str) -> &str {
    let text = text.trim();
    let words = ["options:", "option:", "choices:"];
    let announced = words.iter().find_map(|word| {
        let cut = text.len().checked_sub(word.len())?;
        let tail = text.get(cut..)?;
        tail.eq_ignore_ascii_case(word).then(|| text[..cut].trim())
    });
    announced.unwrap_or(text)
}

/// The options of a run, and the text behind the last one.
fn split<'a>(text: &'a str, run: &[&Mark]) -> Result<(Vec<String>, &'a str), String> {
    let mut options = texts(text, run);
    let Some(last) = options.pop() else {
        return Ok((options, ""));
    };
    let tells = |option: &String| {
        INSTRUCTION
            .as_ref()
            .is_some_and(|words| words.is_match(option))
    };
    let unclear = || {
        format!(
            "it is not clear where the last option ends: {:?}; write a line break behind it, or the options in columns of their own",
            excerpt(&last, 80)
        )
    };
    let (only, rest) = match last.split_once('\n') {
        None => (last.as_str(), ""),
        Some((only, _)) if !options.iter().any(|option| option.contains('\n')) => {
            let at = run.last().map_or(text.len(), |mark| mark.end + only.len());
            (only, text[at..].trim())
        }
        Some(_) => return Err(unclear()),
    };
    if tells(&only.to_owned()) && !options.iter().any(tells) {
        return Err(unclear());
    }
    let only = only.trim_end_matches(|c: char| c.is_whitespace() || c == ',' || c == ';');
    options.push(only.to_owned());
    Ok((options, rest))
}

/// The options of a cell that has nothing else, as `(a) Open (b) Closed`.
pub(super) fn in_cell(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    let marks: Vec<Mark> = brackets(text);
    let run = run(&marks);
    (run.len() > 1 && run.len() == marks.len() && run[0].start == 0).then(|| texts(text, &run))
}

/// The options without the letters before them, if each has its own: `A. yes`, `B) no`, `(C) maybe`, `D: never`.
pub(super) fn without_letters(options: Vec<String>) -> Vec<String> {
    let bare: Option<Vec<String>> = options
        .iter()
        .enumerate()
        .by_ref()
        .map(|(index, option)| after_letter(option, index))
        .collect();
    bare.unwrap_or(options)
}

/// The text after the letter of an index; `None` without it.
fn after_letter(text: &str, index: usize) -> Option<String> {
    if index >= Choices::MOST {
        return None;
    }
    let text = text.trim();
    let text = text.strip_prefix(['(', '（']).unwrap_or(text);
    let rest = text.strip_prefix([letter(index), full_width(letter(index))])?;
    let rest = rest.strip_prefix(CLOSES)?.trim();
    (!rest.is_empty()).then(|| rest.to_owned())
}

/// Marks behind the letter of an option, also full-width ones, as Chinese and Japanese sets have them.
const CLOSES: [char; 8] = ['.', ')', ':', '．', '。', '）', '：', '、'];

/// The full-width form of a sign of ASCII.
fn full_width(c: char) -> char {
    char::from_u32(c as u32 + 0xFEE0).unwrap_or(c)
}

/// The capital letter that a sign is, in either width.
fn capital(c: char) -> Option<char> {
    ('A'..='Z').find(|letter| [*letter, full_width(*letter)].contains(&c))
}

/// The marks A, B, … in order from the first of a list, whose letter is A.
fn run(marks: &[Mark]) -> Vec<&Mark> {
    let mut run: Vec<&Mark> = Vec::new();
    for mark in marks {
        if run.len() < Choices::MOST && mark.letter == letter(run.len()) {
            run.push(mark);
        }
    }
    run
}

/// The texts between the marks of a run, without commas and semicolons at their ends.
fn texts(text: &str, run: &[&Mark]) -> Vec<String> {
    let ends = run[1..].iter().map(|mark| mark.start);
    let spans = run.iter().zip(ends.chain([text.len()]));
    let cut = |c: char| c.is_whitespace() || ",;，；".contains(c);
    spans
        .map(|(mark, end)| {
            let option = text[mark.end..end.max(mark.end)].trim_end_matches(cut);
            option.to_owned()
        })
        .collect()
}

/// All marks of capital letters in a text.
fn marks(text: &str) -> Vec<Mark> {
    let mut marks = Vec::new();
    let mut before = None;
    for (start, c) in text.char_indices() {
        let is_free =
            before.is_none_or(|b: char| b.is_whitespace() || ",;:，；：。？、".contains(b));
        before = Some(c);
        if !is_free {
            continue;
        }
        let rest = &text[start..];
        let opened = rest.strip_prefix(['(', '（']);
        let mut chars = opened.unwrap_or(rest).chars();
        let name = chars.next().and_then(capital);
        let (Some(name), Some(close)) = (name, chars.next()) else {
            continue;
        };
        let closes = match opened {
            Some(_) => matches!(close, ')' | '）'),
            None => CLOSES.contains(&close),
        };
        if closes {
            marks.push(mark(text, start, text.len() - chars.as_str().len(), name));
        }
    }
    marks
}

/// All letters in brackets in a text, of either case, as capitals.
fn brackets(text: &str) -> Vec<Mark> {
    let starts = text.match_indices(['(', '（']);
    let found = starts.filter_map(|(start, open)| {
        let mut chars = text[start + open.len()..].chars();
        let (name, close) = (chars.next()?, chars.next()?);
        let name = capital(name.to_ascii_uppercase())?;
        let end = text.len() - chars.as_str().len();
        matches!(close, ')' | '）').then(|| mark(text, start, end, name))
    });
    found.collect()
}

/// A mark whose option begins at the first character after `end` that is no space.
fn mark(text: &str, start: usize, end: usize, letter: char) -> Mark {
    let rest = &text[end..];
    let end = end + rest.len() - rest.trim_start().len();
    Mark { start, end, letter }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_at_the_end_of_a_question_are_found() {
        for (text, question, options) in [
            (
                "Which?\nOptions: A: red, B: green, C: blue",
                "Which?",
                vec!["red", "green", "blue"],
            ),
            ("Which?\nA. red\nB. green", "Which?", vec!["red", "green"]),
            (
                "Which? (A) red (B) a.b; (C) no",
                "Which?",
                vec!["red", "a.b", "no"],
            ),
            (
                "Is A. or B. better?\nA) one\nB) two",
                "Is A. or B. better?",
                vec!["one", "two"],
            ),
            ("Which?\nChoices:\nA.1\nB.2", "Which?", vec!["1", "2"]),
            ("走哪边？\nA、左\nB、右", "走哪边？", vec!["左", "右"]),
            ("走哪边？（A）左，（B）右", "走哪边？", vec!["左", "右"]),
            (
                "Which?\n(A) red\n(B) blue\nThink of it first.",
                "Which?\nThink of it first.",
                vec!["red", "blue"],
            ),
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
            let found = Lettered::Found {
                question: question.to_owned(),
                options: options.iter().map(ToString::to_string).collect(),
            };
            assert_eq!(in_question(text), found, "{text}");
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
            assert_eq!(in_question(text), Lettered::None, "{text}");
        }
        for text in [
            "Which? (A) red (B) blue Answer with the right one.",
            "Which?\nA. one\nof two\nB. three\nof four",
            "Which?\nA. one\nB. two\nSay (A) or (B) only",
        ] {
            let found = in_question(text);
            assert!(matches!(found, Lettered::Unclear(_)), "{text}: {found:?}");
        }
    }

    #[test]
    fn a_cell_of_options_holds_nothing_else() {
        assert_eq!(in_cell("(a) Open (b) Closed").unwrap(), ["Open", "Closed"]);
        assert_eq!(in_cell("（A）开（B）关").unwrap(), ["开", "关"]);
        for text in [
            "(a) Open",
            "see (a) x (b) y",
            "(b) x (a) y",
            "(a) f(x) (b) y (x) z",
            "red|green",
        ] {
            assert_eq!(in_cell(text), None, "{text}");
        }
    }

    #[test]
    fn letters_are_cut_if_every_option_has_its_own() {
        let cut =
            |options: &[&str]| without_letters(options.iter().map(ToString::to_string).collect());
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
