//! The data and models of an evaluation, opened and checked: [`ChoiceSetup`].

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::controls::{AddedControls, is_other_room};
use super::other_room::OtherRooms;
use super::plan_identity::plan_identity;
use super::settings::Evaluation;
use super::unnamed_scenes::unnamed_scenes;
use crate::ask::{Model, Random};
use crate::dataset::Dataset;
use crate::engine::dark_already;
use crate::engine::models::{self, ModelName, ModelUnderTest};
use crate::engine::observer::Observer;
use crate::engine::room_net::RoomNet;
use crate::error::Result;
use crate::images::conditions::{check_enhanced, conditions};
use crate::images::photographs;
use crate::images::progress::Progress;
use crate::images::questions::{QuestionBank, open_data, open_unasked, select};
use crate::images::recipe::Recipe;
use crate::images::source::{Source, first_asked, inspect_all};
use crate::runs::part::part;
use crate::types::manifest::PartPlace;
use crate::types::{Condition, Digest, FrameId, Question, QuestionId, SetLight, TreatmentSet};
use darkqa_enhance::ModelFile;
use darkqa_questions::observer::understood;
use darkqa_questions::rules::Rules;

/// All data and models of an evaluation, opened and checked. Nothing is asked or written yet.
pub(super) struct ChoiceSetup<'a> {
    pub(super) config: &'a Evaluation,
    pub(super) dataset: Arc<Dataset>,
    pub(super) questions: Vec<Question>,
    /// The questions of the control `observer:other-room` that are asked with an image of this run or shard.
    pub(super) with_other_rooms: Vec<Question>,
    pub(super) other_rooms: OtherRooms,
    pub(super) sources: Vec<Source>,
    /// Place of the sources among those of the whole run; `None` if this is the whole run.
    pub(super) part: Option<PartPlace>,
    /// The index of each frame in `sources`.
    pub(super) places: HashMap<FrameId, usize>,
    /// The place of each question among all that are selected, for models that are asked the first ones alone.
    pub(super) question_places: HashMap<QuestionId, usize>,
    /// The index of each question among all questions of the data.
    pub(super) file_places: HashMap<QuestionId, usize>,
    /// The digest of the file, or of all files, of each frame that a question is about; empty if no image is read.
    pub(super) digests: HashMap<FrameId, Digest>,
    pub(super) models: Vec<ModelUnderTest>,
    pub(super) conditions: Vec<Condition>,
    pub(super) recipe: Recipe,
    /// The digest of the questions that are asked about every image; `None` if questions have answers.
    pub(super) bank: Option<Digest>,
    /// Mean linear luminance of a sample of the frames and the size of the sample, of a set in the dark; `None` for others.
    pub(super) brightness: Option<(f64, usize)>,
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
        let (dataset, all) = asked_data(config, progress)?;
        let dataset = Arc::new(dataset);
        let file_places = file_places(config, &dataset, &all);
        let other_rooms = OtherRooms::new(&all, |frame| dataset.scene(frame));
        let controls = AddedControls::new(config, other_rooms.is_some())?;
        let (questions, part) = part(
            all.clone(),
            job.shard,
            |question| question.frame.0.clone(),
            |question| dataset.scene(&question.frame),
            |frame| config.plan.as_ref().map_or(1, |plan| plan.cost(frame)),
        )?;
        let models = open_models(config, &controls, &dataset, &questions)?;
        let mut sources = if shows_images {
            inspect_all(&dataset, &questions, progress)?
        } else {
            first_asked(&questions)
                .into_iter()
                .map(|question| Source::unseen(question.frame.clone()))
                .collect()
        };
        if let Some(plan) = &config.plan {
            plan.check_sources(&sources)?;
        }
        if !job.light.matches.is_empty() {
            photographs::measure(&*dataset, &mut sources)?;
        }
        photographs::check_matches(&sources, &job.light.matches)?;
        photographs::tell(&*dataset, &sources, progress);
        dark_already::tell(job, progress);
        if !job.enhancers.is_empty()
            && job.enhancers.on().and(TreatmentSet::DARK).is_none()
            && !photographs::names(&sources).is_empty()
        {
            let line = "the photographs in the dark are not enhanced; --llie-on noise,dark enhances them too";
            progress.say(line);
        }
        let recipe = Recipe::new(&job.light.kinds, job.format, job.max_side, &files);
        let recipe = if shows_images {
            recipe.with_elsewhere(&job.enhancers.enhanced)?
        } else {
            recipe
        };
        let photographed = photographs::names(&sources);
        let on = job.enhancers.on();
        let conditions = conditions(&job.light, &photographed, on, &recipe.enhancer_names());
        let brightness = (job.set_light == SetLight::Dark)
            .then(|| dark_already::brightness(&*dataset, &sources))
            .flatten();
        let names = sources.iter().map(|source| source.name.clone());
        let mut setup = Self {
            config,
            places: names.zip(0..).collect(),
            question_places: all
                .iter()
                .map(|question| question.id.clone())
                .zip(0..)
                .collect(),
            file_places,
            digests: digests(&sources),
            sources,
            part,
            models,
            bank: config.bank.as_ref().map(QuestionBank::digest).transpose()?,
            conditions,
            brightness,
            recipe,
            questions,
            with_other_rooms: Vec::new(),
            other_rooms: other_rooms.unwrap_or_default(),
            dataset,
        };
        if shows_images && setup.models.iter().any(is_other_room) {
            setup.add_other_rooms(all)?;
        }
        if shows_images {
            check_enhanced(&setup.conditions, &job.enhancers)?;
        }
        setup.recipe.check(&setup.sources, &setup.conditions)?;
        controls.print(progress);
        print_training(config, progress);
        Ok((setup, files))
    }

    /// Prints the inferred mapping in a ready-made set.
    pub(super) fn say_reading(&self, progress: &Progress) {
        for line in self.dataset.reading_to_say() {
            progress.note(line);
        }
        if let Some(warning) = unnamed_scenes(&self.dataset, &self.questions) {
            tracing::warn!("{warning}");
        }
    }

    /// Adds the questions that are asked with the image of another frame, if that image is of this run or shard.
    fn add_other_rooms(&mut self, mut all: Vec<Question>) -> Result<()> {
        all.retain(|question| {
            let shown = self.other_rooms.shown_for(&question.frame);
            shown.is_some_and(|shown| self.places.contains_key(shown))
        });
        for question in &all {
            if self.digests.contains_key(&question.frame) {
                continue;
            }
            let planned = self.config.plan.as_ref();
            if let Some(digest) = planned.and_then(|plan| plan.digest(&question.frame)) {
                self.digests.insert(question.frame.clone(), digest);
            } else {
                let source = Source::from_questions(&self.dataset, &question.frame)?;
                let digest = source.digest();
                self.digests
                    .extend(digest.map(|digest| (source.name, digest)));
            }
        }
        self.with_other_rooms = all;
        Ok(())
    }
}

