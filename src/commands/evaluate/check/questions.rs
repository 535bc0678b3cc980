//! Checks of the questions: [`check_questions`].

use std::collections::{BTreeMap, HashMap};

use super::findings::{Findings, Mark};
use crate::report::text::words::first_names;
use crate::types::Question;
use crate::types::questions::letter;
use crate::types::text::counted;
use crate::types::text::excerpt;
use darkqa_score::accuracies::MAX_ANSWER_SHARE;

/// Maximum number of families listed.
const MAX_FAMILIES: usize = 12;

/// Reports families, numbers of choices and chance accuracy, and warns of questions that give their answers away.
pub(super) fn check_questions(questions: &[Question], findings: &mut Findings) {
    let (mut families, mut sizes) = (BTreeMap::new(), BTreeMap::new());
    let mut chance = 0.0;
    for question in questions {
        *families.entry(question.family.name()).or_insert(0_usize) += 1;
        *sizes.entry(question.choices.len()).or_insert(0_usize) += 1;
        chance += 1.0 / question.choices.len() as f64;
    }
    let sizes: Vec<String> = sizes.iter().map(|(size, count)| format!("{count} with {size} choices")).collect();
    findings.ok(format!(
        "{}, {}; chance {:.1} %",
        counted(questions.len(), "question"),
        sizes.join(", "),
        100.0 * chance / questions.len().max(1) as f64
    ));
    let mut families: Vec<(&str, usize)> = families.into_iter().collect();
    families.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let families: Vec<String> =
        families.iter().map(|(family, count)| format!("{} {count}", excerpt(family, 30))).collect();
    findings.ok(format!("families: {}", first_names(&families, MAX_FAMILIES)));
    warn_of_common_answers(questions, findings);
    warn_of_repeats(questions, findings);
    warn_of_contained_answers(questions, findings);
}

/// Warns of an answer or letter that is true so often that a constant reply scores well.
fn warn_of_common_answers(questions: &[Question], findings: &mut Findings) {
    let letters: Vec<String> =
        questions.iter().filter_map(|question| Some(letter(question.choices.truth()?).to_string())).collect();
    let texts: Vec<String> = questions
        .iter()
        .filter_map(|question| {
            let truth = question.choices.truth()?;
            Some(question.choices.texts()[truth].to_lowercase())
        })
        .collect();
    for (what, answers) in [("letter", letters), ("answer", texts)] {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for answer in &answers {
            *counts.entry(answer).or_default() += 1;
        }
        let most = counts.iter().max_by_key(|(_, count)| **count);
        let Some((answer, count)) = most else {
            continue;
        };
        let share = *count as f64 / questions.len() as f64;
        if share >= MAX_ANSWER_SHARE {
            findings.warn(format!(
                "always the {what} {:?} scores {:.0} %; ask the model without images too (--blind-model NAME), or show the choices in other orders (--choice-order shuffle)",
                excerpt(answer, 60),
                100.0 * share
            ));
        }
    }
}

/// Warns of questions that occur twice.
fn warn_of_repeats(questions: &[Question], findings: &mut Findings) {
    let mut seen = HashMap::new();
    for question in questions {
        let content = (&question.frame, &question.text, question.choices.texts());
        if let Some(first) = seen.insert(content, &question.id) {
            let text =
                format!("the questions {:?} and {:?} are the same", excerpt(&first.0, 60), excerpt(&question.id.0, 60));
            findings.add_of_kind("questions that occur twice", Mark::Warning, text);
        }
    }
}

/// Warns of questions whose text contains the true choice and no other.
fn warn_of_contained_answers(questions: &[Question], findings: &mut Findings) {
    for question in questions {
        let text = format!(" {} ", words(&question.text));
        let texts = question.choices.texts();
        let Some(truth) = question.choices.truth().map(|truth| &texts[truth]) else {
            continue;
        };
        let is_other_contained = texts.iter().any(|choice| choice != truth && contains_words(&text, choice));
        if words(truth).len() > 2 && contains_words(&text, truth) && !is_other_contained {
            let line = format!(
                "the question {:?} holds its answer {:?}: {:?}",
                excerpt(&question.id.0, 60),
                excerpt(truth, 60),
                excerpt(&question.text, 120)
            );
            findings.add_of_kind("questions that hold their answers", Mark::Warning, line);
        }
    }
}

fn contains_words(text: &str, choice: &str) -> bool {
    text.contains(&format!(" {} ", words(choice)))
}

/// The words of a text in lower case, separated by single spaces.
fn words(text: &str) -> String {
    let lower = text.to_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect::<Vec<&str>>().join(" ")
}
