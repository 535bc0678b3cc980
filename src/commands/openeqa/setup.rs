//! The data and models of an evaluation by open questions, opened and checked: [`OpenSetup`].
//!
//! Files with answers of people or other programs, in the format of upstream's result files: [`read`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::record::{MAX_NAMED, detail, select};
use super::settings::{AnswersFile, Judge, OpenEqa, OpenTask};
use darkqa_ask::Parameters;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::manifests::PartPlace;
use darkqa_base::types::text::counted;
use darkqa_base::types::{
    Condition, Degradation, Digest, FrameId, KindSet, OpenDetail, QuestionId, Record, Step, TrialKey, Via, View,
};
use darkqa_data::openeqa::{self, OpenQuestion};
use darkqa_engine::images::frames::{Source, WalkFolder};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::trials::{check_enhanced, conditions};
use darkqa_engine::models::{self, ModelUnderTest};
use darkqa_enhance::ModelFile;
use darkqa_report::text::words::first_names;
use darkqa_runs::shard_records::shard_questions;

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
            all.extend(read(file, &self.questions, variants)?);
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

/// An entry of a file. Other fields are ignored.
#[derive(Debug, Deserialize)]
struct AnswerEntry {
    question_id: String,
    /// `None` (`null`) if the person could not answer.
    answer: Option<String>,
    /// Condition of the frames shown, for example `L2-noise`.
    condition: Option<Condition>,
    /// Level of the frames shown, for example `L2`.
    level: Option<String>,
    /// Person who answered, if several did.
    annotator: Option<Value>,
}

/// Reads the answers in a file as records, in the order of the file. Warns about answers to questions that are not
/// selected.
///
/// # Errors
/// If the file cannot be read, a person answered the same question twice in the same condition, or a level exists in
/// several variants.
pub(super) fn read(
    config: &AnswersFile,
    questions: &[Arc<OpenQuestion>],
    variants: KindSet,
) -> Result<Vec<Record<OpenDetail>>> {
    let path = &config.path;
    let text = files::bytes(path)?;
    let entries: Vec<AnswerEntry> = serde_json::from_slice(&text).map_err(|e| {
        Error::data(
            path.display(),
            format_args!(
                "{e}; a JSON array of {{\"question_id\", \"answer\"}} expected, with \"condition\" or \"level\" and \"annotator\" \
                 where there are several"
            ),
        )
    })?;
    let known: BTreeMap<&str, usize> =
        questions.iter().enumerate().map(|(index, question)| (&*question.id.0, index)).collect();
    let (mut records, mut unknown) = (Vec::new(), Vec::new());
    let mut seen = BTreeSet::new();
    for entry in &entries {
        let Some(&index) = known.get(&*entry.question_id) else {
            unknown.push(&*entry.question_id);
            continue;
        };
        let condition = condition(entry, variants).map_err(|problem| {
            Error::data(path.display(), format_args!("question {}: {problem}", entry.question_id))
        })?;
        let person = entry.annotator.as_ref().map(|name| match name {
            Value::String(name) => name.clone(),
            other => other.to_string(),
        });
        if !seen.insert((index, condition.clone(), person.clone())) {
            return Err(Error::data(
                path.display(),
                format_args!(
                    "question {} is answered twice at {condition}; state in \"annotator\" who answered",
                    entry.question_id
                ),
            ));
        }
        let key = key(&config.name, entry, &condition, person.as_deref());
        let question = &questions[index];
        let detail = OpenDetail { person, ..detail(question, Step::Answer) };
        let condition = Some(condition);
        let record = Record::blank(key, question.id.clone(), &config.name, condition, detail);
        records.push(Record { reply: entry.answer.clone(), via: Via::File, ..record });
    }
    warn_of_unknown(path, &unknown, entries.len());
    Ok(records)
}

fn warn_of_unknown(path: &Path, unknown: &[&str], all: usize) {
    if !unknown.is_empty() {
        tracing::warn!(
            "{}: {} of {all} answers are to questions that are not asked: {}",
            path.display(),
            unknown.len(),
            first_names(unknown, MAX_NAMED)
        );
    }
}

/// The condition of an answer: untouched frames if the entry states none, as in upstream's own files.
fn condition(entry: &AnswerEntry, variants: KindSet) -> std::result::Result<Condition, String> {
    let level = match (&entry.condition, entry.level.as_deref()) {
        (Some(condition), _) => return Ok(condition.clone()),
        (None, None | Some("L0")) => return Ok(Condition::L0),
        (None, Some(level)) => level,
    };
    // Kinds on the axis of the level.
    let mut degradations: Vec<Degradation> =
        Kind::ALL.into_iter().filter_map(|kind| degradation_at(level, kind).ok()).collect();
    if degradations.is_empty() {
        return Err(degradation_at(level, Kind::Exposure).err().unwrap_or_default());
    }
    let noise = degradations.iter().find(|how| how.kind() == Kind::Sensor);
    let example = noise.or(degradations.last()).map(ToString::to_string);
    degradations.retain(|how| variants.includes(how.kind()));
    match (degradations.pop(), degradations.is_empty()) {
        (Some(degradation), true) => Ok(Condition::raw(Some(degradation))),
        _ => Err(format!(
            "\"level\" does not state which variant was shown; write \"condition\": \"{}\" instead",
            example.unwrap_or_default()
        )),
    }
}

fn degradation_at(level: &str, kind: Kind) -> std::result::Result<Degradation, String> {
    let severity = kind.severity(level).map_err(|e| e.to_string())?;
    Degradation::new(kind, severity, None).map_err(|e| e.to_string())
}

fn key(name: &str, entry: &AnswerEntry, condition: &Condition, person: Option<&str>) -> TrialKey {
    let condition = condition.to_string();
    let answer = entry.answer.as_ref().map(|answer| format!("={answer}"));
    let parts = [
        "darkqa.given/1",
        name,
        &entry.question_id,
        &condition,
        person.unwrap_or_default(),
        answer.as_deref().unwrap_or_default(),
    ];
    Digest::from_parts(parts.map(str::as_bytes)).into()
}
