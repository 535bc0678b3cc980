//! Batches: the files of a Batch API, and batches that the program submits.

mod batch;
mod batch_run;
