//! A row of the table of records: [`Row`], and what differs between experiments: [`Tabled`].

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::error::Result;
use crate::store::Column;
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{
    Condition, ConditionColumns, Digest, QuestionId, Record, RunQuestion, Severity,
};
use darkqa_score::answers::record::Detail;

/// The detail of a record that has a table of its own.
pub(super) trait Tabled: Detail + Sync + 'static {
    /// The name of the table with its version. New columns stand at the end of the same version.
    const TABLE: &'static str;

    /// Data of the whole run, read before its rows are written.
    type Context: Send + Sync;

    /// Data of a row besides its record.
    type Further: Send + Sync;

    /// The columns, in order.
    fn columns() -> Vec<Column<Row<Self>>>;

    /// Reads what rows need of the whole run.
    ///
    /// # Errors
    /// If a record is broken.
    fn context(
        folder: &Path,
        manifest: &RunManifest,
        questions: &[RunQuestion],
    ) -> Result<Self::Context>;

    /// The data of a record's row besides it; `None` if the record has no row.
    fn further(context: &Self::Context, record: &Record<Self>) -> Option<Self::Further>;

    /// The name of the frame or the walk that the question is about.
    fn frame(&self) -> &str;

    /// The family or the category of the question.
    fn family(&self) -> &str;

    /// The first image that was sent.
    fn image(&self) -> Option<SentImage<'_>>;
}

/// The image of a record, as it was sent.
pub(super) struct SentImage<'a> {
    pub(super) digest: &'a Digest,
    pub(super) bytes: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) format: &'a str,
}

/// A record, with what its columns need of the run.
pub(super) struct Row<D: Tabled> {
    pub(super) record: Record<D>,
    pub(super) light: Arc<LightTexts>,
    /// `None` if the run does not have the question.
    pub(super) question: Option<Arc<QuestionTexts>>,
    pub(super) further: D::Further,
}

/// The columns that follow from a condition, as texts and numbers.
pub(super) struct LightTexts {
    pub(super) condition: Option<String>,
    pub(super) level: Option<String>,
    pub(super) variant: String,
    pub(super) ev: Option<f64>,
    pub(super) severity: Option<f64>,
    pub(super) reading: Option<String>,
    pub(super) enhancer: Option<String>,
}

impl LightTexts {
    fn new(condition: Option<&Condition>) -> Self {
        let columns = ConditionColumns::new(condition);
        Self {
            condition: columns.condition.map(ToString::to_string),
            level: columns.level.map(|level| level.to_string()),
            variant: columns.variant,
            ev: columns.ev,
            severity: columns.severity.map(Severity::value),
            reading: columns.reading.map(ToString::to_string),
            enhancer: columns.enhancer.map(ToString::to_string),
        }
    }
}

/// The columns that a row takes from its question.
pub(super) struct QuestionTexts {
    /// `None` if the data name no scenes.
    pub(super) scene: Option<String>,
    /// `None` if nobody knows the true answer.
    pub(super) answer: Option<String>,
}

/// Makes the rows of a run's records.
pub(super) struct Rows<D: Tabled> {
    names: RecordedNames,
    lights: HashMap<Option<Condition>, Arc<LightTexts>>,
    questions: HashMap<QuestionId, Arc<QuestionTexts>>,
    context: D::Context,
}

impl<D: Tabled> Rows<D> {
    /// Rows of the run in a folder.
    ///
    /// # Errors
    /// If a record is broken.
    pub(super) fn new(
        folder: &Path,
        manifest: &RunManifest,
        questions: &[RunQuestion],
    ) -> Result<Self> {
        let texts = questions.iter().map(|question| {
            let texts = QuestionTexts {
                scene: Some(question.scene.clone()).filter(|scene| !scene.is_empty()),
                answer: question.answer.clone(),
            };
            (question.id.clone(), Arc::new(texts))
        });
        Ok(Self {
            names: RecordedNames::from_manifest(manifest),
            lights: HashMap::new(),
            questions: texts.collect(),
            context: D::context(folder, manifest, questions)?,
        })
    }

    /// The row of a record; `None` if it has none.
    pub(super) fn row(&mut self, mut record: Record<D>) -> Option<Row<D>> {
        let shown = self.names.shown(&record.model);
        if shown != record.model {
            record.model = shown.to_owned();
        }
        let further = D::further(&self.context, &record)?;
        let known = self.lights.get(&record.condition).map(Arc::clone);
        let light = known.unwrap_or_else(|| {
            let light = Arc::new(LightTexts::new(record.condition.as_ref()));
            let condition = record.condition.clone();
            self.lights.insert(condition, Arc::clone(&light));
            light
        });
        Some(Row {
            question: self.questions.get(&record.question).map(Arc::clone),
            light,
            further,
            record,
        })
    }
}
