//! Format of the answers in a ready-made set: [`AnswerFormat`], and [`find_format`] to find the one that fits all rows.

use super::option_list::{OptionList, OptionOrigin, one_line};
use darkqa_base::types::Choices;
use darkqa_base::types::questions::letter;

/// How an answer identifies a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AnswerFormat {
    /// Letter of the choice: `A`, `(a)` or `A.`. A lower-case letter needs a bracket, full stop or colon.
    Letter,
    /// Text of the choice, ignoring letter case, surrounding space and a final full stop.
    Text,
    /// Number of the choice, counted from 0.
    Index0,
    /// Number of the choice, counted from 1.
    Index1,
}

impl AnswerFormat {
    pub const ALL: [Self; 4] = [Self::Letter, Self::Text, Self::Index0, Self::Index1];

    /// Name in `--map` and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Letter => "letter",
            Self::Text => "text",
            Self::Index0 => "index0",
            Self::Index1 => "index1",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// Index of the choice that the answer identifies; `None` if it identifies none.
    pub fn choice_index(self, answer: &str, options: &OptionList) -> Option<usize> {
        let answer = answer.trim();
        match self {
            Self::Letter => {
                let bare = answer.trim_matches(['(', ')', '.', ':', ' ']);
                let mut chars = bare.chars();
                let (Some(character), None) = (chars.next(), chars.next()) else {
                    return None;
                };
                let is_bare = bare.len() == answer.len();
                if is_bare && !character.is_ascii_uppercase() {
                    return None;
                }
                let upper = character.to_ascii_uppercase();
                option_at(options, (0..Choices::MOST).find(|&index| letter(index) == upper)?)
            }
            Self::Text => {
                let answer = normalize_text(answer);
                options.texts.iter().position(|option| normalize_text(option) == answer)
            }
            Self::Index0 => option_at(options, parse_index(answer)?),
            Self::Index1 => option_at(options, parse_index(answer)?.checked_sub(1)?),
        }
    }

    /// Like [`Self::choice_index`], for a format that the user chose: a letter may be in lower case.
    pub(super) fn chosen_choice_index(self, answer: &str, options: &OptionList) -> Option<usize> {
        match self {
            Self::Letter => self.choice_index(&answer.to_ascii_uppercase(), options),
            Self::Text | Self::Index0 | Self::Index1 => self.choice_index(answer, options),
        }
    }

    /// Like [`Self::choice_index`], for a format that the user did not choose: numbers do not identify options that the
    /// text of the question lists by letter.
    pub fn inferred_choice_index(self, answer: &str, options: &OptionList) -> Option<usize> {
        let is_number = matches!(self, Self::Index0 | Self::Index1);
        if is_number && options.origin == OptionOrigin::Question {
            return None;
        }
        self.choice_index(answer, options)
    }
}

/// Index of the option with this position in its row.
fn option_at(options: &OptionList, wanted: usize) -> Option<usize> {
    options.positions.iter().position(|position| *position == wanted)
}

/// Normalizes a text for comparison: one line in lower case, without surrounding space and full stops at its end.
fn normalize_text(text: &str) -> String {
    let text = one_line(text);
    text.trim_end_matches('.').trim_end().to_lowercase()
}

/// Parses a whole number, written as `3` or `3.0`.
fn parse_index(text: &str) -> Option<usize> {
    let digits = text.strip_suffix(".0").unwrap_or(text);
    let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

/// Answer of a row, with the options of the row.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowAnswer<'a> {
    pub(super) answer: &'a str,
    pub(super) options: &'a OptionList,
}

impl RowAnswer<'_> {
    /// Index of the choice that the answer identifies in an inferred format.
    fn choice_index(self, format: AnswerFormat) -> Option<usize> {
        format.inferred_choice_index(self.answer, self.options)
    }
}

/// Result of the search for one format of all answers.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum FormatSearch {
    /// This format fits all rows.
    Fits(AnswerFormat),
    /// No format fits all rows: the one that fits most, and the indices of the rows that it does not fit.
    None { best: AnswerFormat, unfit: Vec<usize> },
    /// Two formats fit all rows, but identify different choices in this row.
    Ambiguous { formats: [AnswerFormat; 2], row: usize },
}

