//! Options with their letters in a text: [`in_question`], [`in_cell`], [`without_letters`].

use crate::types::Choices;
use crate::types::question::letter;

/// A letter of an option in a text: `(A)`, `A.`, `A)` or `A:`.
struct Mark {
    /// Where the mark begins.
    start: usize,
    /// Where the text of the option begins.
    end: usize,
    letter: char,
}

/// The question and the options of a text that ends with options: those of the last run of the marks A, B, … in order, at least two.
/// A mark stands at the start, or after space, a comma, a semicolon or a colon.
pub(super) fn in_question(text: &str) -> Option<(String, Vec<String>)> {
    let marks = marks(text);
    let starts = (0..marks.len()).rev();
    let mut starts = starts.filter(|&at| marks[at].letter == 'A');
    let run = starts.find_map(|start| {
        let run = run(&marks[start..]);
        (run.len() > 1).then_some(run)
    })?;
    let options = texts(text, &run);
    let head = text[..run[0].start].trim_end();
    let head = ["options:", "option:", "choices:"]
        .iter()
        .find_map(|word| {
            let cut = head.len().checked_sub(word.len())?;
            let tail = head.get(cut..)?;
            tail.eq_ignore_ascii_case(word).then(|| &head[..cut])
        })
        .unwrap_or(head);
    Some((head.trim().to_owned(), options))
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
    let mut bare = options.iter().enumerate();
    let bare: Option<Vec<String>> = bare
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
    let text = text.strip_prefix('(').unwrap_or(text);
    let rest = text.strip_prefix(letter(index))?;
    let rest = rest.strip_prefix(['.', ')', ':'])?.trim();
    (!rest.is_empty()).then(|| rest.to_owned())
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
    let cut = |c: char| c.is_whitespace() || c == ',' || c == ';';
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
        let is_free = before.is_none_or(|b: char| b.is_whitespace() || ",;:".contains(b));
        before = Some(c);
        if !is_free {
            continue;
        }
        let rest = &text[start..];
        let (open, body) = match rest.strip_prefix('(') {
            Some(body) => (1, body),
            None => (0, rest),
        };
        let mut chars = body.chars();
        let (Some(name @ 'A'..='Z'), Some(close)) = (chars.next(), chars.next()) else {
            continue;
        };
        let closes = if open == 1 {
            close == ')'
        } else {
            matches!(close, '.' | ')' | ':')
        };
        if closes {
            marks.push(mark(text, start, start + open + 2, name));
        }
    }
    marks
}

/// All letters in brackets in a text, of either case, as capitals.
fn brackets(text: &str) -> Vec<Mark> {
    let starts = text.match_indices('(');
    let found = starts.filter_map(|(start, _)| {
        let mut chars = text[start + 1..].chars();
        let (name, close) = (chars.next()?, chars.next()?);
        let is_mark = name.is_ascii_alphabetic() && close == ')';
        is_mark.then(|| mark(text, start, start + 3, name.to_ascii_uppercase()))
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
        ] {
            let found = in_question(text).unwrap();
            assert_eq!(
                (found.0.as_str(), found.1),
                (question, options.iter().map(ToString::to_string).collect()),
                "{text}"
            );
        }
        for text in [
            "Which?",
            "What is A.?",
            "Vitamin A. and no more",
            "B. one C. two",
            "e.g.A.x",
        ] {
            assert_eq!(in_question(text), None, "{text}");
        }
    }

    #[test]
    fn a_cell_of_options_holds_nothing_else() {
        assert_eq!(in_cell("(a) Open (b) Closed").unwrap(), ["Open", "Closed"]);
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
        for kept in [["A. yes", "no"], ["B. yes", "A. no"], ["A.", "B."]] {
            assert_eq!(cut(&kept), kept);
        }
    }
}
