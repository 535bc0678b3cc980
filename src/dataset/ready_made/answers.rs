//! The meaning of a set's answers: [`Reading`], and the one that fits all rows: [`one_reading`].

use super::offered::{Offered, Origin, one_line};
use crate::types::Choices;
use crate::types::question::letter;

/// A way to read an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Reading {
    /// The letter of a choice, as `A`, `(a)` or `A.`; a lower-case letter alone is none.
    Letter,
    /// The text of a choice; letter case, space around it and a full stop at its end do not matter.
    Text,
    /// The number of a choice, counted from 0.
    Index0,
    /// The number of a choice, counted from 1.
    Index1,
}

impl Reading {
    pub(super) const ALL: [Self; 4] = [Self::Letter, Self::Text, Self::Index0, Self::Index1];

    /// The name in `--map` and messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Letter => "letter",
            Self::Text => "text",
            Self::Index0 => "index0",
            Self::Index1 => "index1",
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|reading| reading.name() == name)
    }

    /// The index of the choice that an answer means; `None` if it means none.
    pub(super) fn truth(self, answer: &str, options: &Offered) -> Option<usize> {
        let at = |wanted: usize| options.places.iter().position(|place| *place == wanted);
        let answer = answer.trim();
        match self {
            Self::Letter => {
                let bare = answer.trim_matches(['(', ')', '.', ':', ' ']);
                let mut chars = bare.chars();
                let (Some(name), None) = (chars.next(), chars.next()) else {
                    return None;
                };
                let is_marked = name.is_ascii_uppercase() || bare.len() < answer.len();
                let mut letters = (0..Choices::MOST).filter(|_| is_marked);
                at(letters.find(|&index| letter(index) == name.to_ascii_uppercase())?)
            }
            Self::Text => {
                let answer = folded(answer);
                options
                    .texts
                    .iter()
                    .position(|option| folded(option) == answer)
            }
            Self::Index0 => at(number(answer)?),
            Self::Index1 => at(number(answer)?.checked_sub(1)?),
        }
    }
}

impl Reading {
    /// The index of the choice that an answer means, where the user names no reading: numbers reveal nothing about options with letters
    /// in the text of a question.
    pub(super) fn by_rule(self, answer: &str, options: &Offered) -> Option<usize> {
        let is_number = matches!(self, Self::Index0 | Self::Index1);
        if is_number && options.origin == Origin::Question {
            return None;
        }
        self.truth(answer, options)
    }
}

/// A text on one line, without letter case, space around it and a full stop at its end.
pub(super) fn folded(text: &str) -> String {
    let text = one_line(text);
    text.trim_end_matches('.').trim_end().to_lowercase()
}

/// The whole number in a text, as `3` or `3.0`.
fn number(text: &str) -> Option<usize> {
    let digits = text.strip_suffix(".0").unwrap_or(text);
    let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

/// An answer and the options of its row.
pub(super) type AnswerOf<'a> = (&'a str, &'a Offered);

/// How the answers of all rows are read.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum OneReading {
    /// By this reading, which fits all rows.
    Fits(Reading),
    /// No reading fits all rows; the one that fits most of them, and the rows that it does not fit.
    None { best: Reading, unfit: Vec<usize> },
    /// Two readings fit all rows, and differ in this row.
    Ambiguous { readings: [Reading; 2], row: usize },
}

/// The reading that fits the answers of all rows. Several that agree in every row are one.
pub(super) fn one_reading(rows: &[AnswerOf<'_>]) -> OneReading {
    let unfit = Reading::ALL.map(|reading| {
        let unfit =
            (0..rows.len()).filter(|&row| reading.by_rule(rows[row].0, rows[row].1).is_none());
        (reading, unfit.collect::<Vec<usize>>())
    });
    let fitting: Vec<Reading> = unfit
        .iter()
        .filter(|(_, unfit)| unfit.is_empty())
        .map(|(reading, _)| *reading)
        .collect();
    let Some((&first, others)) = fitting.split_first() else {
        let best = unfit
            .into_iter()
            .min_by_key(|(reading, unfit)| (unfit.len(), *reading));
        let (best, unfit) = best.unwrap_or((Reading::Text, Vec::new()));
        return OneReading::None { best, unfit };
    };
    for (row, (answer, options)) in rows.iter().enumerate() {
        let differs =
            |other: &&Reading| other.by_rule(answer, options) != first.by_rule(answer, options);
        if let Some(&other) = others.iter().find(differs) {
            let readings = [first, other];
            return OneReading::Ambiguous { readings, row };
        }
    }
    OneReading::Fits(first)
}

/// The choice of a yes/no question that an answer means: 0 is yes, 1 is no.
pub(super) fn yes_or_no(answer: &str) -> Option<usize> {
    match &*folded(answer) {
        "yes" | "true" => Some(0),
        "no" | "false" => Some(1),
        _ => None,
    }
}

/// The choice of a yes/no question that a digit means: 1 is yes (0), 0 is no (1).
pub(super) fn digit(answer: &str) -> Option<usize> {
    match number(answer.trim()) {
        Some(1) => Some(0),
        Some(0) => Some(1),
        _ => None,
    }
}

/// Whether a question begins with a word that only yes or no can answer.
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
    fn letters_and_numbers_name_columns_also_behind_an_empty_one() {
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
    fn each_reading_takes_its_own_forms() {
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
    fn one_reading_fits_all_rows_or_none_is_taken() {
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
        // Readings that agree in every row are no problem.
        let same = options(&["A", "B"]);
        assert_eq!(
            one_reading(&[("B", &same)]),
            OneReading::Fits(Reading::Letter)
        );
    }

    #[test]
    fn a_question_of_how_many_is_no_question_of_yes_or_no() {
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