/// Warns of questions that `room-net` guesses because the rules did not make them.
fn warn_of_guesses(questions: &[Question], rules: &Rules) {
    let unknown = questions
        .iter()
        .filter(|question| !understood(question, rules))
        .count();
    if unknown > 0 {
        tracing::warn!(
            "room-net guesses {unknown} of {} questions, because no rule made them",
            questions.len()
        );
    }
}

/// Prints the training data of `room-net`, if it is asked, and of the enhancer `lift`.
fn print_training(config: &Evaluation, progress: &Progress) {
    let job = &config.job;
    if !job.ask.shows_images_to(&ModelName::RoomNet) {
        return;
    }
    let lift = if job
        .enhancers
        .llie
        .iter()
        .any(|word| word == Path::new("lift"))
    {
        "; lift was trained on such rooms in the dark"
    } else {
        ""
    };
    progress.say(&format!(
        "room-net is a small network trained on well-lit drawn rooms: a demonstration, no vision-language model{lift}"
    ));
}

/// The data, and the questions about them that are asked. Those of a plan are taken from there, so that no frame is measured.
fn asked_data(config: &Evaluation, progress: &Progress) -> Result<(Dataset, Vec<Question>)> {
    let (place, set, selection) = (&config.place, &config.set, &config.selection);
    let data = (place, &config.scene, set);
    let dataset = match (&config.bank, &config.plan) {
        (Some(bank), _) => bank.data(place, set, config.rule, progress)?,
        (None, Some(_)) => open_unasked(data, selection, config.rule)?,
        (None, None) => open_data(data, selection, &config.rules, config.rule, progress)?,
    };
    let Some(plan) = &config.plan else {
        let questions = select(dataset.questions().to_vec(), selection)?;
        return Ok((dataset, questions));
    };
    plan.check_identity(&plan_identity(config, &dataset)?)?;
    let own = match dataset.questions() {
        [] => Vec::new(),
        own => select(own.to_vec(), selection)?,
    };
    let questions = plan.questions(&dataset, &own)?;
    Ok((dataset, questions))
}

/// The index of each question that is asked among all questions of the data.
fn file_places(
    config: &Evaluation,
    dataset: &Dataset,
    asked: &[Question],
) -> HashMap<QuestionId, usize> {
    if let Some(plan) = &config.plan {
        let ids = asked.iter().map(|question| question.id.clone());
        ids.zip(plan.question_places()).collect()
    } else {
        let ids = dataset.questions().iter().map(|question| &question.id);
        ids.cloned().zip(0..).collect()
    }
}

/// The digest of the file of each source, or of all its files.
fn digests(sources: &[Source]) -> HashMap<FrameId, Digest> {
    sources
        .iter()
        .filter_map(|source| Some((source.name.clone(), source.digest()?)))
        .collect()
}

/// The models, opened; nothing is sent.
fn open_models(
    config: &Evaluation,
    controls: &AddedControls,
    dataset: &Arc<Dataset>,
    questions: &[Question],
) -> Result<Vec<ModelUnderTest>> {
    let ask = &config.job.ask;
    let prior = Random {
        seed: config.job.light.kinds.sensor.seed,
    };
    let mut models = ask.models.iter();
    let observer = models.any(|model| matches!(model.id, ModelName::Observer(_)));
    let open = || {
        let rules = config.rules.clone();
        Observer::open(dataset, &config.place, questions, rules)
    };
    let observer = observer.then(open).transpose()?;
    let runtime = config.job.loading.runtime.search();
    models::open_all(ask, &controls.names, |name| {
        Ok(match (name, &observer) {
            (ModelName::Observer(control), Some(observer)) => {
                Model::Local(observer.model(*control, prior))
            }
            (ModelName::RoomNet, _) => {
                warn_of_guesses(questions, &config.rules);
                let net = RoomNet::new(runtime.clone(), config.rules.clone())?;
                Model::Local(net.model(prior))
            }
            _ => Model::Random(prior),
        })
    })
}
