//! What is left to ask: [`Plan`].

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use super::arrangement::arrange;
use super::askers::Asker;
use super::gallery::Gallery;
use super::recipe::Recipe;
use super::trial::{Prompt, Trial};
use crate::ask::Prompts;
use crate::config::{Config, Light, Showing};
use crate::enhance::ModelFile;
use crate::error::{Error, Result};
use crate::types::{
    Condition, Digest, EnhancerName, FrameId, KindSet, Outcome, Question, Record, TrialKey, View,
};

/// What a plan is made of.
#[derive(Debug)]
pub(super) struct Inputs<'a> {
    pub(super) questions: &'a [Question],
    pub(super) pictures: &'a Gallery,
    pub(super) askers: &'a [Asker],
    pub(super) prompts: Prompts,
    pub(super) conditions: Vec<Condition>,
    pub(super) showing: Showing,
    pub(super) recipe: Recipe,
}

impl<'a> Inputs<'a> {
    pub(super) fn new(
        config: &Config,
        questions: &'a [Question],
        pictures: &'a Gallery,
        askers: &'a [Asker],
        files: &[ModelFile],
    ) -> Result<Self> {
        let recipe = Recipe::new(&config.light.sensor, &config.images, files);
        let prompts = config
            .ask
            .prompts
            .as_deref()
            .map_or_else(Prompts::built_in, Prompts::load)?;
        Ok(Self {
            questions,
            pictures,
            askers,
            prompts,
            conditions: conditions(&config.light, config.enhancement.on, &recipe.enhancers),
            showing: config.showing,
            recipe,
        })
    }
}

/// Every condition in which a frame is shown: raw first, each enhancer after, level by level, so that a frame is
/// developed once for all that use it.
pub(super) fn conditions(
    light: &Light,
    on: KindSet,
    enhancers: &[(EnhancerName, Digest)],
) -> Vec<Condition> {
    let mut all = Vec::new();
    for degradation in light.degradations() {
        let enhanced = degradation.as_ref().filter(|how| on.includes(how.kind()));
        let enhanced = enhanced.map(|how| {
            enhancers.iter().map(|(name, _)| Condition {
                degradation: Some(how.clone()),
                enhancer: Some(name.clone()),
            })
        });
        let enhanced: Vec<Condition> = enhanced.into_iter().flatten().collect();
        all.push(Condition::raw(degradation));
        all.extend(enhanced);
    }
    all
}

/// A question with choices, in one order of them.
#[derive(Debug, Clone)]
pub(super) struct Choice {
    pub(super) question: Arc<Question>,
    /// How many times the same was asked before.
    pub(super) repeat: u32,
    /// How many times the question was put before, in whatever order of its choices.
    pub(super) turn: u32,
}

/// All trials that share one image, or that have none.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) condition: Option<Condition>,
    pub(super) trials: Vec<Trial<Choice>>,
}

/// All shots of one frame.
#[derive(Debug)]
pub(super) struct FramePlan {
    pub(super) frame: FrameId,
    pub(super) shots: Vec<Shot>,
}

/// The trials of a run, and those of them that have no reply yet.
#[derive(Debug)]
pub(super) struct Plan {
    /// Every trial, answered or not, in the order of the frames.
    pub(super) keys: Vec<TrialKey>,
    /// What is left to ask, in the same order.
    pub(super) frames: Vec<FramePlan>,
}

impl Plan {
    /// Lays out all trials of the inputs and leaves out those with a kept reply; failed ones are asked again.
    pub(super) fn new(inputs: &Inputs<'_>, kept: &[Record]) -> Result<Self> {
        let answered: HashSet<TrialKey> = kept
            .iter()
            .filter(|record| record.detail.outcome != Outcome::Failed)
            .map(|record| record.key)
            .collect();
        let mut by_frame: Vec<(&FrameId, Vec<&Question>)> = Vec::new();
        let mut places = BTreeMap::<&FrameId, usize>::new();
        for question in inputs.questions {
            let place = *places.entry(&question.frame).or_insert_with(|| {
                by_frame.push((&question.frame, Vec::new()));
                by_frame.len() - 1
            });
            by_frame[place].1.push(question);
        }
        let mut plan = Self {
            keys: Vec::new(),
            frames: Vec::new(),
        };
        for (frame, questions) in by_frame {
            let shots = plan.shots(inputs, frame, &questions, &answered)?;
            if !shots.is_empty() {
                plan.frames.push(FramePlan {
                    frame: frame.clone(),
                    shots,
                });
            }
        }
        Ok(plan)
    }

