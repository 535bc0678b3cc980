//! The data and models of an evaluation, opened and checked: [`ChoiceSetup`].
//!
//! Choice of the frame shown to the control `observer:other-room`: [`OtherRooms`].
//!
//! Controls of the observer that are added to a run without a flag: [`AddedControls`].
//!
//! The warning about frames without the scenes that their names suggest: [`unnamed_scenes`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use super::settings::{Evaluation, plan_identity};
use crate::ask::{Model, Random};
use crate::data::Dataset;
use crate::engine::dark_already;
use crate::engine::images::enhancement::evenly_spaced_indices;
use crate::engine::images::frames::{Source, first_question_per_frame, inspect_all, photographs};
use crate::engine::images::progress::Progress;
use crate::engine::images::recipes::Recipe;
use crate::engine::images::trials::{
    QuestionBank, check_enhanced, conditions, open_data, open_without_generating, select,
};
use crate::engine::models::{self, ModelName, ModelUnderTest};
use crate::engine::observer::{Observer, RoomNet};
use crate::engine::settings::JobSettings;
use crate::error::{Error, Result};
use crate::runs::shard_records::shard_questions;
use crate::types::manifests::PartPlace;
use crate::types::{Condition, Control, Digest, FrameId, Question, QuestionId, SetLight, TreatmentSet};
use darkqa_enhance::{FRAMES, ModelFile};
use darkqa_questions::observer::is_in_rulebook;
use darkqa_questions::rules::Rules;
use darkqa_score::suggested_scenes::SuggestedScenes;

/// Data and models of an evaluation, opened and checked. Nothing has been asked or written yet.
pub(super) struct ChoiceSetup<'a> {
    pub(super) config: &'a Evaluation,
    pub(super) dataset: Arc<Dataset>,
    pub(super) questions: Vec<Question>,
    /// Questions for the control `observer:other-room` whose image belongs to this run or shard.
    pub(super) with_other_rooms: Vec<Question>,
    pub(super) other_rooms: OtherRooms,
    pub(super) sources: Vec<Source>,
    /// In a shard, the sources of the whole run that enhancers are tried on.
    pub(super) probe_sources: Vec<Source>,
    /// Position of the sources within the whole run; `None` if this is the whole run.
    pub(super) part: Option<PartPlace>,
    /// Index of each frame in `sources`.
    pub(super) places: HashMap<FrameId, usize>,
    /// Position of each question among all selected ones, for models that are asked only the first few.
    pub(super) question_places: HashMap<QuestionId, usize>,
    /// Position of each question among all questions of the data.
    pub(super) file_places: HashMap<QuestionId, usize>,
    /// Digest of each frame that a question is about, over its file or all its files. Empty if no image is read.
    pub(super) digests: HashMap<FrameId, Digest>,
    pub(super) models: Vec<ModelUnderTest>,
    pub(super) conditions: Vec<Condition>,
    pub(super) recipe: Recipe,
    /// Digest of the questions that are asked about every image; `None` if questions have answers.
    pub(super) bank: Option<Digest>,
    /// Mean linear luminance of a sample of the frames, and the sample size; `None` if the set is not dark.
    pub(super) brightness: Option<(f64, usize)>,
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
        let probe_sources =
            if part.is_some() && !enhancer_files.is_empty() { probe_sources(&dataset, &selected) } else { Vec::new() };
        let mut setup = Self {
            config,
            probe_sources,
            places: sources.iter().map(|source| source.name.clone()).zip(0..).collect(),
            question_places: selected.iter().map(|question| question.id.clone()).zip(0..).collect(),
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
            setup.add_other_rooms(selected)?;
        }
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
        if let Some(warning) = unnamed_scenes(&self.dataset, &self.questions) {
            tracing::warn!("{warning}");
        }
    }

    /// Adds the selected questions that are asked with the image of another frame, if that image belongs to this run or
    /// shard.
    fn add_other_rooms(&mut self, mut questions: Vec<Question>) -> Result<()> {
        questions.retain(|question| {
            let shown = self.other_rooms.shown_for(&question.frame);
            shown.is_some_and(|shown| self.places.contains_key(shown))
        });
        for question in &questions {
            if self.digests.contains_key(&question.frame) {
                continue;
            }
            let plan = self.config.plan.as_ref();
            if let Some(digest) = plan.and_then(|plan| plan.digest(&question.frame)) {
                self.digests.insert(question.frame.clone(), digest);
                continue;
            }
            let source = Source::from_questions(&self.dataset, &question.frame)?;
            if let Some(digest) = source.digest() {
                self.digests.insert(source.name, digest);
            }
        }
        self.with_other_rooms = questions;
        Ok(())
    }
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

