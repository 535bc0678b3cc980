//! The distinct questions of shards, with the places of their lines: [`ShardQuestions`].

use std::path::Path;

use crate::error::Result;
use crate::store::{LinePlace, QuestionFile, Store, each_placed_question};
use crate::types::{FrameId, QuestionId, RunQuestion};
use darkqa_score::answers::record::Detail;

/// The distinct questions of several shards, in the order of the data.
pub(crate) struct ShardQuestions(Vec<ShardQuestion>);

/// A question of a shard.
struct ShardQuestion {
    /// The question without its evidence.
    question: RunQuestion,
    /// Index of the shard's folder.
    folder: usize,
    line: LinePlace,
}

impl ShardQuestions {
    /// Reads the questions of these folders.
    ///
    /// # Errors
    /// If a line is not a question.
    pub(crate) fn read(folders: &[&Path]) -> Result<Self> {
        let mut questions = Vec::new();
        for (index, folder) in folders.iter().enumerate() {
            each_placed_question(folder, |question, line| {
                questions.push(ShardQuestion { question: question.without_evidence(), folder: index, line });
            })?;
        }
        questions.sort_by_key(|question| question.question.place);
        // A control of the observer asks a question of one shard with an image of another.
        questions.dedup_by(|later, question| later.question.id == question.question.id);
        Ok(Self(questions))
    }

    /// Names of the questions, in order.
    pub(crate) fn ids(&self) -> impl Iterator<Item = &QuestionId> {
        self.0.iter().map(|question| &question.question.id)
    }

    /// Frames of the questions, in order.
    pub(crate) fn frames(&self) -> impl Iterator<Item = &FrameId> {
        self.0.iter().map(|question| &question.question.frame)
    }

    /// The questions without their evidence, in order.
    pub(crate) fn into_questions(self) -> Vec<RunQuestion> {
        self.0.into_iter().map(|question| question.question).collect()
    }

    /// Copies the lines of the questions into a run.
    ///
    /// # Errors
    /// If a line cannot be read or written.
    pub(crate) fn write<D: Detail>(&self, store: &Store<D>, folders: &[&Path]) -> Result<()> {
        let files: Vec<Option<QuestionFile>> =
            folders.iter().map(|folder| QuestionFile::open(folder)).collect::<Result<_>>()?;
        store.write_question_lines(|out| {
            for question in &self.0 {
                if let Some(file) = &files[question.folder] {
                    out(&file.line(question.line)?)?;
                }
            }
            Ok(())
        })
    }
}
