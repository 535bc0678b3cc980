//! Questions for data that have none: made by rule, with the rulebook of `--rules` and the built-in balance.

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::images::progress::Progress;
use crate::types::{Digest, Family, FrameId, Question};
use darkqa_questions::balance::BalanceMode;
use darkqa_questions::colors::Palette;
use darkqa_questions::room::RoomSource;
use darkqa_questions::rules::Rules;
use darkqa_questions::statistics::{FrameStatistics, measure};
use darkqa_questions::{QuestionRequest, generate};

/// The questions that the command `questions` makes with these rules, and no other flag.
///
/// # Errors
/// If a frame cannot be measured, or the rules ask nothing.
pub(crate) fn by_rule(
    dataset: &Dataset,
    rules: &Rules,
    progress: &Progress,
) -> Result<Vec<Question>> {
    let labels = dataset.labels().ok_or_else(|| {
        Error::data(
            dataset.name(),
            "no questions, and no classes to make them of",
        )
    })?;
    let palette = Palette::built_in()?;
    let names: Vec<&FrameId> = dataset.frames().collect();
    let bar = progress.bar("making questions", names.len());
    let frames: Vec<FrameStatistics> = names
        .par_iter()
        .map(|name| {
            let frame = dataset.frame(name)?;
            let key = Digest::from_bytes(name.0.as_bytes());
            let statistics = measure(&frame, labels, rules, &palette, key);
            bar.inc();
            statistics
        })
        .collect::<Result<_>>()?;
    drop(bar);
    let request = QuestionRequest {
        dataset: dataset.title(),
        labels,
        rules,
        palette: &palette,
        families: Family::PAPER.into_iter().collect(),
        room_source: RoomSource::default(),
        balance: BalanceMode::default(),
        rejected: BTreeSet::new(),
    };
    let generated = generate(&frames, &request, |_, _| {})?;
    if generated.asked.is_empty() {
        return Err(Error::data(
            dataset.name(),
            "the rules ask nothing about these frames; `darkqa-eval questions DATA --out FILE --candidates FILE` shows why",
        ));
    }
    Ok(generated
        .asked
        .into_iter()
        .map(|asked| asked.question)
        .collect())
}