    fn shots(
        &mut self,
        inputs: &Inputs<'_>,
        frame: &FrameId,
        questions: &[&Question],
        answered: &HashSet<TrialKey>,
    ) -> Result<Vec<Shot>> {
        let mut asked = Vec::new();
        for question in questions {
            for arranged in arrange(question, inputs.showing)? {
                let prompt = |view| inputs.prompts.render(view, &arranged.question);
                asked.push(Asked {
                    image: prompt(View::Image)?.into(),
                    blind: prompt(View::Blind)?.into(),
                    question: Arc::new(arranged.question),
                    repeat: arranged.repeat,
                    turn: arranged.turn,
                });
            }
        }
        let mut shots = Vec::new();
        for condition in std::iter::once(None).chain(inputs.conditions.iter().map(Some)) {
            let view = if condition.is_some() {
                View::Image
            } else {
                View::Blind
            };
            let askers = inputs.askers.iter().enumerate();
            let askers: Vec<(usize, &Asker)> = askers.filter(|(_, a)| a.view == view).collect();
            if askers.is_empty() {
                continue;
            }
            let shown = Shown::new(inputs, frame, condition)?;
            let mut trials = Vec::new();
            for asked in &asked {
                let prompt = if view == View::Image {
                    &asked.image
                } else {
                    &asked.blind
                };
                for &(index, asker) in &askers {
                    let key = shown.key(asked, prompt, asker);
                    self.keys.push(key);
                    if !answered.contains(&key) {
                        trials.push(Trial {
                            key,
                            asker: index,
                            prompt: Prompt::of(Arc::clone(prompt)),
                            item: Choice {
                                question: Arc::clone(&asked.question),
                                repeat: asked.repeat,
                                turn: asked.turn,
                            },
                        });
                    }
                }
            }
            if !trials.is_empty() {
                shots.push(Shot {
                    condition: condition.cloned(),
                    trials,
                });
            }
        }
        Ok(shots)
    }

    /// Asks none of these trials; how many there were.
    pub(super) fn leave_out(&mut self, keys: &BTreeSet<TrialKey>) -> usize {
        let before = self.left();
        for frame in &mut self.frames {
            for shot in &mut frame.shots {
                shot.trials.retain(|trial| !keys.contains(&trial.key));
            }
            frame.shots.retain(|shot| !shot.trials.is_empty());
        }
        self.frames.retain(|frame| !frame.shots.is_empty());
        before - self.left()
    }

    /// How many trials there are, answered or not.
    pub(super) fn trials(&self) -> usize {
        self.keys.len()
    }

    /// How many of them have no reply yet.
    pub(super) fn left(&self) -> usize {
        self.frames
            .iter()
            .flat_map(|frame| &frame.shots)
            .map(|shot| shot.trials.len())
            .sum()
    }
}

/// A question as it is shown once, with its words for models that see the image and for those that do not.
struct Asked {
    question: Arc<Question>,
    image: Arc<str>,
    blind: Arc<str>,
    repeat: u32,
    turn: u32,
}

/// What is shown in one shot, as it enters the keys of its trials.
struct Shown {
    condition: String,
    image: String,
}

impl Shown {
    fn new(inputs: &Inputs<'_>, frame: &FrameId, condition: Option<&Condition>) -> Result<Self> {
        let Some(condition) = condition else {
            return Ok(Self {
                condition: "blind".to_owned(),
                image: "no image".to_owned(),
            });
        };
        let picture = inputs.pictures.get(frame);
        let picture = picture.ok_or_else(|| Error::data(frame, "the frame was not read"))?;
        Ok(Self {
            condition: condition.to_string(),
            image: inputs
                .recipe
                .digest(frame, &picture.digest, condition)?
                .to_string(),
        })
    }

    /// The key of one trial: see [`TrialKey`].
    fn key(&self, put: &Asked, prompt: &str, asker: &Asker) -> TrialKey {
        let question = &*put.question;
        let repeat = (put.repeat > 0).then(|| format!("repeat {}", put.repeat));
        // Built-in models answer by the names of question and condition, so these decide the reply too.
        let head = [
            "darkqa.trial/1",
            asker.model.name(),
            question.id.0.as_str(),
            prompt,
            &asker.digest,
            &self.condition,
            &self.image,
        ];
        let choices = question.choices.texts().iter().map(String::as_str);
        let parts = head.into_iter().chain(choices).chain(repeat.as_deref());
        Digest::of_parts(parts.map(str::as_bytes)).into()
    }
}
