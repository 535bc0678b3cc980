//! The questions of a data set that are asked: [`select`]; and the rules that make them: [`rules`].

use std::collections::BTreeSet;
use std::path::Path;

use super::progress::Progress;
use super::questions_by_rule::by_rule;
use crate::dataset::{DataPlace, Dataset, ReadingRule, SelectionArgs, SetArgs};
use crate::error::{Error, Result};
use crate::files::reading;
use crate::questions::rules::Rules;
use crate::types::{Family, Question};

/// The rulebook in a file; without one, the one built in.
///
/// # Errors
/// If the file cannot be read, or is not a rulebook.
pub(crate) fn rules(path: Option<&Path>) -> Result<Rules> {
    let Some(path) = path else {
        return Rules::built_in();
    };
    Rules::parse(&reading::text(path)?).map_err(|e| e.at(path.display().to_string()))
}

/// The opened data. If they have no questions, these are made by rule.
pub(crate) fn open_data(
    place: &DataPlace,
    set: &SetArgs,
    selection: &SelectionArgs,
    rules: &Rules,
    rule: ReadingRule,
    progress: &Progress,
) -> Result<Dataset> {
    let dataset = Dataset::open(place, selection.questions.as_deref(), set)?.with_rule(rule);
    if !dataset.questions().is_empty() {
        return Ok(dataset);
    }
    let questions = by_rule(&dataset, rules, progress)?;
    Ok(dataset.with_questions(questions))
}

/// The questions that are asked: the first `--limit` ones of the chosen families.
pub(crate) fn select(dataset: &Dataset, selection: &SelectionArgs) -> Result<Vec<Question>> {
    let wanted = &selection.families;
    let all = dataset.questions().iter();
    let present: BTreeSet<&Family> = all.clone().map(|question| &question.family).collect();
    if let Some(missing) = wanted.iter().find(|family| !present.contains(family)) {
        let present: Vec<&str> = present.into_iter().map(Family::name).collect();
        let problem = format!(
            "no question of the family {missing}; there are: {}",
            present.join(", ")
        );
        return Err(Error::usage("--families", problem));
    }
    let chosen = all.filter(|question| wanted.is_empty() || wanted.contains(&question.family));
    let limit = selection.limit.map_or(usize::MAX, usize::from);
    Ok(chosen.take(limit).cloned().collect())
}
