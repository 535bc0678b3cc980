//! Copies of an enhancer that run in parallel: [`Enhancer::twin`].

use std::num::NonZeroUsize;

use super::{Enhancer, SizeLog};
use crate::files::ModelFile;
use crate::graphs::LoadLimits;
use crate::limits::memory;
use darkqa_base::error::{Error, Result};

impl Enhancer {
    /// A copy of this enhancer with its own session and thread. It starts with the sizes, context and memory cost
    /// measured so far, and shares the usage record, in which `number` identifies the twin.
    ///
    /// # Errors
    /// If the model's file has changed, or its session cannot be opened.
    pub fn twin(&self, number: usize, threads: NonZeroUsize) -> Result<Self> {
        let file = ModelFile::read(&self.argument)?;
        if file.digest() != self.digest {
            return Err(Error::Enhancer {
                path: self.path.clone(),
                problem: "was changed during the run; restore it, or start a new run".to_owned(),
            });
        }
        let runtime = self.graph.runtime().with_new_thread()?;
        let limits = LoadLimits { time: self.graph.time_limit(), memory: self.graph.memory_limit() };
        let mut twin = Self::open_within(file, &runtime, Some(threads), limits)?;
        twin.graph = twin.graph.with_convention(self.convention().clone()).map_err(|problem| self.error(problem))?;
        Ok(Self {
            tiling: self.tiling,
            fitting: self.fitting,
            max_side: self.max_side,
            search: self.search.clone(),
            refused: self.refused.clone(),
            context: self.context.clone(),
            memory: self.memory.clone(),
            log: SizeLog::default(),
            usage: self.usage.clone(),
            twin: number,
            ..twin
        })
    }
}

/// Number of sets of enhancers that can run in parallel: at most `cores`, and as many as fit into the free memory. The
/// memory of one set is estimated as the resident memory of the process, to be measured after the first image of each
/// enhancer.
pub fn sets_in_memory(cores: usize) -> usize {
    match (memory::resident(), memory::available()) {
        (Some(resident), Some(available)) => {
            let more = available / resident.max(1);
            cores.min(1 + usize::try_from(more).unwrap_or(cores))
        }
        // Without figures about memory, only one set is known to fit.
        _ => 1,
    }
}
