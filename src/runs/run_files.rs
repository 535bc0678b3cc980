//! Files of a run folder other than its records: [`RunFiles`].

use std::path::Path;

use crate::error::Result;
use crate::store;
use crate::types::{ImageFidelity, RunQuestion, Thumbnail};

/// Contents of the files of a run folder other than its records.
pub(crate) struct RunFiles {
    pub(crate) questions: Vec<RunQuestion>,
    pub(crate) thumbnails: Vec<Thumbnail>,
    pub(crate) fidelity: Vec<ImageFidelity>,
}

impl RunFiles {
    /// Reads the files of a run folder, without the evidence of questions.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub(crate) fn read_without_evidence(folder: &Path) -> Result<Self> {
        let mut questions = Vec::new();
        store::each_question(folder, |question| {
            questions.push(question.without_evidence());
        })?;
        Ok(Self { questions, thumbnails: store::read_thumbnails(folder), fidelity: store::read_fidelity(folder) })
    }

    /// Reads the files of a run folder.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        Ok(Self {
            questions: store::read_questions(folder)?,
            thumbnails: store::read_thumbnails(folder),
            fidelity: store::read_fidelity(folder),
        })
    }
}
