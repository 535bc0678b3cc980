//! The questions of a data set that are asked: [`select`].

use std::collections::BTreeSet;

use super::progress::Progress;
use super::questions_by_rule::by_rule;
use crate::config::Data;
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::types::{Family, Question};

/// Opens the data; where they come without questions, they are made by rule.
pub(crate) fn open_data(config: &Data, progress: &Progress) -> Result<Dataset> {
    let dataset = Dataset::open(&config.place, config.questions.as_deref())?
        .with_most_pixels(config.most_pixels);
    if !dataset.questions().is_empty() {
        return Ok(dataset);
    }
    let questions = by_rule(&dataset, progress)?;
    Ok(dataset.with_questions(questions))
}

/// The questions that are asked: of the chosen families, the first so many.
pub(crate) fn select(dataset: &Dataset, config: &Data) -> Result<Vec<Question>> {
    let wanted = |question: &&Question| {
        config
            .families
            .as_ref()
            .is_none_or(|list| list.contains(&question.family))
    };
    let there: BTreeSet<&Family> = dataset
        .questions()
        .iter()
        .map(|question| &question.family)
        .collect();
    if let Some(missing) = config
        .families
        .iter()
        .flatten()
        .find(|family| !there.contains(family))
    {
        let there: Vec<&str> = there.into_iter().map(Family::name).collect();
        let problem = format!(
            "no question of the family {missing}; there are: {}",
            there.join(", ")
        );
        return Err(Error::usage("--families", problem));
    }
    let limit = config.limit.map_or(usize::MAX, usize::from);
    Ok(dataset
        .questions()
        .iter()
        .filter(wanted)
        .take(limit)
        .cloned()
        .collect())
}
