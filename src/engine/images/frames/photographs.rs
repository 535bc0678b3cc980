//! Photographs in the dark of all frames: their [`names`], and how dark they are ([`print_darkness`], [`measure`]).

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::source::{SourcePhotograph, matching_degradation};
use crate::images::frames::source::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{PairDark, PairFacts, PhotoName};
use darkqa_score::photographs::PairDarkness;
use darkqa_score::photographs::realism::SceneMatch;

/// Maximum number of frames whose photographs are measured before a run; chosen.
const SAMPLED: usize = 24;

/// The names of the photographs of all frames, ordered by their lowest position in the lists of the frames.
pub fn names(sources: &[Source]) -> Vec<PhotoName> {
    let frames = sources.iter().flat_map(|source| &source.frames);
    let mut positions = BTreeMap::<&PhotoName, usize>::new();
    for (position, photo) in frames.flat_map(|frame| frame.photographs.iter().enumerate()) {
        let lowest = positions.entry(&photo.name).or_insert(position);
        *lowest = position.min(*lowest);
    }
    let mut names: Vec<(usize, &PhotoName)> = positions.into_iter().map(|(name, position)| (position, name)).collect();
    names.sort_unstable();
    names.into_iter().map(|(_, name)| name.clone()).collect()
}

/// Measures the photographs of a sample of the frames and prints how dark they are. Warns if frames have no photograph,
/// if a photograph shows another scene, and of the findings of [`PairDarkness::warnings`]. Broken files are skipped;
/// their trials report the error.
pub fn print_darkness(frames: &dyn Frames, sources: &[Source], progress: &Progress) {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    for name in names(sources) {
        let pairs: Vec<(&SourceFrame, &SourcePhotograph)> =
            all.iter().filter_map(|frame| Some((*frame, frame.photograph(&name)?))).collect();
        let sample = pairs.len().min(SAMPLED);
        let (facts, others): (Vec<PairFacts>, Vec<Option<String>>) = (0..sample)
            .into_par_iter()
            .filter_map(|index| {
                let (frame, photo) = pairs[index * pairs.len() / sample];
                let normal = frames.picture(&frame.id).ok()?.pixels().ok()?.codes();
                let low = frames.photograph(&frame.id, &photo.name).ok()?;
                let low = low.pixels().ok()?.codes();
                let facts = photo.measure(&normal, &low);
                let has_same_size = (normal.height(), normal.width()) == (low.height(), low.width());
                let shows_other_scene = facts
                    .ev()
                    .filter(|_| has_same_size)
                    .is_some_and(|ev| SceneMatch::new(&normal, &low, ev).is_of_two_scenes());
                Some((facts, shows_other_scene.then(|| frame.id.0.clone())))
            })
            .unzip();
        let others: Vec<String> = others.into_iter().flatten().collect();
        let missing = all.len() - pairs.len();
        if missing > 0 {
            tracing::warn!(
                "{missing} of {} frames have no photograph {name}; they are not asked in that condition",
                all.len()
            );
        }
        if let Some(first) = others.first() {
            tracing::warn!(
                "{} of {sample} photographs {name} seem to show another scene than their frame, first that of {first}",
                others.len()
            );
        }
        let Some(darkness) = PairDarkness::new(&name, &facts) else {
            tracing::warn!("how dark the photographs {name} are is not known: they, or their frames, are black");
            continue;
        };
        progress.print_on_terminal(&format!(
            "{name}: {}, in {} of {} photographs",
            darkness.long(),
            darkness.frames,
            pairs.len()
        ));
        for oddity in darkness.warnings() {
            tracing::warn!("{oddity}");
        }
    }
}

/// Warns if some frames cannot be made as dark as their photographs.
///
/// # Errors
/// If no frame can.
pub fn check_matches(sources: &[Source], matches: &[PairDark]) -> Result<()> {
    let Some(PairDark::Match(kind, reading)) = matches.first() else {
        return Ok(());
    };
    let frames: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let count = frames
        .iter()
        .filter(|frame| matching_degradation(&frame.photographs, *kind, reading.as_ref()).is_some())
        .count();
    if count == 0 && !frames.is_empty() {
        let problem = "match makes each frame as dark as its photograph, and no frame has one that is darker than it; leave out match, \
                       or name photographs as \"dark\" in frames.jsonl or with --pairs";
        return Err(Error::usage("--levels", problem));
    }
    if count < frames.len() {
        tracing::warn!(
            "{} of {} frames have no photograph that is darker by a known drop; they are not asked at match",
            frames.len() - count,
            frames.len()
        );
    }
    Ok(())
}

/// Measures the first photograph of each frame, so that equally dark images can be synthesised. Each file is decoded
/// once more.
///
/// # Errors
/// If a file is broken.
pub fn measure(frames: &dyn Frames, sources: &mut [Source]) -> Result<()> {
    sources.par_iter_mut().try_for_each(|source| {
        for frame in &mut source.frames {
            if let Some(photo) = frame.photographs.first_mut() {
                let normal = frames.picture(&frame.id)?.pixels()?.codes();
                let low = frames.photograph(&frame.id, &photo.name)?;
                let low = low.pixels()?.codes();
                photo.facts = Some(photo.measure(&normal, &low));
            }
        }
        Ok(())
    })
}
