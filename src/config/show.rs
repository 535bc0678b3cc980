//! What `show` is told, and how a run's images are made again: [`ShowItem`], [`Again`] and [`Recipe`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::{Map, Value};

use super::layers::{above, read};
use super::{Data, Enhancement, Images, Sensor, Walk, data, enhancement, images};
use crate::cli::{AgainArgs, DataArgs, EnhancementArgs, EvaluateArgs, ShowArgs};
use crate::error::{Error, Result};
use crate::types::Condition;

/// The flags that decide the images of a run, as they were said; a manifest keeps them.
pub type Recipe = BTreeMap<String, Value>;

/// How walks are shown stands under this name among the flags.
pub(super) const WALK: &str = "walk";

/// The flags of an evaluation that decide no pixel, though they stand among those that do.
const NO_PIXELS: [&str; 10] = [
    "limit",
    "families",
    "shuffle-options",
    "circular",
    "repeats",
    "llie-on",
    "threads",
    "ort-lib",
    "offline",
    "questions",
];

/// The flags that decide the images of an evaluation.
///
/// # Errors
/// Where a path is no text that a manifest can hold.
pub(super) fn recipe(said: &EvaluateArgs) -> Result<Recipe> {
    let unfit = |e: serde_json::Error| {
        Error::usage(
            "--data",
            format_args!("cannot be kept in the manifest: {e}"),
        )
    };
    let mut flags = Map::new();
    for group in [
        serde_json::to_value(&said.data),
        serde_json::to_value(&said.sensor),
        serde_json::to_value(&said.enhancement),
    ] {
        if let Value::Object(group) = group.map_err(unfit)? {
            flags.extend(group);
        }
    }
    flags.insert("image".to_owned(), said.sending.image.clone().into());
    flags.insert(
        "max_side".to_owned(),
        said.sending.max_side.map(u32::from).into(),
    );
    let said = flags.into_iter().filter_map(|(field, value)| {
        let flag = field.replace('_', "-");
        let nothing = match &value {
            Value::Null | Value::Bool(false) => true,
            Value::Array(list) => list.is_empty(),
            _ => false,
        };
        (!nothing && !NO_PIXELS.contains(&&*flag)).then_some((flag, value))
    });
    Ok(said.collect())
}

/// Everything that decides the images of a run.
#[derive(Debug)]
pub struct Pictures {
    /// Where the frames are.
    pub data: Data,
    /// What takes the noisy ones.
    pub sensor: Sensor,
    /// What mends them.
    pub enhancement: Enhancement,
    /// How they are sent.
    pub images: Images,
    /// How walks are shown; `None` if frames are shown one by one.
    pub walk: Option<Walk>,
}

/// What is said, after a run, of how its images are made again: where the data and the enhancers lie by now.
#[derive(Debug)]
pub struct Again(EvaluateArgs);

impl Again {
    pub(super) fn said(said: AgainArgs) -> Self {
        Self(EvaluateArgs {
            data: DataArgs {
                data: said.data,
                ..DataArgs::default()
            },
            enhancement: EnhancementArgs {
                llie: said.llie,
                threads: said.threads,
                ort_lib: said.ort_lib,
                offline: said.offline,
                ..EnhancementArgs::default()
            },
            ..EvaluateArgs::default()
        })
    }

    /// How the images of a run are made again, by its own flags and those said here.
    ///
    /// # Errors
    /// Where a flag that the run was made with means nothing to this version.
    pub fn pictures(self, recipe: &Recipe) -> Result<Pictures> {
        let mut recipe = recipe.clone();
        let walk = recipe.remove(WALK);
        let said = above(self.0, read("the manifest's images", &recipe)?);
        let walk = walk.map(|walk| {
            let mut walk: Walk =
                serde_json::from_value(walk).map_err(|e| Error::data("the manifest's walk", e))?;
            if let Some(folder) = said.data.data.clone() {
                walk.folder = folder;
            }
            Ok(walk)
        });
        Ok(Pictures {
            walk: walk.transpose()?,
            sensor: Sensor::resolve(&said.sensor)?,
            images: images(&said.sending)?,
            data: data(said.data)?,
            enhancement: enhancement(said.enhancement)?,
        })
    }
}

/// Everything that `show` is told.
#[derive(Debug)]
pub struct ShowItem {
    /// The run folder.
    pub run: PathBuf,
    /// The question.
    pub item: String,
    /// The conditions; empty for all.
    pub conditions: Vec<Condition>,
    /// Where the images go; `None` for the run folder.
    pub out: Option<PathBuf>,
    /// What is said here of the data and the enhancers.
    pub again: Again,
}

impl ShowItem {
    /// Checks what was said.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: ShowArgs) -> Result<Self> {
        Ok(Self {
            run: said.run,
            item: said.item,
            conditions: conditions(&said.condition)?,
            out: said.out,
            again: Again::said(said.again),
        })
    }
}

/// Conditions by their names.
pub(super) fn conditions(said: &[String]) -> Result<Vec<Condition>> {
    let parsed = said
        .iter()
        .map(|text| text.parse().map_err(|e: Error| e.at("--condition")));
    parsed.collect()
}
