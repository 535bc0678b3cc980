//! The data and models of an evaluation, opened and checked: [`ChoiceSetup`].
//!
//! Controls of the observer that are added to a run without a flag: [`AddedControls`].
//!
//! The warning about frames without the scenes that their names suggest: [`unnamed_scenes`].

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::samples::{OtherRooms, Sample, Selection};
use super::settings::{Evaluation, plan_identity};
use darkqa_ask::{Model, Random};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::PartPlace;
use darkqa_base::types::{Condition, Control, Digest, Question, QuestionId, SetLight, TreatmentSet};
use darkqa_data::Dataset;
use darkqa_engine::dark_already;
use darkqa_engine::images::enhancement::evenly_spaced_indices;
use darkqa_engine::images::frames::{Source, first_question_per_frame, inspect_all, photographs};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::trials::{
    QuestionBank, check_enhanced, conditions, open_data, open_without_generating, select,
};
use darkqa_engine::models::{self, ModelName, ModelUnderTest};
use darkqa_engine::observer::{Observer, RoomNet};
use darkqa_engine::settings::JobSettings;
use darkqa_enhance::{FRAMES, ModelFile};
use darkqa_questions::observer::is_in_rulebook;
use darkqa_questions::rules::Rules;
use darkqa_runs::shard_records::shard_questions;
use darkqa_score::suggested_scenes::SuggestedScenes;

/// Data and models of an evaluation, opened and checked. Nothing has been asked or written yet.
pub(super) struct ChoiceSetup<'a> {
    pub(super) config: &'a Evaluation,
    pub(super) dataset: Arc<Dataset>,
    /// The questions in the order of their selection.
    pub(super) samples: Vec<Sample>,
    pub(super) sources: Vec<Source>,
    /// In a shard, the sources of the whole run that enhancers are tried on.
    pub(super) probe_sources: Vec<Source>,
    /// Position of the sources within the whole run; `None` if this is the whole run.
    pub(super) part: Option<PartPlace>,
    pub(super) models: Vec<ModelUnderTest>,
    pub(super) conditions: Vec<Condition>,
    pub(super) recipe: Recipe,
    /// Digest of the questions that are asked about every image; `None` if questions have answers.
    pub(super) bank: Option<Digest>,
    /// Mean linear luminance of a sample of the frames, and the sample size; `None` if the set is not dark.
    pub(super) brightness: Option<(f64, usize)>,
    /// Mean exposure value at ISO 100 of the frames, from the camera's settings in their files, and the number of frames
    /// that state them; `None` if at most half of them do.
    pub(super) exposure_value: Option<(f64, usize)>,
}

impl<'a> ChoiceSetup<'a> {
    /// Opens the data and the models. Also returns the files of the enhancers, which are read but not yet loaded.
    pub(super) fn open(config: &'a Evaluation, progress: &Progress) -> Result<(Self, Vec<ModelFile>)> {
        let job = &config.job;
        // If every model is blind, no image is read and no enhancer is opened.
        let shows_images = job.shows_images();
        let enhancer_files = if shows_images { job.enhancers()? } else { Vec::new() };
        let (dataset, selected) = selected_data(config, progress)?;
        let dataset = Arc::new(dataset);
        let file_places = file_places(config, &dataset, &selected);
        let other_rooms = OtherRooms::new(&selected, |frame| dataset.scene(frame));
        let controls = AddedControls::new(config, other_rooms.is_some())?;
        let (questions, part) = shard_questions(
            selected.clone(),
            job.shard,
            |question| question.frame.0.clone(),
            |question| dataset.scene(&question.frame),
            |frame| config.plan.as_ref().map_or(1, |plan| plan.weight(frame)),
        )?;
        let models = open_models(config, &controls, &dataset, &questions)?;
        let mut sources = if shows_images {
            inspect_all(&dataset, &questions, progress)?
        } else {
            first_question_per_frame(&questions)
                .into_iter()
                .map(|question| Source::without_frames(question.frame.clone()))
                .collect()
        };
        if let Some(plan) = &config.plan {
            plan.check_images(sources.iter().filter_map(|source| Some((&source.name, source.digest()?))))?;
        }
        if !job.light.matches.is_empty() {
            photographs::measure(&*dataset, &mut sources)?;
        }
        photographs::check_matches(&sources, &job.light.matches)?;
        photographs::print_darkness(&*dataset, &sources, progress);
        dark_already::print_note(job, progress);
        print_raw_photographs(job, &sources, progress);
        let mut recipe = Recipe::new(&job.light.kinds, job.format, job.max_side, &enhancer_files);
        if shows_images {
            recipe = recipe.with_enhanced_images(&job.enhancers.enhanced)?;
        }
        let conditions =
            conditions(&job.light, &photographs::names(&sources), job.enhancers.on(), &recipe.enhancer_names());
        let brightness =
            (job.set_light == SetLight::Dark).then(|| dark_already::brightness(&*dataset, &sources)).flatten();
        let exposure_value = mean_exposure_value(&sources);
        let probe_sources =
            if part.is_some() && !enhancer_files.is_empty() { probe_sources(&dataset, &selected) } else { Vec::new() };
        let shown = models.iter().any(is_other_room).then_some(other_rooms).flatten().filter(|_| shows_images);
        let selection = Selection { selected, file_places, other_rooms: shown };
        let setup = Self {
            config,
            probe_sources,
            samples: selection.samples(&dataset, &sources, config.plan.as_ref())?,
            sources,
            part,
            models,
            bank: config.bank.as_ref().map(QuestionBank::digest).transpose()?,
            conditions,
            brightness,
            exposure_value,
            recipe,
            dataset,
        };
        if shows_images {
            check_enhanced(&setup.conditions, &job.enhancers)?;
        }
        setup.recipe.check(&setup.sources, &setup.conditions)?;
        controls.print(progress);
        print_training(config, progress);
        Ok((setup, enhancer_files))
    }

