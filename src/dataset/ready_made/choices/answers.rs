//! Interpretation of the answers in a ready-made set: [`Reading`], and [`one_reading`] to find the one that fits all rows.

use super::offered::{Offered, Origin, one_line};
use crate::types::Choices;
use crate::types::questions::letter;

/// How an answer identifies a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::dataset::ready_made) enum Reading {
    /// Letter of the choice: `A`, `(a)` or `A.`. A lower-case letter needs a bracket, full stop or colon.
    Letter,
    /// Text of the choice, ignoring letter case, surrounding space and a final full stop.
    Text,
    /// Number of the choice, counted from 0.
    Index0,
    /// Number of the choice, counted from 1.
    Index1,
}

impl Reading {
    pub(in crate::dataset::ready_made) const ALL: [Self; 4] =
        [Self::Letter, Self::Text, Self::Index0, Self::Index1];

    /// Name in `--map` and messages.
    pub(in crate::dataset::ready_made) fn name(self) -> &'static str {
        match self {
            Self::Letter => "letter",
            Self::Text => "text",
            Self::Index0 => "index0",
            Self::Index1 => "index1",
        }
    }

    pub(in crate::dataset::ready_made) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|reading| reading.name() == name)
    }

    /// Index of the choice that the answer identifies; `None` if it identifies none.
    pub(in crate::dataset::ready_made) fn truth(
        self,
        answer: &str,
        options: &Offered,
    ) -> Option<usize> {
        let option_at = |wanted: usize| options.places.iter().position(|place| *place == wanted);
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
                option_at((0..Choices::MOST).find(|&index| letter(index) == upper)?)
            }
            Self::Text => {
                let answer = folded(answer);
                options
                    .texts
                    .iter()
                    .position(|option| folded(option) == answer)
            }
            Self::Index0 => option_at(number(answer)?),
            Self::Index1 => option_at(number(answer)?.checked_sub(1)?),
        }
    }

    /// Like [`Self::truth`], for a reading that the user did not choose: numbers identify none of the options that a question's text
    /// lists by letter.
    pub(in crate::dataset::ready_made) fn by_rule(
        self,
        answer: &str,
        options: &Offered,
    ) -> Option<usize> {
        let is_number = matches!(self, Self::Index0 | Self::Index1);
        if is_number && options.origin == Origin::Question {
            return None;
        }
        self.truth(answer, options)
    }
}

/// Normalizes a text for comparison: one line in lower case, without surrounding space and full stops at its end.
pub(super) fn folded(text: &str) -> String {
    let text = one_line(text);
    text.trim_end_matches('.').trim_end().to_lowercase()
}

/// Parses a whole number, written as `3` or `3.0`.
fn number(text: &str) -> Option<usize> {
    let digits = text.strip_suffix(".0").unwrap_or(text);
    let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

/// An answer, with the options of its row.
pub(super) type AnswerOf<'a> = (&'a str, &'a Offered);

/// Result of the search for one reading of all answers.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum OneReading {
    /// This reading fits all rows.
    Fits(Reading),
    /// No reading fits all rows: the one that fits most, and the indices of the rows that it does not fit.
    None { best: Reading, unfit: Vec<usize> },
    /// Two readings fit all rows, but identify different choices in this row.
    Ambiguous { readings: [Reading; 2], row: usize },
}

