//! The questions of parts, each once, by the places of their lines: [`PartQuestions`].

use std::path::Path;

use crate::error::Result;
use crate::store::{LinePlace, QuestionFile, Store, each_placed_question};
use crate::types::{FrameId, QuestionId, RunQuestion};
use darkqa_score::answers::record::Detail;

/// The questions of several parts in the order of the data, each once.
pub(crate) struct PartQuestions(Vec<PartQuestion>);

/// A question of a part.
struct PartQuestion {
    /// The question without its evidence.
    question: RunQuestion,
    part: usize,
    line: LinePlace,
}

impl PartQuestions {
    /// Reads the questions of these folders.
    ///
    /// # Errors
    /// If a line is not a question.
    pub(crate) fn read(folders: &[&Path]) -> Result<Self> {
        let mut questions = Vec::new();
        for (part, folder) in folders.iter().enumerate() {
            each_placed_question(folder, |question, line| {
                questions.push(PartQuestion {
                    question: question.without_evidence(),
                    part,
                    line,
                });
            })?;
        }
        questions.sort_by_key(|question| question.question.place);
        // A control of the observer asks a question of one shard with an image of another.
        questions.dedup_by(|later, question| later.question.id == question.question.id);
        Ok(Self(questions))
    }

    /// Their names, in order.
    pub(crate) fn ids(&self) -> impl Iterator<Item = &QuestionId> {
        self.0.iter().map(|question| &question.question.id)
    }

    /// Their frames, in order.
    pub(crate) fn frames(&self) -> impl Iterator<Item = &FrameId> {
        self.0.iter().map(|question| &question.question.frame)
    }

    /// The questions without their evidence, in order.
    pub(crate) fn into_questions(self) -> Vec<RunQuestion> {
        self.0
            .into_iter()
            .map(|question| question.question)
            .collect()
    }

    /// Copies their lines into a run.
    ///
    /// # Errors
    /// If a line cannot be read or written.
    pub(crate) fn write<D: Detail>(&self, store: &Store<D>, folders: &[&Path]) -> Result<()> {
        let files: Vec<Option<QuestionFile>> = folders
            .iter()
            .map(|folder| QuestionFile::open(folder))
            .collect::<Result<_>>()?;
        store.write_question_lines(|out| {
            for question in &self.0 {
                if let Some(file) = &files[question.part] {
                    out(&file.line(question.line)?)?;
                }
            }
            Ok(())
        })
    }
}