/// Digest of each source, over its file or all its files. Sources without frames are left out.
fn digests(sources: &[Source]) -> HashMap<FrameId, Digest> {
    sources.iter().filter_map(|source| Some((source.name.clone(), source.digest()?))).collect()
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

/// For each frame, the frame whose image is shown instead.
///
/// It is the next frame of another scene in the order of the run; after the last frame, the order starts again at the
/// first. All frames of the run are considered, so that shards and resumed runs choose the same.
#[derive(Debug, Default)]
pub(super) struct OtherRooms(BTreeMap<FrameId, FrameId>);

impl OtherRooms {
    /// Chooses the other frames; `None` if all frames are of one scene. A frame without a scene (empty) counts as a
    /// scene of its own.
    pub(super) fn new(questions: &[Question], scene: impl Fn(&FrameId) -> String) -> Option<Self> {
        let frames: Vec<&FrameId> =
            first_question_per_frame(questions).into_iter().map(|question| &question.frame).collect();
        let scenes: Vec<String> = frames
            .iter()
            .map(|frame| match scene(frame) {
                scene if scene.is_empty() => format!("frame {frame}"),
                scene => scene,
            })
            .collect();
        if scenes.iter().collect::<HashSet<_>>().len() < 2 {
            return None;
        }
        let count = frames.len();
        let mut others = BTreeMap::new();
        let mut next = 0;
        // Going backwards, `next` is the nearest later frame of another scene. For the last scene this is one of the
        // first frames, which is known only after one pass over all frames, so the loop makes two.
        for place in (0..2 * count).rev().map(|place| place % count) {
            let after = (place + 1) % count;
            if scenes[after] != scenes[place] {
                next = after;
            }
            others.insert(frames[place].clone(), frames[next].clone());
        }
        Some(Self(others))
    }

    /// The frame that is shown in place of a frame.
    pub(super) fn shown_for(&self, frame: &FrameId) -> Option<&FrameId> {
        self.0.get(frame)
    }
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
pub(super) fn unnamed_scenes(dataset: &Dataset, questions: &[Question]) -> Option<String> {
    let frames = questions.iter().map(|question| &question.frame);
    if frames.clone().any(|frame| !dataset.scene(frame).is_empty()) {
        return None;
    }
    let suggested = SuggestedScenes::new(frames)?;
    Some(format!("{}; a \"scene\" in each question (or --map scene=COLUMN) names them", suggested.sentence()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Choices, Family, QuestionId};

    fn others(frames: &str) -> Option<String> {
        let questions: Vec<Question> = frames
            .chars()
            .enumerate()
            .map(|(id, frame)| Question {
                id: QuestionId(id.to_string()),
                frame: FrameId(frame.to_string()),
                family: Family::Closest,
                text: "?".into(),
                choices: Choices::new(vec!["a".into(), "b".into()], 0).unwrap(),
                group: None,
                evidence: serde_json::Value::Null,
            })
            .collect();
        // Lower and upper case are frames of one scene; digits have none.
        let others = OtherRooms::new(&questions, |frame| frame.0.to_lowercase().replace(char::is_numeric, ""))?;
        frames.chars().map(|frame| Some(others.shown_for(&FrameId(frame.to_string())).unwrap().0.clone())).collect()
    }

    #[test]
    fn the_next_frame_of_another_scene_is_shown() {
        for (frames, shown) in [
            ("12", Some("21")),
            ("aAbB", Some("bbaa")),
            ("aAbBc", Some("bbcca")),
            ("adDA", Some("dAAd")),
            ("aabb", Some("bbaa")),
            ("123", Some("231")),
            ("aA", None),
            ("a", None),
            ("", None),
        ] {
            let found = others(frames);
            let expected = shown.map(str::to_owned);
            assert_eq!(found, expected, "{frames}");
        }
    }
}
