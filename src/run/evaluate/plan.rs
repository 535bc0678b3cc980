//! The trials of an evaluation: [`trials`].

use std::sync::Arc;

use super::choice_order::arrange;
use super::setup::ChoiceSetup;
use crate::error::Result;
use crate::job::models::{ModelUnderTest, asked_in};
use crate::job::plan::{SourcePlan, TrialGroup};
use crate::job::trial::{KeyFacts, Prompt, Trial};
use crate::types::{Condition, Digest, Question, View};

/// A question with its choices in one order.
#[derive(Debug, Clone)]
pub(crate) struct ChoiceItem {
    pub(super) question: Arc<Question>,
    /// The number of times that this order was asked before.
    pub(super) repeat: u32,
    /// The number of times that the question was asked before, in any order of its choices.
    pub(super) turn: u32,
}

/// One order of a question, with the prompts for models that see the image and for blind models.
struct QuestionPrompts {
    item: ChoiceItem,
    image: Prompt,
    blind: Prompt,
}

/// All trials, grouped by frame: first the trials without an image, then those of each condition.
pub(super) fn trials(setup: &ChoiceSetup<'_>) -> Result<Vec<SourcePlan<ChoiceItem>>> {
    let mut by_source: Vec<Vec<&Question>> = vec![Vec::new(); setup.sources.len()];
    for question in &setup.questions {
        by_source[setup.places[&question.frame]].push(question);
    }
    let plan = by_source
        .into_iter()
        .enumerate()
        .map(|(source, questions)| {
            Ok(SourcePlan {
                source,
                groups: groups(setup, source, &questions)?,
            })
        });
    plan.collect()
}

fn groups(
    setup: &ChoiceSetup<'_>,
    source: usize,
    questions: &[&Question],
) -> Result<Vec<TrialGroup<ChoiceItem>>> {
    let mut shown = Vec::new();
    for question in questions {
        for arranged in arrange(question, setup.config.order, setup.recipe.seed)? {
            let prompt = |view| {
                let words = setup.config.prompts.render(view, &arranged.question)?;
                Ok(Prompt::of(words.into()))
            };
            shown.push(QuestionPrompts {
                image: prompt(View::Image)?,
                blind: prompt(View::Blind)?,
                item: ChoiceItem {
                    question: Arc::new(arranged.question),
                    repeat: arranged.repeat,
                    turn: arranged.turn,
                },
            });
        }
    }
    let all = std::iter::once(None).chain(setup.conditions.iter().map(Some));
    let groups = all.filter_map(|condition| group(setup, source, condition, &shown).transpose());
    groups.collect()
}

/// The trials in a condition; `None` if no model is asked in it.
fn group(
    setup: &ChoiceSetup<'_>,
    source: usize,
    condition: Option<&Condition>,
    shown: &[QuestionPrompts],
) -> Result<Option<TrialGroup<ChoiceItem>>> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let models = asked_in(&setup.models, condition);
    if models.is_empty() {
        return Ok(None);
    }
    let image = condition.map(|condition| {
        let source = &setup.sources[source];
        setup.recipe.stimulus(source, condition)
    });
    let image = image.transpose()?;
    let mut trials = Vec::with_capacity(shown.len() * models.len());
    for shown in shown {
        let prompt = match view {
            View::Image => &shown.image,
            View::Blind => &shown.blind,
        };
        for &(index, model) in &models {
            trials.push(Trial {
                key: facts(shown, prompt, model, condition, image).key()?,
                model: index,
                prompt: prompt.clone(),
                item: shown.item.clone(),
            });
        }
    }
    Ok(Some(TrialGroup {
        condition: condition.cloned(),
        trials,
    }))
}

fn facts<'a>(
    shown: &'a QuestionPrompts,
    prompt: &'a Prompt,
    model: &'a ModelUnderTest,
    condition: Option<&'a Condition>,
    image: Option<Digest>,
) -> KeyFacts<'a> {
    let question = &*shown.item.question;
    let facts = KeyFacts::new(model, &question.id, prompt, condition, image);
    facts.with_choices(question.choices.texts(), shown.item.repeat)
}
