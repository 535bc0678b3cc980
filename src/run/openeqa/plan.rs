//! What is to be answered, and what of it is left: [`Plan`].

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use super::episode::{Episode, Reel};
use super::item::Open;
use super::stage::Stage;
use crate::ask::openeqa::{blind, vision};
use crate::dataset::openeqa::OpenQuestion;
use crate::error::Result;
use crate::run::askers::Asker;
use crate::run::trial::{Prompt, Trial};
use crate::types::{Condition, Digest, TrialKey, View};

/// A question to a model in a condition.
#[derive(Debug, Clone)]
pub(super) struct Due {
    pub(super) key: TrialKey,
    /// The question's place in the file.
    pub(super) question: usize,
    /// The model's place among those of the run.
    pub(super) asker: usize,
    /// `None` where nothing is shown.
    pub(super) condition: Option<Condition>,
}

/// The questions about a walk in one condition that have no answer yet.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) condition: Option<Condition>,
    pub(super) trials: Vec<Trial<Open>>,
}

/// What is left to ask about a walk.
#[derive(Debug)]
pub(super) struct WalkPlan {
    /// The walk's place among those of the run.
    pub(super) episode: usize,
    pub(super) shots: Vec<Shot>,
}

/// All answers of a run, and those that are left.
#[derive(Debug)]
pub(super) struct Plan {
    /// Every answer, given or not, walk by walk.
    pub(super) due: Vec<Due>,
    pub(super) walks: Vec<WalkPlan>,
}

impl Plan {
    /// Lays out all answers, and leaves out those that are there or on their way.
    pub(super) fn new(stage: &Stage, there: &HashSet<TrialKey>) -> Result<Self> {
        let mut by_episode = BTreeMap::<&str, Vec<usize>>::new();
        for (index, question) in stage.questions.iter().enumerate() {
            by_episode.entry(&question.episode).or_default().push(index);
        }
        let mut plan = Self {
            due: Vec::new(),
            walks: Vec::new(),
        };
        for (index, episode) in stage.episodes.iter().enumerate() {
            let questions = by_episode.remove(&*episode.name).unwrap_or_default();
            let conditions = std::iter::once(None).chain(stage.conditions.iter().map(Some));
            let shots =
                conditions.map(|condition| plan.shot(stage, episode, condition, &questions, there));
            let mut shots: Vec<Shot> = shots.collect::<Result<_>>()?;
            shots.retain(|shot| !shot.trials.is_empty());
            if !shots.is_empty() {
                plan.walks.push(WalkPlan {
                    episode: index,
                    shots,
                });
            }
        }
        Ok(plan)
    }

    fn shot(
        &mut self,
        stage: &Stage,
        episode: &Episode,
        condition: Option<&Condition>,
        questions: &[usize],
        there: &HashSet<TrialKey>,
    ) -> Result<Shot> {
        let view = if condition.is_some() {
            View::Image
        } else {
            View::Blind
        };
        let askers = stage.askers.iter().enumerate();
        let askers: Vec<(usize, &Asker)> = askers.filter(|(_, asker)| asker.view == view).collect();
        let mut shot = Shot {
            condition: condition.cloned(),
            trials: Vec::new(),
        };
        if askers.is_empty() {
            return Ok(shot);
        }
        let shown = condition.map(|condition| shown(stage, episode, condition));
        let shown = shown.transpose()?;
        for &question in questions {
            let prompt = prompt(&stage.questions[question], view);
            for &(index, asker) in &askers {
                let key = key(asker, &stage.questions[question], &prompt, condition, shown);
                self.due.push(Due {
                    key,
                    question,
                    asker: index,
                    condition: condition.cloned(),
                });
                if !there.contains(&key) {
                    shot.trials.push(Trial {
                        key,
                        asker: index,
                        prompt: prompt.clone(),
                        item: Open(Arc::clone(&stage.questions[question])),
                    });
                }
            }
        }
        Ok(shot)
    }

    /// How many answers are left.
    pub(super) fn left(&self) -> usize {
        let shots = self.walks.iter().flat_map(|walk| &walk.shots);
        shots.map(|shot| shot.trials.len()).sum()
    }

    /// The conditions in which something is left to ask about a walk.
    pub(super) fn conditions(walk: &WalkPlan) -> BTreeSet<&Condition> {
        let conditions = walk.shots.iter();
        conditions
            .filter_map(|shot| shot.condition.as_ref())
            .collect()
    }
}

/// The words of a question for a model that sees the walk, or for one that does not.
fn prompt(question: &OpenQuestion, view: View) -> Prompt {
    match view {
        View::Blind => Prompt::of(blind(&question.text).into()),
        View::Image => {
            let (before, behind) = vision(&question.text);
            Prompt {
                before: before.into(),
                behind: Some(behind.into()),
            }
        }
    }
}

/// The digest of everything that decides the images of a walk in a condition.
fn shown(stage: &Stage, episode: &Episode, condition: &Condition) -> Result<Digest> {
    let Ok(Reel { stills, order }) = &episode.reel else {
        return Ok(Digest::of(b"no frames"));
    };
    let walk = &stage.walk;
    let made = format!("{:?} {} {}", walk.side, walk.darkened, walk.camera);
    let frames: Vec<Digest> = stills
        .iter()
        .map(|still| stage.recipe.digest(&still.id, &still.digest, condition))
        .collect::<Result<_>>()?;
    let order = order.iter().map(|place| &frames[*place].as_bytes()[..]);
    Ok(Digest::of_parts(
        std::iter::once(made.as_bytes()).chain(order),
    ))
}

fn key(
    asker: &Asker,
    question: &OpenQuestion,
    prompt: &Prompt,
    condition: Option<&Condition>,
    shown: Option<Digest>,
) -> TrialKey {
    // Built-in models answer by the names of question and condition, so these decide the reply too.
    let condition = condition.map_or("blind".to_owned(), ToString::to_string);
    let shown = shown.map_or("no image".to_owned(), |digest| digest.to_string());
    let [before, behind] = prompt.parts();
    let parts = [
        "darkqa.openeqa/1",
        asker.model.name(),
        &question.id.0,
        before,
        behind,
        &asker.digest,
        &condition,
        &shown,
    ];
    Digest::of_parts(parts.map(str::as_bytes)).into()
}