/// Finds the format that fits the answers of all rows; the first of several that agree in every row.
pub(super) fn find_format(rows: &[RowAnswer<'_>]) -> FormatSearch {
    let unfit_rows = AnswerFormat::ALL.map(|format| {
        let unfit: Vec<usize> = rows
            .iter()
            .enumerate()
            .filter(|(_, row)| row.choice_index(format).is_none())
            .map(|(index, _)| index)
            .collect();
        (format, unfit)
    });
    let fitting: Vec<AnswerFormat> =
        unfit_rows.iter().filter(|(_, unfit)| unfit.is_empty()).map(|(format, _)| *format).collect();
    let Some((&first, others)) = fitting.split_first() else {
        let (best, unfit) = unfit_rows
            .into_iter()
            .min_by_key(|(format, unfit)| (unfit.len(), *format))
            .unwrap_or((AnswerFormat::Text, Vec::new()));
        return FormatSearch::None { best, unfit };
    };
    for (index, row) in rows.iter().enumerate() {
        let choice = row.choice_index(first);
        let differing = others.iter().find(|other| row.choice_index(**other) != choice);
        if let Some(&other) = differing {
            return FormatSearch::Ambiguous { formats: [first, other], row: index };
        }
    }
    FormatSearch::Fits(first)
}

/// Index of the choice of a yes/no question that the answer identifies: 0 for yes, 1 for no.
pub(crate) fn yes_no_index(answer: &str) -> Option<usize> {
    match &*normalize_text(answer) {
        "yes" | "true" => Some(0),
        "no" | "false" => Some(1),
        _ => None,
    }
}

/// Index of the choice of a yes/no question that a digit identifies: 0 (yes) for the digit 1, 1 (no) for the digit 0.
pub(crate) fn digit_index(answer: &str) -> Option<usize> {
    match parse_index(answer.trim()) {
        Some(1) => Some(0),
        Some(0) => Some(1),
        _ => None,
    }
}

/// True if the question begins with a verb that asks for yes or no.
pub(super) fn asks_yes_or_no(question: &str) -> bool {
    const VERBS: [&str; 15] = [
        "is", "are", "was", "were", "do", "does", "did", "can", "could", "has", "have", "had", "will", "would",
        "should",
    ];
    let first: String = question.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '\'').collect();
    VERBS.iter().any(|verb| first.eq_ignore_ascii_case(verb))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(texts: &[&str]) -> OptionList {
        OptionList::from_list(&texts.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn letters_and_numbers_count_empty_columns() {
        let options = OptionList {
            texts: ["red", "blue"].map(str::to_owned).into(),
            positions: vec![0, 2],
            origin: OptionOrigin::Columns,
        };
        let read = |answer: &str| AnswerFormat::ALL.map(|format| format.choice_index(answer, &options));
        assert_eq!(read("C"), [Some(1), None, None, None]);
        assert_eq!(read("B"), [None; 4]);
        assert_eq!(read("2"), [None, None, Some(1), None]);
        assert_eq!(read("3"), [None, None, None, Some(1)]);
    }

    #[test]
    fn each_format_accepts_its_own_answers() {
        let texts = options(&["Red", "2", "blue."]);
        for (answer, letter, text, index0, index1) in [
            ("A", Some(0), None, None, None),
            ("(b)", Some(1), None, None, None),
            ("c.", Some(2), None, None, None),
            ("c", None, None, None, None),
            ("D", None, None, None, None),
            ("red", None, Some(0), None, None),
            ("Blue", None, Some(2), None, None),
            ("2", None, Some(1), Some(2), Some(1)),
            ("0", None, None, Some(0), None),
            ("3.0", None, None, None, Some(2)),
            ("1.5", None, None, None, None),
            ("-1", None, None, None, None),
        ] {
            let read = AnswerFormat::ALL.map(|format| format.choice_index(answer, &texts));
            assert_eq!(read, [letter, text, index0, index1], "{answer}");
        }
    }

    fn find(answers: &[&str], texts: &[&str]) -> FormatSearch {
        let options = options(texts);
        let rows: Vec<RowAnswer<'_>> = answers.iter().map(|answer| RowAnswer { answer, options: &options }).collect();
        find_format(&rows)
    }

    #[test]
    fn one_format_must_fit_all_rows() {
        let texts = ["x", "y", "z"];
        assert_eq!(find(&["1", "0"], &texts), FormatSearch::Fits(AnswerFormat::Index0));
        let formats = [AnswerFormat::Index0, AnswerFormat::Index1];
        assert_eq!(find(&["1", "2"], &texts), FormatSearch::Ambiguous { formats, row: 0 });
        let formats = [AnswerFormat::Letter, AnswerFormat::Text];
        assert_eq!(find(&["A"], &["B", "A"]), FormatSearch::Ambiguous { formats, row: 0 });
        assert_eq!(find(&["x", "A", "y"], &texts), FormatSearch::None { best: AnswerFormat::Text, unfit: vec![1] });
        // Formats that agree in every row are not ambiguous.
        assert_eq!(find(&["B"], &["A", "B"]), FormatSearch::Fits(AnswerFormat::Letter));
    }

    #[test]
    fn yes_or_no_questions_and_answers_are_recognized() {
        assert!(asks_yes_or_no("Is it red?") && asks_yes_or_no(" are they?"));
        assert!(!asks_yes_or_no("How many?") && !asks_yes_or_no("Issue?"));
        assert_eq!((yes_no_index("Yes."), yes_no_index("false"), yes_no_index("1")), (Some(0), Some(1), None));
        assert_eq!((digit_index("1"), digit_index("0"), digit_index("2")), (Some(0), Some(1), None));
    }
}
