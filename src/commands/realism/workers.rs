//! Threads that process the pairs: [`PairWorkers`].

use rayon::ThreadPool;
use rayon::prelude::*;

use crate::engine::images::progress::Progress;

/// Threads that process the pairs, with a progress bar.
pub(super) struct PairWorkers<'a> {
    pub pool: ThreadPool,
    pub progress: &'a Progress,
}

impl PairWorkers<'_> {
    /// Applies `work` to each item and its index, and returns the results in order. `what` is the name of the items in
    /// the progress bar.
    pub(super) fn map<I: Sync, T: Send>(
        &self,
        what: &'static str,
        items: &[I],
        work: impl Fn(usize, &I) -> T + Sync,
    ) -> Vec<T> {
        let bar = self.progress.bar(what, items.len());
        self.pool.install(|| {
            items
                .par_iter()
                .enumerate()
                .map(|(index, item)| {
                    let result = work(index, item);
                    bar.inc();
                    result
                })
                .collect()
        })
    }
}
