//! What every way of asking open questions begins with: [`Stage`].

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;

use super::episode::{self, Episode};
use crate::ask::TokenField;
use crate::config::{Chosen, Judge, OpenEqa, OpenTask, Walk};
use crate::dataset::openeqa::{self, OpenQuestion};
use crate::enhance::{ModelFile, Tiling};
use crate::error::{Error, Result};
use crate::run::askers::{self, Asker};
use crate::run::identity::{self, Identity};
use crate::run::plan::conditions;
use crate::run::progress::Progress;
use crate::run::recipe::Recipe;
use crate::run::stage::{folder, label};
use crate::types::{Condition, Detail, Digest, OpenDetail, View};

/// Everything an evaluation by open questions is made of, opened and checked; nothing is asked, and nothing written.
pub(super) struct Stage<'a> {
    /// The questions that are asked, in the order of the file.
    pub(super) questions: Vec<Arc<OpenQuestion>>,
    /// Their walks, in the order of the questions.
    pub(super) episodes: Vec<Episode>,
    pub(super) conditions: Vec<Condition>,
    pub(super) askers: Vec<Asker>,
    pub(super) judge: Option<Asker>,
    pub(super) walk: &'a Walk,
    pub(super) recipe: Recipe,
    /// The enhancement models, not yet loaded.
    pub(super) files: Vec<ModelFile>,
    pub(super) identity: Identity,
    /// Where the run lies, or will.
    pub(super) folder: PathBuf,
}

impl<'a> Stage<'a> {
    pub(super) fn set(config: &'a OpenEqa, progress: &Progress) -> Result<Self> {
        let all = openeqa::questions(&config.questions)?;
        let questions = select(all, &config.chosen)?;
        let askers = askers::open_speakers(&config.ask)?;
        let judge = config.judge.as_ref().map(judge).transpose()?;
        // Where nobody sees a frame, none is read and no enhancer is opened.
        let study = matches!(config.task, OpenTask::Study(_));
        let seeing = study || askers.iter().any(|asker| asker.view == View::Image);
        let models = if seeing {
            &*config.enhancement.models
        } else {
            &[]
        };
        let files = identity::enhancers(models)?;
        let recipe = Recipe::new(&config.light.sensor, &config.images, &files);
        let episodes = if seeing {
            walks(config, &questions, progress)?
        } else {
            unseen(&questions)
        };
        let identity = identity(config, &questions, &recipe);
        let conditions = if seeing {
            conditions(&config.light, config.enhancement.on, &recipe.enhancers)
        } else {
            Vec::new()
        };
        let stem = config.questions.file_stem().unwrap_or_default();
        let folder = folder(
            &config.output.place,
            OpenDetail::SCHEMA,
            &label(&config.ask),
            &stem.to_string_lossy(),
            asked(config, &identity, &conditions, judge.as_ref()),
        )?;
        Ok(Self {
            questions: questions.into_iter().map(Arc::new).collect(),
            episodes,
            conditions,
            askers,
            judge,
            walk: &config.walk,
            recipe,
            files,
            identity,
            folder,
        })
    }
}

fn judge(config: &Judge) -> Result<Asker> {
    let endpoint = askers::endpoint(config.server.as_ref())?;
    let model = askers::speaker(&config.model, endpoint.as_ref(), &config.parameters)?;
    Ok(Asker::new(model, View::Blind))
}

/// The questions that are asked.
fn select(all: Vec<OpenQuestion>, chosen: &Chosen) -> Result<Vec<OpenQuestion>> {
    let subset = chosen.subset.as_deref().map(ids).transpose()?;
    if let (Some(subset), Some(path)) = (&subset, &chosen.subset) {
        let known: BTreeSet<&str> = all.iter().map(|question| &*question.id.0).collect();
        let strange: Vec<&str> = subset
            .iter()
            .map(|id| &**id)
            .filter(|id| !known.contains(id))
            .collect();
        if !strange.is_empty() {
            tracing::warn!(
                "{}: {} of {} ids are no questions of the file: {}",
                path.display(),
                strange.len(),
                subset.len(),
                some(&strange)
            );
        }
    }
    among(
        "--splits",
        chosen.splits.as_deref(),
        all.iter().map(OpenQuestion::split),
    )?;
    let categories = all.iter().map(|question| &*question.category);
    among("--categories", chosen.categories.as_deref(), categories)?;
    let has = |list: &Option<Vec<String>>, name: &str| {
        list.as_ref()
            .is_none_or(|list| list.iter().any(|one| one == name))
    };
    let questions = all.into_iter().filter(|question| {
        has(&chosen.splits, question.split())
            && has(&chosen.categories, &question.category)
            && subset
                .as_ref()
                .is_none_or(|subset| subset.contains(&question.id.0))
    });
    let questions: Vec<OpenQuestion> = questions
        .take(chosen.limit.map_or(usize::MAX, usize::from))
        .collect();
    if questions.is_empty() {
        let problem =
            "no question of the file is of all that --splits, --categories and --subset name";
        return Err(Error::usage("--questions", problem));
    }
    Ok(questions)
}

