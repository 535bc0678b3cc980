//! The trials of the models: [`plan_answers`].

use std::collections::BTreeMap;
use std::sync::Arc;

use super::record::OpenItem;
use super::setup::OpenSetup;
use crate::ask::ImagePlaces;
use crate::ask::prompts::openeqa::{blind, vision};
use crate::data::openeqa::OpenQuestion;
use crate::engine::images::trials::{Prompt, SourcePlan, Trial, TrialGroup};
use crate::engine::key_facts::KeyFacts;
use crate::engine::models::asked_in;
use crate::error::Result;
use crate::types::{Condition, Digest, View};

/// The trials of all answers, grouped by walk: first those without images, then those of each condition.
pub(super) fn plan_answers(setup: &OpenSetup<'_>) -> Result<Vec<SourcePlan<OpenItem>>> {
    let mut by_walk = BTreeMap::<&str, Vec<&Arc<OpenQuestion>>>::new();
    for question in &setup.questions {
        by_walk.entry(&question.episode).or_default().push(question);
    }
    setup
        .sources
        .iter()
        .enumerate()
        .map(|(source, walk)| {
            let questions = by_walk.remove(&*walk.name.0).unwrap_or_default();
            let groups = std::iter::once(None)
                .chain(setup.conditions.iter().map(Some))
                .filter_map(|condition| group(setup, source, condition, &questions).transpose());
            Ok(SourcePlan { source, groups: groups.collect::<Result<_>>()? })
        })
        .collect()
}

/// The trials in a condition; `None` if no model is asked in it.
fn group(
    setup: &OpenSetup<'_>,
    source: usize,
    condition: Option<&Condition>,
    questions: &[&Arc<OpenQuestion>],
) -> Result<Option<TrialGroup<OpenItem>>> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let models = asked_in(&setup.models, condition);
    if models.is_empty() {
        return Ok(None);
    }
    let walk = &setup.sources[source];
    let images = condition.map(|condition| setup.recipe.stimulus_digest(walk, condition));
    let images: Option<Digest> = images.transpose()?;
    let mut trials = Vec::new();
    for question in questions {
        let prompt = prompt(question, view);
        let place = setup.question_places[&question.id];
        for &(index, model) in models.iter().filter(|(_, model)| model.is_asked(place)) {
            trials.push(Trial {
                key: KeyFacts::new(model, &question.id, &prompt, condition, images).key()?,
                model: index,
                prompt: prompt.clone(),
                item: OpenItem::Answer(Arc::clone(question)),
            });
        }
    }
    Ok(Some(TrialGroup { condition: condition.cloned(), trials }))
}

/// The prompt of a question, for a model with images or a blind one.
fn prompt(question: &OpenQuestion, view: View) -> Prompt {
    match view {
        View::Blind => Prompt::from_text(blind(&question.text).into()),
        View::Image => {
            let (before, behind) = vision(&question.text);
            Prompt { before: before.into(), after: Some(behind.into()), places: ImagePlaces::Together }
        }
    }
}
