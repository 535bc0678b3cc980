//! What every way of asking begins with: [`Stage`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;

use super::gallery::{self, Gallery};
use super::identity::{self, Identity};
use super::plan::Inputs;
use super::progress::Progress;
use super::questions::by_rule::by_rule;
use super::{RESULTS, askers, observer};
use crate::config::{Ask, Config, Data, ModelName, RunPlace, Shard};
use crate::dataset::Dataset;
use crate::enhance::ModelFile;
use crate::error::{Error, Result};
use crate::store;
use crate::types::{ChoiceDetail, Detail, Digest, Family, FrameId, Question, View};

/// Everything an evaluation is made of, opened and checked; nothing is asked, and nothing written.
pub(super) struct Stage<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) questions: &'a [Question],
    pub(super) inputs: Inputs<'a>,
    /// The enhancement models, not yet loaded.
    pub(super) files: Vec<ModelFile>,
    pub(super) identity: Identity,
    /// Where the run lies, or will.
    pub(super) folder: PathBuf,
}

impl Stage<'_> {
    /// Sets the stage and acts on it.
    pub(super) fn set<T>(
        config: &Config,
        progress: &Progress,
        act: impl FnOnce(Stage<'_>) -> Result<T>,
    ) -> Result<T> {
        let dataset = Arc::new(open(&config.data, progress)?);
        let questions = part(select(&dataset, &config.data)?, config.shard)?;
        let askers = askers::open(config, &dataset, &questions)?;
        // Where every model is blind, no image is read and no enhancer is opened.
        let seeing = askers.iter().any(|asker| asker.view == View::Image);
        let models = if seeing {
            &*config.enhancement.models
        } else {
            &[]
        };
        let files = identity::enhancers(models)?;
        let pictures = if seeing {
            gallery::look_through(&dataset, &questions, progress)?
        } else {
            Gallery::new()
        };
        let inputs = Inputs::new(config, &questions, &pictures, &askers, &files)?;
        let identity = identity::identity(config, &dataset, &inputs);
        let label = label(&config.ask);
        let hash = identity::digest(&identity);
        let schema = ChoiceDetail::SCHEMA;
        let place = config.output.place.of(config.shard);
        let folder = folder(&place, schema, &label, dataset.name(), hash)?;
        act(Stage {
            dataset: &dataset,
            questions: &questions,
            inputs,
            files,
            identity,
            folder,
        })
    }
}

/// Opens the data; where they come without questions, they are made by rule.
pub(super) fn open(config: &Data, progress: &Progress) -> Result<Dataset> {
    let dataset = Dataset::open(&config.place, config.questions.as_deref())?
        .with_most_pixels(config.most_pixels);
    if !dataset.questions().is_empty() {
        return Ok(dataset);
    }
    let questions = by_rule(&dataset, progress)?;
    Ok(dataset.with_questions(questions))
}

/// The questions that are asked: of the chosen families, the first so many.
pub(super) fn select(dataset: &Dataset, config: &Data) -> Result<Vec<Question>> {
    let wanted = |question: &&Question| {
        config
            .families
            .as_ref()
            .is_none_or(|list| list.contains(&question.family))
    };
    let there: BTreeSet<&Family> = dataset
        .questions()
        .iter()
        .map(|question| &question.family)
        .collect();
    if let Some(missing) = config
        .families
        .iter()
        .flatten()
        .find(|family| !there.contains(family))
    {
        let there: Vec<&str> = there.into_iter().map(Family::name).collect();
        let problem = format!(
            "no question of the family {missing}; there are: {}",
            there.join(", ")
        );
        return Err(Error::usage("--families", problem));
    }
    let limit = config.limit.map_or(usize::MAX, usize::from);
    Ok(dataset
        .questions()
        .iter()
        .filter(wanted)
        .take(limit)
        .cloned()
        .collect())
}

/// The questions about the frames of a shard, which are dealt out one by one in the order in which they are first asked about.
fn part(questions: Vec<Question>, shard: Shard) -> Result<Vec<Question>> {
    if !shard.is_part() {
        return Ok(questions);
    }
    let mut places = BTreeMap::<FrameId, usize>::new();
    for question in &questions {
        let next = places.len();
        places.entry(question.frame.clone()).or_insert(next);
    }
    let own = questions.into_iter();
    let own = own.filter(|question| places.get(&question.frame).is_some_and(|at| shard.has(*at)));
    let own: Vec<Question> = own.collect();
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames; as many parts at most expected",
            places.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    Ok(own)
}

/// The models in the name of a folder.
pub(super) fn label(ask: &Ask) -> String {
    let names = ask
        .models
        .iter()
        .chain(&ask.blind_models)
        .map(|name| match name {
            ModelName::Random => "random".to_owned(),
            ModelName::Observer => observer::NAME.to_owned(),
            ModelName::Script(path) => path.file_stem().map_or_else(
                || "script".to_owned(),
                |stem| stem.to_string_lossy().into_owned(),
            ),
            ModelName::Remote(name) => name.clone(),
        });
    names
        .take(2)
        .collect::<Vec<_>>()
        .join("-")
        .chars()
        .take(60)
        .collect()
}

/// The folder of a run: the one named, else the newest whose identity has this hash, else a new one.
pub(super) fn folder(
    place: &RunPlace,
    schema: &str,
    label: &str,
    data: &str,
    hash: Digest,
) -> Result<PathBuf> {
    match place {
        RunPlace::Named(path) => Ok(path.clone()),
        RunPlace::Resume(path) => match store::read_manifest(path, schema)? {
            Some(_) => Ok(path.clone()),
            None => Err(Error::usage(
                "--resume",
                format_args!(
                    "{}: no run in this folder; a new run takes --out",
                    path.display()
                ),
            )),
        },
        RunPlace::Automatic => {
            let hash = &hash.to_string()[..8];
            let base = Path::new(RESULTS);
            Ok(store::find(base, hash).unwrap_or_else(|| {
                let time = Timestamp::now().strftime("%Y%m%d-%H%M%S");
                let name = format!("{time}-{label}-{data}-{hash}");
                base.join(name.replace(|c: char| !(c.is_alphanumeric() || "-_.".contains(c)), "_"))
            }))
        }
    }
}
