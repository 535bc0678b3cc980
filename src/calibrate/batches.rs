//! Work on many frames of which few are in memory at once: [`in_batches`].

use rayon::prelude::*;

use crate::error::Result;

/// Memory for frames that are read at once, in bytes (chosen). A frame of 24 megapixels takes 0.14 GB while it is read.
const MEMORY: usize = 1 << 30;

/// Does the work on each item on all threads, and takes the results in the order of the items. `bytes` is the memory that the
/// work on one item takes; at least one item is worked on.
///
/// # Errors
/// The error of the first item that fails, whatever the threads.
pub(super) fn in_batches<T: Sync, R: Send>(
    items: &[T],
    bytes: usize,
    work: impl Fn(&T) -> Result<R> + Sync,
    mut take: impl FnMut(&T, R) -> Result<()>,
) -> Result<()> {
    let at_once = (MEMORY / bytes.max(1)).clamp(1, 2 * rayon::current_num_threads());
    for batch in items.chunks(at_once) {
        let results: Vec<Result<R>> = batch.par_iter().map(&work).collect();
        for (item, result) in batch.iter().zip(results) {
            take(item, result?)?;
        }
    }
    Ok(())
}