/// Makes sure that what is chosen is there.
fn among<'a>(
    flag: &str,
    chosen: Option<&[String]>,
    there: impl Iterator<Item = &'a str>,
) -> Result<()> {
    let there: BTreeSet<&str> = there.collect();
    let mut wanted = chosen.unwrap_or_default().iter();
    match wanted.find(|name| !there.contains(&***name)) {
        None => Ok(()),
        Some(missing) => {
            let there: Vec<&str> = there.into_iter().collect();
            let problem = format!("{missing:?} is none of {}", there.join(", "));
            Err(Error::usage(flag, problem))
        }
    }
}

/// The ids in a file.
fn ids(path: &Path) -> Result<BTreeSet<String>> {
    let text = fs::read(path).map_err(|e| Error::file(path, "read", e))?;
    serde_json::from_slice(&text).map_err(|e| {
        let problem = format!("{e}; a JSON array of question ids expected");
        Error::data(path.display(), problem)
    })
}

/// A few of a list, in words.
pub(super) fn some(list: &[&str]) -> String {
    const FEW: usize = 3;
    let shown = list
        .iter()
        .take(FEW)
        .copied()
        .collect::<Vec<_>>()
        .join(", ");
    match list.len().saturating_sub(FEW) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// The walks of the questions in their order.
fn names(questions: &[OpenQuestion]) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let first = questions
        .iter()
        .filter(|question| seen.insert(&question.episode));
    first.map(|question| question.episode.clone()).collect()
}

/// Walks whose frames are of no interest.
fn unseen(questions: &[OpenQuestion]) -> Vec<Episode> {
    let unseen = |name| Episode {
        name,
        reel: Err("not looked at".to_owned()),
    };
    names(questions).into_iter().map(unseen).collect()
}

/// Looks through the walks; what cannot be shown is named and counted, and only where that is all of them it is an error.
fn walks(
    config: &OpenEqa,
    questions: &[OpenQuestion],
    progress: &Progress,
) -> Result<Vec<Episode>> {
    let names = names(questions);
    let episodes = episode::look_through(&names, &config.frames, &config.walk, progress);
    let missing: BTreeMap<&str, &str> = episodes
        .iter()
        .filter_map(|episode| Some((&*episode.name, &**episode.reel.as_ref().err()?)))
        .collect();
    let Some(problem) = missing.values().next() else {
        return Ok(episodes);
    };
    if missing.len() == episodes.len() {
        let problem =
            format!("no walk can be shown: {problem}; DIR/EPISODE_HISTORY/*-rgb.png expected");
        return Err(Error::usage("--frames", problem));
    }
    let lost = questions.iter();
    let lost = lost.filter(|question| missing.contains_key(&*question.episode));
    let walks: Vec<&str> = missing.keys().copied().collect();
    tracing::warn!(
        "{} of {} walks cannot be shown ({}): their {} questions are left unanswered; the first: {problem}",
        walks.len(),
        episodes.len(),
        some(&walks),
        lost.count()
    );
    Ok(episodes)
}

/// What all answers and marks of a run have in common. Models, levels, enhancers and the judge are not among it: what a run holds
/// is found by its content, so that they may be added to it and nothing is paid for twice.
fn identity(config: &OpenEqa, questions: &[OpenQuestion], recipe: &Recipe) -> Identity {
    let (ask, walk) = (&config.ask, &config.walk);
    let asked = questions.iter().flat_map(|question| {
        [&*question.id.0, &*question.text, &*question.episode].map(str::as_bytes)
    });
    let parameters = &ask.parameters;
    let base = ask
        .server
        .as_ref()
        .map(|server| server.access.base.to_string());
    let fields = [
        ("--questions", json!(Digest::of_parts(asked))),
        ("--num-frames", json!(walk.frames)),
        ("--image-size", json!(walk.side)),
        ("--degrade", json!(walk.darkened.to_string())),
        ("--sensor", json!(walk.camera.to_string())),
        ("--image", json!(config.images.format.to_string())),
        ("--base-url", json!(base)),
        ("--temperature", json!(parameters.temperature.to_string())),
        (
            "--max-tokens",
            json!(
                parameters
                    .max_tokens
                    .filter(|_| parameters.token_field != TokenField::Omit)
            ),
        ),
        ("--sampling-seed", json!(parameters.seed)),
        ("--reasoning-effort", json!(parameters.reasoning_effort)),
        ("--detail", json!(parameters.detail)),
    ];
    let tiling = config.enhancement.tiling;
    let tiling = (tiling != Tiling::Auto).then(|| ("--tile", json!(tiling.to_string())));
    let side = config.enhancement.most_side;
    let side = side.map(|side| ("--llie-max-side", json!(side)));
    let light = identity::light(recipe.seed, &recipe.readings);
    let fields = fields.into_iter().chain(light).chain(tiling).chain(side);
    fields
        .map(|(field, value)| (field.to_owned(), value))
        .collect()
}

/// All that a command asks for, by which its folder is found again.
fn asked(
    config: &OpenEqa,
    identity: &Identity,
    conditions: &[Condition],
    judge: Option<&Asker>,
) -> Digest {
    let ask = &config.ask;
    let said = json!([
        identity,
        conditions,
        format!("{:?} {:?} {:?}", ask.models, ask.view, ask.blind_models),
        judge.map(|judge| [judge.model.name(), &judge.digest]),
        config.protocol.to_string(),
        format!("{:?}", config.given),
    ]);
    Digest::of(said.to_string().as_bytes())
}
