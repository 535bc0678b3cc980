//! The batch system that started this process: [`BatchSystem`].

use crate::error::Result;
use crate::runs::slurm_array::{ArrayTask, read_number};

/// The batch system that started this process, with the place of the process in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BatchSystem {
    /// A task of a job array.
    Slurm(ArrayTask),
    /// A pod of an indexed job: its index, from 0. No variable has the number of pods.
    Kubernetes { index: u32 },
}

impl BatchSystem {
    /// Reads the environment variables of the batch systems; `None` outside a batch system.
    ///
    /// # Errors
    /// If a variable is not a number.
    pub(crate) fn from_environment(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Self>> {
        if let Some(task) = ArrayTask::from_environment(variable)? {
            return Ok(Some(Self::Slurm(task)));
        }
        let index = read_number(variable, "JOB_COMPLETION_INDEX")?;
        Ok(index.map(|index| Self::Kubernetes { index }))
    }
}
