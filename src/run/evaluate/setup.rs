//! The data and models of an evaluation, opened and checked: [`ChoiceSetup`].

use std::collections::HashMap;
use std::sync::Arc;

use super::settings::Evaluation;
use crate::ask::{Model, Random};
use crate::dataset::Dataset;
use crate::enhance::ModelFile;
use crate::error::Result;
use crate::job::conditions::conditions;
use crate::job::models::{self, ModelName, ModelUnderTest};
use crate::job::observer;
use crate::job::progress::Progress;
use crate::job::questions::{open_data, select};
use crate::job::recipe::Recipe;
use crate::job::shard::part;
use crate::job::source::{Source, first_asked, inspect_all};
use crate::types::{Condition, FrameId, Question};

/// All data and models of an evaluation, opened and checked. Nothing is asked or written yet.
pub(super) struct ChoiceSetup<'a> {
    pub(super) config: &'a Evaluation,
    pub(super) dataset: Arc<Dataset>,
    pub(super) questions: Vec<Question>,
    pub(super) sources: Vec<Source>,
    /// The index of each frame in `sources`.
    pub(super) places: HashMap<FrameId, usize>,
    pub(super) models: Vec<ModelUnderTest>,
    pub(super) conditions: Vec<Condition>,
    pub(super) recipe: Recipe,
}

impl<'a> ChoiceSetup<'a> {
    /// Opens the data and the models. The files of the enhancers are read but not yet loaded.
    pub(super) fn open(
        config: &'a Evaluation,
        progress: &Progress,
    ) -> Result<(Self, Vec<ModelFile>)> {
        let job = &config.job;
        // If every model is blind, no image is read and no enhancer is opened.
        let shows_images = job.shows_images();
        let files = if shows_images {
            job.enhancers()?
        } else {
            Vec::new()
        };
        let dataset = &config.data.data;
        let dataset = open_data(dataset, &config.selection, config.limit, progress)?;
        let dataset = Arc::new(dataset);
        let questions = select(&dataset, &config.selection)?;
        let questions = part(questions, job.shard, |question| question.frame.0.clone())?;
        let models = open_models(config, &dataset, &questions)?;
        let sources = if shows_images {
            inspect_all(&dataset, &questions, progress)?
        } else {
            let frames = first_asked(&questions).into_iter();
            frames
                .map(|question| Source::unseen(question.frame.clone()))
                .collect()
        };
        let recipe = Recipe::new(&job.light.sensor, job.format, job.max_side, &files);
        let names = sources.iter().map(|source| source.name.clone());
        let setup = Self {
            config,
            places: names.zip(0..).collect(),
            sources,
            models,
            conditions: conditions(&job.light, job.enhancers.llie_on, &recipe.enhancers),
            recipe,
            questions,
            dataset,
        };
        Ok((setup, files))
    }
}

/// The models, opened; nothing is sent.
fn open_models(
    config: &Evaluation,
    dataset: &Arc<Dataset>,
    questions: &[Question],
) -> Result<Vec<ModelUnderTest>> {
    let prior = Random {
        seed: config.job.light.sensor.seed,
    };
    models::open_all(&config.job.ask, |name| match name {
        ModelName::Observer => {
            let place = &config.data.data;
            observer::open(dataset, place, questions, prior).map(Model::Local)
        }
        _ => Ok(Model::Random(prior)),
    })
}
