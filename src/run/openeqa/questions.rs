//! Which questions of a file are asked: [`select`].

use std::collections::BTreeSet;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::dataset::openeqa::OpenQuestion;
use crate::error::{Error, Result};
use crate::types::Decides;

/// Which questions of a file are asked.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "OpenEQA")]
pub(crate) struct OpenSelectionArgs {
    /// Only questions of these splits, as hm3d-v0,scannet-v0; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = trimmed, add = Decides::Trials)]
    pub splits: Vec<String>,
    /// Only questions of these categories, as "object localization,world knowledge"; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = trimmed, add = Decides::Trials)]
    pub categories: Vec<String>,
    /// Only the questions whose ids stand in this file, a JSON array, as open-eqa-v0-184-questions.json; default: all
    #[arg(long, value_name = "FILE", add = Decides::Trials)]
    pub subset: Option<PathBuf>,
    /// Only the first N questions; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub limit: Option<NonZeroUsize>,
}

#[expect(clippy::unnecessary_wraps, reason = "the form of a value parser")]
fn trimmed(name: &str) -> Result<String, std::convert::Infallible> {
    Ok(name.trim().to_owned())
}

/// The questions that are asked.
pub(super) fn select(
    all: Vec<OpenQuestion>,
    chosen: &OpenSelectionArgs,
) -> Result<Vec<OpenQuestion>> {
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
        &chosen.splits,
        all.iter().map(OpenQuestion::split),
    )?;
    let categories = all.iter().map(|question| &*question.category);
    among("--categories", &chosen.categories, categories)?;
    let has = |list: &[String], name: &str| list.is_empty() || list.iter().any(|one| one == name);
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
fn among<'a>(flag: &str, chosen: &[String], there: impl Iterator<Item = &'a str>) -> Result<()> {
    let there: BTreeSet<&str> = there.collect();
    let mut wanted = chosen.iter();
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
