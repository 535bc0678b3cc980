//! The subject of a trial ([`OpenItem`]), which is an open question or an answer to mark, and its record.
//!
//! Selection of questions from a file: [`select`].

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use darkqa_ask::Query;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Decides, ExposureFacts, OpenDetail, Record, Step, WalkFacts};
use darkqa_data::openeqa::OpenQuestion;
use darkqa_engine::images::trials::{Item, Stimulus, Trial};
use darkqa_pictures::Payload;
use darkqa_report::text::words::first_names;

/// The subject of one trial.
#[derive(Debug, Clone)]
pub(crate) enum OpenItem {
    /// An open question for a model.
    Answer(Arc<OpenQuestion>),
    /// An answer for the judge.
    Mark {
        question: Arc<OpenQuestion>,
        /// The answer as shown to the judge.
        answer: Arc<str>,
    },
}

impl OpenItem {
    fn question(&self) -> &OpenQuestion {
        match self {
            Self::Answer(question) | Self::Mark { question, .. } => question,
        }
    }
}

impl Item for OpenItem {
    type Detail = OpenDetail;

    fn reply_tokens(&self) -> f64 {
        match self {
            // The reply is a short sentence.
            Self::Answer(_) => 20.0,
            // The reply is "Your mark: 5".
            Self::Mark { .. } => 4.0,
        }
    }

    fn query(&self) -> Query<'_> {
        Query::Open(&self.question().id)
    }

    fn source(&self) -> &str {
        match self {
            Self::Answer(question) => &question.episode,
            // A judge sees no frames, so its failures are counted by question.
            Self::Mark { question, .. } => &question.id.0,
        }
    }

    fn turn(&self) -> u32 {
        0
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record<OpenDetail> {
        let question = trial.item.question();
        let (condition, detail) = match &trial.item {
            Self::Mark { answer, .. } => {
                let judged = Some(answer.to_string());
                let detail = detail(question, Step::Mark);
                (None, OpenDetail { judged, ..detail })
            }
            Self::Answer(_) => {
                let images = walk_facts(&stimulus.images);
                let detail = detail(question, Step::Answer);
                (stimulus.condition.clone(), OpenDetail { images, ..detail })
            }
        };
        Record::blank(trial.key, question.id.clone(), model, condition, detail)
    }
}

/// The detail of a record before the reply.
pub(super) fn detail(question: &OpenQuestion, step: Step) -> OpenDetail {
    OpenDetail {
        step,
        episode: question.episode.clone(),
        category: question.category.clone(),
        person: None,
        judged: None,
        upstream: None,
        tolerant: None,
        images: None,
    }
}

/// Facts about all images of a stimulus together; `None` without images.
fn walk_facts(images: &[Arc<Payload>]) -> Option<WalkFacts> {
    let first = images.first()?.facts();
    Some(WalkFacts {
        images: images.len(),
        bytes: images.iter().map(|image| image.facts().bytes).sum(),
        digest: Payload::joint_digest(images)?,
        width: first.width,
        height: first.height,
        format: first.format.clone(),
        exposure: ExposureFacts::shared(images.iter().map(|image| image.facts().exposure)),
    })
}

/// Maximum number of names in a message.
pub(super) const MAX_NAMED: usize = 3;

/// The flags that select questions.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "OpenEQA")]
pub(crate) struct OpenSelectionArgs {
    /// Only questions of these splits, as hm3d-v0,scannet-v0; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = trimmed, add = Decides::Trials)]
    pub splits: Vec<String>,
    /// Only questions of these categories, as "object localization,world knowledge"; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = trimmed, add = Decides::Trials)]
    pub categories: Vec<String>,
    /// Only the questions whose ids are in this file, a JSON array, as open-eqa-v0-184-questions.json; default: all
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

/// Selects the questions to ask. Warns about ids of the subset that are not in the file.
///
/// # Errors
/// If a split or category is not in the file, or no question is selected.
pub(super) fn select(all: Vec<OpenQuestion>, selection: &OpenSelectionArgs) -> Result<Vec<OpenQuestion>> {
    let subset = selection.subset.as_deref().map(read_ids).transpose()?;
    if let (Some(subset), Some(path)) = (&subset, &selection.subset) {
        let known: BTreeSet<&str> = all.iter().map(|question| &*question.id.0).collect();
        let unknown: Vec<&str> = subset.iter().map(|id| &**id).filter(|id| !known.contains(id)).collect();
        if !unknown.is_empty() {
            tracing::warn!(
                "{}: {} of {} ids are not in the file of questions: {}",
                path.display(),
                unknown.len(),
                subset.len(),
                first_names(&unknown, MAX_NAMED)
            );
        }
    }
    check_known("--splits", &selection.splits, all.iter().map(OpenQuestion::split))?;
    let categories = all.iter().map(|question| &*question.category);
    check_known("--categories", &selection.categories, categories)?;
    let allows = |list: &[String], name: &str| list.is_empty() || list.iter().any(|one| one == name);
    let questions: Vec<OpenQuestion> = all
        .into_iter()
        .filter(|question| {
            allows(&selection.splits, question.split())
                && allows(&selection.categories, &question.category)
                && subset.as_ref().is_none_or(|subset| subset.contains(&question.id.0))
        })
        .take(selection.limit.map_or(usize::MAX, usize::from))
        .collect();
    if questions.is_empty() {
        let problem = "no question of the file matches all of --splits, --categories and --subset";
        return Err(Error::usage("--questions", problem));
    }
    Ok(questions)
}

/// Checks that every selected name occurs in the file.
fn check_known<'a>(flag: &str, names: &[String], known: impl Iterator<Item = &'a str>) -> Result<()> {
    let known: BTreeSet<&str> = known.collect();
    match names.iter().find(|name| !known.contains(&***name)) {
        None => Ok(()),
        Some(missing) => {
            let known: Vec<&str> = known.into_iter().collect();
            let problem = format!("{missing:?} is not one of {}", known.join(", "));
            Err(Error::usage(flag, problem))
        }
    }
}

/// Reads question ids from a file with a JSON array.
fn read_ids(path: &Path) -> Result<BTreeSet<String>> {
    let text = files::bytes(path)?;
    serde_json::from_slice(&text).map_err(|e| {
        let problem = format!("{e}; a JSON array of question ids expected");
        Error::data(path.display(), problem)
    })
}
