//! The data and models of an evaluation by open questions, opened and checked: [`OpenSetup`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use super::answers_file;
use super::judge::Judge;
use super::questions::{MAX_NAMED, select};
use super::settings::{OpenEqa, OpenTask};
use crate::ask::Parameters;
use crate::data::openeqa::{self, OpenQuestion};
use crate::engine::images::frames::{Source, WalkFolder};
use crate::engine::images::progress::Progress;
use crate::engine::images::recipes::Recipe;
use crate::engine::images::trials::{check_enhanced, conditions};
use crate::engine::models::{self, ModelUnderTest};
use crate::error::{Error, Result};
use crate::report::text::words::first_names;
use crate::runs::shard_sources::shard_questions;
use crate::types::manifests::PartPlace;
use crate::types::text::counted;
use crate::types::{Condition, FrameId, OpenDetail, QuestionId, Record, View};
use darkqa_enhance::ModelFile;

/// Data and models of an evaluation by open questions, opened and checked. Nothing has been asked or written yet.
pub(super) struct OpenSetup<'a> {
    pub(super) config: &'a OpenEqa,
    /// The questions to ask, in the order of the file.
    pub(super) questions: Vec<Arc<OpenQuestion>>,
    /// Position of each question among all selected ones, for models that are asked only the first few.
    pub(super) question_places: HashMap<QuestionId, usize>,
    /// Index of each question in the file.
    pub(super) file_places: HashMap<QuestionId, usize>,
    pub(super) walks: WalkFolder,
    /// The walks in the order of their first question.
    pub(super) sources: Vec<Source>,
    /// Position of the walks within the whole run; `None` if this is the whole run.
    pub(super) part: Option<PartPlace>,
    pub(super) conditions: Vec<Condition>,
    pub(super) models: Vec<ModelUnderTest>,
    pub(super) judge: Option<ModelUnderTest>,
    pub(super) recipe: Recipe,
    /// The answers from `--answers` files.
    pub(super) file_answers: Vec<Record<OpenDetail>>,
}

impl<'a> OpenSetup<'a> {
    /// Opens the questions, the walks and the models. Also returns the files of the enhancers, which are read but not
    /// yet loaded.
    pub(super) fn open(config: &'a OpenEqa, progress: &Progress) -> Result<(Self, Vec<ModelFile>)> {
        let job = &config.job;
        let all = openeqa::read_questions(&config.questions)?;
        let file_places = all.iter().map(|question| question.id.clone()).zip(0..).collect();
        let selected = select(all, &config.chosen)?;
        let question_places = selected.iter().map(|question| question.id.clone()).zip(0..).collect();
        let (questions, part) = shard_questions(
            selected,
            job.shard,
            |question: &OpenQuestion| question.episode.clone(),
            |_| String::new(),
            |_| 1,
        )?;
        let models = models::open_all(&job.ask, &[], |name| models::open(name, None, &Parameters::new(String::new())))?;
        let judge = config.judge.as_ref().map(open_judge).transpose()?;
        // Without models or people that see frames, no frame is read and no enhancer is opened.
        let shows_frames = matches!(config.task, OpenTask::Study(_)) || job.shows_images();
        let files = if shows_frames { job.enhancers()? } else { Vec::new() };
        let recipe = Recipe::new(&job.light.kinds, job.format, None, &files);
        let recipe = recipe.for_walks(&config.walk);
        let recipe = if shows_frames { recipe.with_enhanced_images(&job.enhancers.enhanced)? } else { recipe };
        let walks = WalkFolder::new(&config.walk, &config.root, config.rule);
        let names = walk_names(&questions);
        let (sources, conditions) = if shows_frames {
            let sources = walks.inspect(&names, &config.walk, progress);
            warn_of_unseen(&sources, &questions)?;
            warn_of_repeated(&sources);
            let on = job.enhancers.on();
            job.light.refuse_matches("the frames of walks have none")?;
            let conditions = conditions(&job.light, &[], on, &recipe.enhancer_names());
            check_enhanced(&conditions, &job.enhancers)?;
            (sources, conditions)
        } else {
            (names.into_iter().map(|name| Source::without_frames(FrameId(name))).collect(), Vec::new())
        };
        recipe.check(&sources, &conditions)?;
        let mut setup = Self {
            config,
            questions: questions.into_iter().map(Arc::new).collect(),
            question_places,
            file_places,
            walks,
            sources,
            part,
            conditions,
            models,
            judge,
            recipe,
            file_answers: Vec::new(),
        };
        setup.file_answers = setup.read_answers()?;
        Ok((setup, files))
    }