/// Finds the reading that fits the answers of all rows; the first of several that agree in every row.
pub(super) fn one_reading(rows: &[AnswerOf<'_>]) -> OneReading {
    let unfit_rows = Reading::ALL.map(|reading| {
        let unfit: Vec<usize> = rows
            .iter()
            .enumerate()
            .filter(|(_, (answer, options))| reading.by_rule(answer, options).is_none())
            .map(|(row, _)| row)
            .collect();
        (reading, unfit)
    });
    let fitting: Vec<Reading> = unfit_rows
        .iter()
        .filter(|(_, unfit)| unfit.is_empty())
        .map(|(reading, _)| *reading)
        .collect();
    let Some((&first, others)) = fitting.split_first() else {
        let (best, unfit) = unfit_rows
            .into_iter()
            .min_by_key(|(reading, unfit)| (unfit.len(), *reading))
            .unwrap_or((Reading::Text, Vec::new()));
        return OneReading::None { best, unfit };
    };
    for (row, (answer, options)) in rows.iter().enumerate() {
        let choice = first.by_rule(answer, options);
        let differing = others
            .iter()
            .find(|other| other.by_rule(answer, options) != choice);
        if let Some(&other) = differing {
            let readings = [first, other];
            return OneReading::Ambiguous { readings, row };
        }
    }
    OneReading::Fits(first)
}

/// Index of the choice of a yes/no question that the answer identifies: 0 for yes, 1 for no.
pub(in crate::dataset::ready_made) fn yes_or_no(answer: &str) -> Option<usize> {
    match &*folded(answer) {
        "yes" | "true" => Some(0),
        "no" | "false" => Some(1),
        _ => None,
    }
}

/// Index of the choice of a yes/no question that a digit identifies: 0 (yes) for the digit 1, 1 (no) for the digit 0.
pub(in crate::dataset::ready_made) fn digit(answer: &str) -> Option<usize> {
    match number(answer.trim()) {
        Some(1) => Some(0),
        Some(0) => Some(1),
        _ => None,
    }
}

/// True if the question begins with a verb that asks for yes or no.
pub(super) fn asks_yes_or_no(question: &str) -> bool {
    const VERBS: [&str; 15] = [
        "is", "are", "was", "were", "do", "does", "did", "can", "could", "has", "have", "had",
        "will", "would", "should",
    ];
    let first: String = question
        .trim_start()
        .chars()
        .take_while(|c| c.is_alphanumeric() || *c == '\'')
        .collect();
    VERBS.iter().any(|verb| first.eq_ignore_ascii_case(verb))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(texts: &[&str]) -> Offered {
        Offered::listed(&texts.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn letters_and_numbers_count_empty_columns() {
        let offered = Offered {
            texts: ["red", "blue"].map(str::to_owned).into(),
            places: vec![0, 2],
            origin: Origin::Columns,
        };
        let read = |answer: &str| Reading::ALL.map(|reading| reading.truth(answer, &offered));
        assert_eq!(read("C"), [Some(1), None, None, None]);
        assert_eq!(read("B"), [None; 4]);
        assert_eq!(read("2"), [None, None, Some(1), None]);
        assert_eq!(read("3"), [None, None, None, Some(1)]);
    }

    #[test]
    fn each_reading_accepts_its_own_forms() {
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
            let read = Reading::ALL.map(|reading| reading.truth(answer, &texts));
            assert_eq!(read, [letter, text, index0, index1], "{answer}");
        }
    }

    #[test]
    fn one_reading_must_fit_all_rows() {
        let (two, letters) = (options(&["x", "y", "z"]), options(&["B", "A"]));
        let rows: [AnswerOf<'_>; 2] = [("1", &two), ("0", &two)];
        assert_eq!(one_reading(&rows), OneReading::Fits(Reading::Index0));
        let rows: [AnswerOf<'_>; 2] = [("1", &two), ("2", &two)];
        let readings = [Reading::Index0, Reading::Index1];
        assert_eq!(
            one_reading(&rows),
            OneReading::Ambiguous { readings, row: 0 }
        );
        let rows: [AnswerOf<'_>; 1] = [("A", &letters)];
        let readings = [Reading::Letter, Reading::Text];
        assert_eq!(
            one_reading(&rows),
            OneReading::Ambiguous { readings, row: 0 }
        );
        let rows: [AnswerOf<'_>; 3] = [("x", &two), ("A", &two), ("y", &two)];
        let unfit = vec![1];
        assert_eq!(
            one_reading(&rows),
            OneReading::None {
                best: Reading::Text,
                unfit
            }
        );
        // Readings that agree in every row are not ambiguous.
        let same = options(&["A", "B"]);
        assert_eq!(
            one_reading(&[("B", &same)]),
            OneReading::Fits(Reading::Letter)
        );
    }

    #[test]
    fn yes_or_no_questions_and_answers_are_recognized() {
        assert!(asks_yes_or_no("Is it red?") && asks_yes_or_no(" are they?"));
        assert!(!asks_yes_or_no("How many?") && !asks_yes_or_no("Issue?"));
        assert_eq!(
            (yes_or_no("Yes."), yes_or_no("false"), yes_or_no("1")),
            (Some(0), Some(1), None)
        );
        assert_eq!(
            (digit("1"), digit("0"), digit("2")),
            (Some(0), Some(1), None)
        );
    }
}
