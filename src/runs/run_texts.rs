//! Replies and question evidence of a run, read on demand by reports: [`RunTexts`].

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::{QuestionId, Record, RunQuestion, TextPlace};
use darkqa_score::answers::record::Detail;
use darkqa_store::{RecordLog, each_question};

/// Source of the replies of a run and of the evidence of its questions.
#[derive(Debug, Clone)]
pub enum RunTexts<D> {
    /// The files of the run.
    Stored(Arc<StoredTexts>),
    /// The files of the shards, by [`TextPlace::log`].
    Shards(Vec<Self>),
    /// The files of a run, unpacked into a temporary folder.
    Unpacked { texts: Box<Self>, _folder: Arc<TempDir> },
    /// Records in memory, by [`TextPlace::start`].
    InMemory(Arc<InMemoryTexts<D>>),
}

/// The files of a run.
#[derive(Debug)]
pub struct StoredTexts {
    folder: PathBuf,
    log: RecordLog,
}

/// Records and questions in memory.
#[derive(Debug)]
pub struct InMemoryTexts<D> {
    records: Vec<Record<D>>,
    questions: Vec<RunQuestion>,
}

impl<D> InMemoryTexts<D> {
    pub fn new(records: Vec<Record<D>>, questions: Vec<RunQuestion>) -> Self {
        Self { records, questions }
    }
}

impl<D: Detail> RunTexts<D> {
    /// Opens the texts in the folder of a run; without a file of records there are none.
    ///
    /// # Errors
    /// If the file of records cannot be opened.
    pub fn open(folder: &Path) -> Result<Self> {
        Ok(match RecordLog::open_if_exists(folder)? {
            None => Self::InMemory(InMemoryTexts::new(Vec::new(), Vec::new()).into()),
            Some(log) => {
                let folder = folder.to_owned();
                Self::Stored(StoredTexts { folder, log }.into())
            }
        })
    }

    /// The texts of each file, by [`TextPlace::log`].
    pub fn by_file(self) -> Vec<Self> {
        match self {
            Self::Shards(parts) => parts,
            one => vec![one],
        }
    }

    /// The record of a trial.
    ///
    /// # Errors
    /// If the file of records cannot be read any more, or was changed.
    pub fn record(&self, place: TextPlace) -> Result<Record<D>> {
        match self {
            Self::Stored(texts) => {
                let line = texts.log.line_from(place.start())?;
                texts.log.record(&line)
            }
            Self::Unpacked { texts, .. } => texts.record(place),
            Self::Shards(parts) => match parts.get(place.log()) {
                Some(part) => part.record(place),
                None => Err(Error::data("records", format_args!("there is no part {}", place.log()))),
            },
            Self::InMemory(texts) => {
                let record = texts.records.get(place.start() as usize);
                record.cloned().ok_or_else(|| {
                    let problem = format_args!("there is none at {}", place.start());
                    Error::data("records", problem)
                })
            }
        }
    }

    /// The text of a reply, or of the refusal, or else the message of the error.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    pub fn text(&self, place: TextPlace) -> Result<String> {
        let record = self.record(place)?;
        Ok(record.text_or_error().unwrap_or_default().to_owned())
    }

    /// Adds the `wanted` questions that are not in `found` yet, with their evidence.
    ///
    /// # Errors
    /// If the questions of the run cannot be read.
    pub fn questions(&self, wanted: &HashSet<&QuestionId>, found: &mut HashMap<QuestionId, RunQuestion>) -> Result<()> {
        let mut add = |question: RunQuestion| {
            if wanted.contains(&question.id) {
                found.entry(question.id.clone()).or_insert(question);
            }
        };
        match self {
            Self::Stored(texts) => each_question(&texts.folder, add),
            Self::Unpacked { texts, .. } => texts.questions(wanted, found),
            Self::Shards(parts) => parts.iter().try_for_each(|part| part.questions(wanted, found)),
            Self::InMemory(texts) => {
                texts.questions.iter().cloned().for_each(&mut add);
                Ok(())
            }
        }
    }
}