    /// Prints the inferred column mapping of a ready-made set, and warns about unnamed scenes.
    pub(super) fn print_column_mapping(&self, progress: &Progress) {
        for line in self.dataset.printed_summary() {
            progress.note(line);
        }
        if let Some(warning) = unnamed_scenes(&self.dataset, self.own().map(|sample| &sample.question)) {
            tracing::warn!("{warning}");
        }
    }

    /// Samples about the frames of this run or shard.
    pub(super) fn own(&self) -> impl Iterator<Item = &Sample> + Clone {
        self.samples.iter().filter(|sample| sample.source.is_some())
    }
}

/// Mean exposure value of the sources and the number of them that have one; `None` if at most half do.
fn mean_exposure_value(sources: &[Source]) -> Option<(f64, usize)> {
    let known: Vec<f64> = sources.iter().filter_map(|source| source.middle()?.exposure_value).collect();
    (2 * known.len() > sources.len()).then(|| (known.iter().sum::<f64>() / known.len() as f64, known.len()))
}

/// Frames of the whole run, evenly spread, that a shard tries enhancers on. Frames that cannot be read are left out.
fn probe_sources(dataset: &Dataset, selected: &[Question]) -> Vec<Source> {
    let first = first_question_per_frame(selected);
    evenly_spaced_indices(first.len(), FRAMES)
        .into_iter()
        .filter_map(|place| Source::from_questions(dataset, &first[place].frame).ok())
        .collect()
}

/// Warns about the number of questions that `room-net` will guess, because no rule made them.
fn warn_of_guesses(questions: &[Question], rules: &Rules) {
    let unknown = questions.iter().filter(|question| !is_in_rulebook(question, rules)).count();
    if unknown > 0 {
        tracing::warn!("room-net guesses {unknown} of {} questions, because no rule made them", questions.len());
    }
}

/// Prints that photographs in the dark stay raw, if other images are enhanced.
fn print_raw_photographs(job: &JobSettings, sources: &[Source], progress: &Progress) {
    let are_enhanced = job.enhancers.on().intersection(TreatmentSet::DARK).is_some();
    if !job.enhancers.is_empty() && !are_enhanced && !photographs::names(sources).is_empty() {
        progress
            .print_on_terminal("the photographs in the dark are not enhanced; --llie-on noise,dark enhances them too");
    }
}

/// Prints the training data of `room-net`, and of the enhancer `lift` if both are used.
fn print_training(config: &Evaluation, progress: &Progress) {
    let job = &config.job;
    if !job.ask.shows_images_to(&ModelName::RoomNet) {
        return;
    }
    let lift = if job.enhancers.llie.iter().any(|word| word == Path::new("lift")) {
        "; lift was trained on such rooms in the dark"
    } else {
        ""
    };
    progress.print_on_terminal(&format!(
        "room-net is a small network trained on well-lit drawn rooms: a demonstration, no vision-language model{lift}"
    ));
}

/// Opens the data and selects the questions to ask. With a plan, the questions come from it, so that no frame is
/// measured.
fn selected_data(config: &Evaluation, progress: &Progress) -> Result<(Dataset, Vec<Question>)> {
    let (place, set, selection) = (&config.place, &config.set, &config.selection);
    let scene = &config.scene;
    let dataset = match (&config.bank, &config.plan) {
        (Some(bank), _) => bank.open_images(place, set, config.rule, progress)?,
        (None, Some(_)) => open_without_generating(place, scene, set, selection, config.rule)?,
        (None, None) => open_data(place, scene, set, selection, &config.rules, config.rule, progress)?,
    };
    let Some(plan) = &config.plan else {
        let questions = select(dataset.questions().to_vec(), selection)?;
        return Ok((dataset, questions));
    };
    plan.check_identity(&plan_identity(config, &dataset)?)?;
    let data_questions = match dataset.questions() {
        [] => Vec::new(),
        questions => select(questions.to_vec(), selection)?,
    };
    let questions = plan.questions(&dataset, &data_questions)?;
    Ok((dataset, questions))
}

