//! A row of the table of records ([`Row`]), and the interface to the columns of an experiment ([`TableDetail`]).

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::error::Result;
use crate::runs::renamed::rename_record;
use crate::store::Column;
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{Condition, ConditionColumns, Digest, QuestionId, Record, RunQuestion, Severity};
use darkqa_score::answers::record::Detail;

/// Record detail of an experiment with a table of records.
pub(super) trait TableDetail: Detail + Sync + 'static {
    /// Name of the table with its version. New columns are appended without a new version.
    const TABLE: &'static str;

    /// Data of the whole run, read before its rows are written.
    type Context: Send + Sync;

    /// Data of a row in addition to its record.
    type Extra: Send + Sync;

    /// The columns, in order.
    fn columns() -> Vec<Column<Row<Self>>>;

    /// Reads the data of the whole run that rows need.
    ///
    /// # Errors
    /// If a record is broken.
    fn context(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Self::Context>;

    /// The additional data of a record's row; `None` if the record has no row.
    fn extra(context: &Self::Context, record: &Record<Self>) -> Option<Self::Extra>;

    /// Name of the frame or walk of the question.
    fn frame(&self) -> &str;

    /// Family or category of the question.
    fn family(&self) -> &str;

    /// The first image sent.
    fn image(&self) -> Option<SentImage<'_>>;
}

/// The image of a record as sent.
pub(super) struct SentImage<'a> {
    pub(super) digest: &'a Digest,
    pub(super) bytes: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) format: &'a str,
}

/// A record with the data of the run that its columns need.
pub(super) struct Row<D: TableDetail> {
    pub(super) record: Record<D>,
    pub(super) condition: Arc<ConditionCells>,
    /// `None` if the run does not have the question.
    pub(super) question: Option<Arc<QuestionCells>>,
    pub(super) extra: D::Extra,
}

/// Values of the columns about a condition.
pub(super) struct ConditionCells {
    pub(super) condition: Option<String>,
    pub(super) level: Option<String>,
    pub(super) variant: String,
    pub(super) ev: Option<f64>,
    pub(super) severity: Option<f64>,
    pub(super) profile: Option<String>,
    pub(super) enhancer: Option<String>,
}

impl ConditionCells {
    fn new(condition: Option<&Condition>) -> Self {
        let columns = ConditionColumns::new(condition);
        Self {
            condition: columns.condition.map(ToString::to_string),
            level: columns.level.map(|level| level.to_string()),
            variant: columns.variant,
            ev: columns.ev,
            severity: columns.severity.map(Severity::value),
            profile: columns.reading.map(ToString::to_string),
            enhancer: columns.enhancer.map(ToString::to_string),
        }
    }
}

/// Values of the columns about a question.
pub(super) struct QuestionCells {
    /// `None` if the data set has no scenes.
    pub(super) scene: Option<String>,
    /// `None` if the true answer is unknown.
    pub(super) answer: Option<String>,
}

/// Makes the rows of a run's records.
pub(super) struct Rows<D: TableDetail> {
    names: RecordedNames,
    conditions: HashMap<Option<Condition>, Arc<ConditionCells>>,
    questions: HashMap<QuestionId, Arc<QuestionCells>>,
    context: D::Context,
}

impl<D: TableDetail> Rows<D> {
    /// Reads the data that the rows of a run need.
    ///
    /// # Errors
    /// If a record is broken.
    pub(super) fn new(folder: &Path, manifest: &RunManifest, questions: &[RunQuestion]) -> Result<Self> {
        let questions_by_id = questions
            .iter()
            .map(|question| {
                let cells = QuestionCells {
                    scene: Some(question.scene.clone()).filter(|scene| !scene.is_empty()),
                    answer: question.answer.clone(),
                };
                (question.id.clone(), Arc::new(cells))
            })
            .collect();
        Ok(Self {
            names: RecordedNames::from_manifest(manifest),
            conditions: HashMap::new(),
            questions: questions_by_id,
            context: D::context(folder, manifest, questions)?,
        })
    }

    /// The row of a record; `None` if it has none.
    pub(super) fn row(&mut self, mut record: Record<D>) -> Option<Row<D>> {
        rename_record(&mut record, &self.names);
        let extra = D::extra(&self.context, &record)?;
        let condition = if let Some(known) = self.conditions.get(&record.condition) {
            Arc::clone(known)
        } else {
            let cells = Arc::new(ConditionCells::new(record.condition.as_ref()));
            self.conditions.insert(record.condition.clone(), Arc::clone(&cells));
            cells
        };
        Some(Row { question: self.questions.get(&record.question).map(Arc::clone), condition, extra, record })
    }
}
