//! Parallel processing of many frames with bounded memory: [`in_batches`].

use rayon::prelude::*;

use crate::error::Result;

/// Memory limit for the frames in memory, in bytes (chosen). Reading a frame of 24 megapixels takes 0.14 GB.
const MEMORY: usize = 1 << 30;

/// Calls `work` for the items on all threads, and `take` with the results in the order of the items. `bytes` is the
/// memory for one item; at least one item is processed at a time.
///
/// # Errors
/// The error of the first item that fails, in the order of the items.
pub(super) fn in_batches<T: Sync, R: Send>(
    items: &[T],
    bytes: usize,
    work: impl Fn(&T) -> Result<R> + Sync,
    mut take: impl FnMut(&T, R) -> Result<()>,
) -> Result<()> {
    let batch_size = (MEMORY / bytes.max(1)).clamp(1, 2 * rayon::current_num_threads());
    for batch in items.chunks(batch_size) {
        let results: Vec<Result<R>> = batch.par_iter().map(&work).collect();
        for (item, result) in batch.iter().zip(results) {
            take(item, result?)?;
        }
    }
    Ok(())
}