/// Position of each question among all questions of the data: from the plan if there is one, otherwise from the data
/// set.
fn file_places(config: &Evaluation, dataset: &Dataset, selected: &[Question]) -> HashMap<QuestionId, usize> {
    if let Some(plan) = &config.plan {
        selected.iter().map(|question| question.id.clone()).zip(plan.question_places()).collect()
    } else {
        dataset.questions().iter().map(|question| question.id.clone()).zip(0..).collect()
    }
}

/// Opens the models without sending any request.
fn open_models(
    config: &Evaluation,
    controls: &AddedControls,
    dataset: &Arc<Dataset>,
    questions: &[Question],
) -> Result<Vec<ModelUnderTest>> {
    let ask = &config.job.ask;
    let guesser = Random { seed: config.job.light.kinds.sensor.seed };
    let asks_observer = ask.models.iter().any(|model| matches!(model.id, ModelName::Observer(_)));
    let observer = if asks_observer {
        let rules = config.rules.clone();
        Some(Observer::open(dataset, &config.place, &config.set.root.data_root, questions, rules)?)
    } else {
        None
    };
    let runtime = config.job.loading.runtime.search();
    models::open_all(ask, &controls.names, |name| {
        Ok(match (name, &observer) {
            (ModelName::Observer(control), Some(observer)) => Model::Local(observer.model(*control, guesser)),
            (ModelName::RoomNet, _) => {
                warn_of_guesses(questions, &config.rules);
                let net = RoomNet::new(runtime.clone(), config.rules.clone())?;
                Model::Local(net.model(guesser))
            }
            _ => Model::Random(guesser),
        })
    })
}

/// True if a model is the control `observer:other-room`, which gets the image of another scene.
pub(super) fn is_other_room(model: &ModelUnderTest) -> bool {
    Control::from_model_name(model.model.name()) == Some(Control::OtherRoom)
}

/// Controls that are added to a run with the observer.
#[derive(Debug, Default)]
pub(super) struct AddedControls {
    pub(super) names: Vec<ModelName>,
    /// Line for the user about other-room; `None` if it is not possible.
    line: Option<&'static str>,
}

impl AddedControls {
    /// The controls to add: none without the observer, else at least the default control. This is other-room or, if all
    /// frames are of one scene, the image with its tiles in another order.
    ///
    /// # Errors
    /// If a flag names other-room, and all frames are of one scene.
    pub(super) fn new(config: &Evaluation, has_other_scene: bool) -> Result<Self> {
        let ask = &config.job.ask;
        let other_room = ModelName::Observer(Some(Control::OtherRoom));
        if !has_other_scene && ask.shows_images_to(&other_room) {
            let problem = "observer:other-room needs frames of at least two scenes";
            return Err(Error::usage("--model", problem));
        }
        if !ask.shows_images_to(&ModelName::Observer(None)) {
            return Ok(Self::default());
        }
        let default = if has_other_scene { Control::OtherRoom } else { Control::Tiles };
        let names: Vec<ModelName> = Control::ALL
            .into_iter()
            .filter(|control| {
                let is_wanted = config.observer_controls || *control == default;
                is_wanted && (has_other_scene || *control != Control::OtherRoom)
            })
            .map(|control| ModelName::Observer(Some(control)))
            .filter(|name| !ask.shows_images_to(name))
            .collect();
        if !has_other_scene {
            tracing::warn!(
                "all frames are of one scene, so observer:other-room is not possible; observer:tiles is asked instead: the observer \
                 with the tiles of the right image in another order; its score must be that of chance"
            );
        }
        let line = has_other_scene.then_some(
            "observer:other-room is asked too: the observer with the image of another scene; its score must be that of chance",
        );
        Ok(Self { names, line })
    }

    /// Prints the line about other-room.
    pub(super) fn print(&self, progress: &Progress) {
        if let Some(line) = self.line {
            progress.print_on_terminal(line);
        }
    }
}

/// The warning; `None` if the data set has scenes, or the names of the frames suggest none.
pub(super) fn unnamed_scenes<'a>(
    dataset: &Dataset,
    questions: impl Iterator<Item = &'a Question> + Clone,
) -> Option<String> {
    let frames = questions.map(|question| &question.frame);
    if frames.clone().any(|frame| !dataset.scene(frame).is_empty()) {
        return None;
    }
    let suggested = SuggestedScenes::new(frames)?;
    Some(format!("{}; a \"scene\" in each question (or --map scene=COLUMN) names them", suggested.sentence()))
}
