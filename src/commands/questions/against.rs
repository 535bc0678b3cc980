//! `questions --against`: compares the look of the frames with that of another set.

use rayon::prelude::*;

use crate::data::Dataset;
use crate::engine::images::frames::InputTally;
use crate::engine::images::progress::Progress;
use crate::engine::images::workers::{ThreadArgs, pool};
use crate::error::{Error, Result};
use crate::report::questions::against::AppearanceComparison;
use crate::types::FrameId;
use darkqa_questions::appearance::FrameAppearance;
use darkqa_questions::colors::Palette;

/// Compares the frames of two sets.
///
/// # Errors
/// If a set has no images, or an image cannot be read: leaving it out would bias the comparison.
pub(super) fn compare(
    sets: [&Dataset; 2],
    palette: &Palette,
    threads: ThreadArgs,
    progress: &Progress,
) -> Result<AppearanceComparison> {
    let looks = |set: &Dataset| {
        let found = looks(set, palette, threads, progress)?;
        if found.is_empty() {
            return Err(Error::data(set.name(), "no images to compare"));
        }
        Ok(found)
    };
    let [own, others] = [looks(sets[0])?, looks(sets[1])?];
    Ok(AppearanceComparison::new([(sets[0].name(), &own), (sets[1].name(), &others)]))
}

/// The look of each frame.
fn looks(
    dataset: &Dataset,
    palette: &Palette,
    threads: ThreadArgs,
    progress: &Progress,
) -> Result<Vec<FrameAppearance>> {
    let names: Vec<&FrameId> = dataset.frames().collect();
    let tally = InputTally::default();
    let bar = progress.bar("looks", names.len());
    let looks = pool(threads.threads)?.install(|| {
        names
            .par_iter()
            .map(|name| {
                let files = dataset.files(name)?;
                tally.add(name, &files.note());
                let look = FrameAppearance::new(&files.decode()?, palette);
                bar.inc();
                Ok(look)
            })
            .collect::<Result<Vec<FrameAppearance>>>()
    });
    drop(bar);
    tally.warn();
    looks
}
