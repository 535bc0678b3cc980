//! What `study` is told.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::Show;
use super::show::Again;
use crate::cli::{StudyPackArgs, StudyReadArgs};
use crate::error::{Error, Result};
use crate::types::Condition;

/// What people are called where nothing else is said.
const NAME: &str = "human";

/// Everything `study pack` is told.
#[derive(Debug)]
pub struct StudyPack {
    /// The run folder.
    pub run: PathBuf,
    /// Where the page goes.
    pub out: PathBuf,
    /// The most questions; `None` for all.
    pub items: Option<NonZeroUsize>,
    /// The conditions; empty for all.
    pub conditions: Vec<Condition>,
    /// What is said here of the data and the enhancers.
    pub again: Again,
}

impl StudyPack {
    /// Checks what was said.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: StudyPackArgs) -> Result<Self> {
        Ok(Self {
            run: said.run,
            out: said.out,
            items: said.items,
            conditions: super::show::conditions(&said.condition)?,
            again: Again::said(said.again),
        })
    }
}

/// Everything `study read` is told.
#[derive(Debug)]
pub struct StudyRead {
    /// The run folder.
    pub run: PathBuf,
    /// The files of answers.
    pub files: Vec<PathBuf>,
    /// The folder of the people's run.
    pub out: PathBuf,
    /// What they are called.
    pub name: String,
    /// In what form on standard output.
    pub show: Show,
}

impl StudyRead {
    /// Checks what was said.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: StudyReadArgs) -> Result<Self> {
        let name = said.name.unwrap_or_else(|| NAME.to_owned());
        if name.trim().is_empty() {
            return Err(Error::usage("--name", "the name is empty"));
        }
        Ok(Self {
            run: said.run,
            files: said.files,
            out: said.out,
            name,
            show: Show::said(said.json),
        })
    }
}
