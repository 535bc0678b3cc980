//! More sessions of one enhancer, which work at the same time: [`Enhancer::twin`].

use std::num::NonZeroUsize;

use super::{Enhancer, SizeLog};
use crate::files::ModelFile;
use crate::graphs::LoadLimits;
use crate::limits::memory;
use darkqa_ground::error::{Error, Result};

impl Enhancer {
    /// The same enhancer in a session and on a thread of its own. It knows what this one has learned, and shares its note. `number`
    /// tells the twins apart.
    ///
    /// # Errors
    /// If the model's file was changed, or its session cannot be opened.
    pub fn twin(&self, number: usize, threads: NonZeroUsize) -> Result<Self> {
        let file = ModelFile::read(&self.named)?;
        if file.digest() != self.digest {
            return Err(Error::Enhancer {
                path: self.path.clone(),
                problem: "was changed during the run; restore it, or start a new run".to_owned(),
            });
        }
        let runtime = self.graph.runtime().beside()?;
        let limits = LoadLimits {
            time: self.graph.time_limit(),
            memory: self.graph.memory_limit(),
        };
        let mut twin = Self::open_within(file, &runtime, Some(threads), limits)?;
        twin.graph = twin
            .graph
            .with_convention(self.convention().clone())
            .map_err(|problem| self.fault(problem))?;
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

/// Number of sets of enhancers that can work at the same time: at most `cores`, and at most the number that fits in free memory. The memory
/// of one set is estimated as that of the process after the first image of each enhancer.
pub fn sets_in_memory(cores: usize) -> usize {
    match (memory::resident(), memory::available()) {
        (Some(resident), Some(available)) => {
            let more = available / resident.max(1);
            cores.min(1 + usize::try_from(more).unwrap_or(cores))
        }
        // Where nothing is known of memory, one set is as much as was tried.
        _ => 1,
    }
}