    /// The index in `sources` of the walk of a question.
    pub(super) fn walk_of(&self, question: &OpenQuestion) -> usize {
        self.sources.iter().position(|source| source.name.0 == question.episode).unwrap_or_default()
    }

    /// Reads the answers in all `--answers` files.
    fn read_answers(&self) -> Result<Vec<Record<OpenDetail>>> {
        let mut names: BTreeSet<&str> = self.models.iter().map(|model| &*model.name).collect();
        let mut all = Vec::new();
        for file in &self.config.answers {
            if !names.insert(&file.name) {
                let problem = format_args!("the name {:?} is used twice among models and answers", file.name);
                return Err(Error::usage("--answers", problem));
            }
            let variants = self.config.job.light.variants;
            all.extend(answers_file::read(file, &self.questions, variants)?);
        }
        Ok(all)
    }
}

fn open_judge(config: &Judge) -> Result<ModelUnderTest> {
    let server = config.server.as_ref();
    let endpoint = server.map(|server| models::endpoint(server)).transpose()?;
    let model = models::open(&config.model, endpoint.as_ref(), &config.parameters)?;
    ModelUnderTest::new(model, View::Blind, server)
}

/// The distinct walks of the questions, in the order of their first question.
fn walk_names(questions: &[OpenQuestion]) -> Vec<String> {
    let mut seen = BTreeSet::new();
    questions
        .iter()
        .filter(|question| seen.insert(&question.episode))
        .map(|question| question.episode.clone())
        .collect()
}

/// Warns of walks with fewer frames than `--num-frames`, because repeated frames are sent and paid for several times.
fn warn_of_repeated(sources: &[Source]) {
    let short: Vec<&Source> = sources.iter().filter(|source| source.order.len() > source.frames.len()).collect();
    let most = short.iter().map(|source| source.frames.len()).max();
    if let (Some(first), Some(most)) = (short.first(), most) {
        tracing::warn!(
            "{} of {} walks {} fewer frames than --num-frames {}: they are shown several times in a request, as upstream does (the {} of {}, for example){}",
            short.len(),
            sources.len(),
            if short.len() == 1 { "has" } else { "have" },
            first.order.len(),
            counted(first.frames.len(), "frame"),
            first.name,
            if short.len() == sources.len() {
                format!("; --num-frames {most} shows each once at most, and costs less")
            } else {
                String::new()
            }
        );
    }
}

/// Warns of walks that cannot be shown.
///
/// # Errors
/// If no walk can be shown.
fn warn_of_unseen(sources: &[Source], questions: &[OpenQuestion]) -> Result<()> {
    let missing: BTreeMap<&str, &str> =
        sources.iter().filter_map(|source| Some((&*source.name.0, source.problem.as_deref()?))).collect();
    let Some(problem) = missing.values().next() else {
        return Ok(());
    };
    if missing.len() == sources.len() {
        let problem = format!("no walk can be shown: {problem}; DIR/EPISODE_HISTORY/*-rgb.png expected");
        return Err(Error::usage("--frames", problem));
    }
    let unanswered = questions.iter().filter(|question| missing.contains_key(&*question.episode));
    let walks: Vec<&str> = missing.keys().copied().collect();
    tracing::warn!(
        "{} of {} walks cannot be shown ({}); unanswered questions: {}; the first problem: {problem}",
        walks.len(),
        sources.len(),
        first_names(&walks, MAX_NAMED),
        unanswered.count()
    );
    Ok(())
}
