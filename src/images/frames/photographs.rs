//! All photographs in the dark, before anything is asked: their [`names`], and how dark they are ([`tell`], [`measure`]).

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::images::frames::photograph::{SourcePhotograph, matched};
use crate::images::frames::source::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use crate::types::{PairDark, PairFacts, PhotoName};
use darkqa_score::photographs::pair_darkness::PairDarkness;
use darkqa_score::photographs::realism::scene::SceneMatch;

/// Maximum number of frames whose photographs are measured before a run; chosen.
const SAMPLED: usize = 24;

/// The names of the photographs of all frames, by their place in the lists of the frames.
pub(crate) fn names(sources: &[Source]) -> Vec<PhotoName> {
    let frames = sources.iter().flat_map(|source| &source.frames);
    let mut places = BTreeMap::<&PhotoName, usize>::new();
    for (place, photo) in frames.flat_map(|frame| frame.photographs.iter().enumerate()) {
        let first = places.entry(&photo.name).or_insert(place);
        *first = place.min(*first);
    }
    let mut names: Vec<(usize, &PhotoName)> =
        places.into_iter().map(|(name, at)| (at, name)).collect();
    names.sort_unstable();
    names.into_iter().map(|(_, name)| name.clone()).collect()
}

/// Prints how dark the photographs are, on a sample of the frames, and what is odd about them: of how many frames there are none, which
/// show another scene, and what [`PairDarkness::warnings`] finds. A file that cannot be decoded is left out: its trial states so.
pub(crate) fn tell(frames: &dyn Frames, sources: &[Source], progress: &Progress) {
    let all: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    for name in names(sources) {
        let of: Vec<(&SourceFrame, &SourcePhotograph)> = all
            .iter()
            .filter_map(|frame| Some((*frame, frame.photograph(&name)?)))
            .collect();
        let sample = of.len().min(SAMPLED);
        let measured = (0..sample).into_par_iter().filter_map(|index| {
            let (frame, photo) = of[index * of.len() / sample];
            let normal = frames.picture(&frame.id).ok()?.pixels().ok()?.codes();
            let low = frames.photograph(&frame.id, &photo.name).ok()?;
            let low = low.pixels().ok()?.codes();
            let facts = photo.measured(&normal, &low);
            let is_of_one_size = (normal.height(), normal.width()) == (low.height(), low.width());
            let drop = facts.ev().filter(|_| is_of_one_size);
            let other =
                drop.is_some_and(|ev| SceneMatch::new(&normal, &low, ev).is_of_two_scenes());
            Some((facts, other.then(|| frame.id.0.clone())))
        });
        let (facts, others): (Vec<PairFacts>, Vec<Option<String>>) = measured.unzip();
        let others: Vec<String> = others.into_iter().flatten().collect();
        let missing = all.len() - of.len();
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
            tracing::warn!(
                "how dark the photographs {name} are is not known: they, or their frames, are black"
            );
            continue;
        };
        progress.say(&format!(
            "{name}: {}, in {} of {} photographs",
            darkness.long(),
            darkness.frames,
            of.len()
        ));
        for oddity in darkness.warnings() {
            tracing::warn!("{oddity}");
        }
    }
}

/// Warns of frames that cannot be made as dark as their photographs.
///
/// # Errors
/// If no frame can.
pub(crate) fn check_matches(sources: &[Source], matches: &[PairDark]) -> Result<()> {
    let Some(PairDark::Match(kind, reading)) = matches.first() else {
        return Ok(());
    };
    let frames: Vec<&SourceFrame> = sources.iter().flat_map(|source| &source.frames).collect();
    let can =
        |frame: &&&SourceFrame| matched(&frame.photographs, *kind, reading.as_ref()).is_some();
    let count = frames.iter().filter(can).count();
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

/// Measures the first photograph of each frame, for synthetic images that are as dark. Each file is decoded once more.
///
/// # Errors
/// If a file is broken.
pub(crate) fn measure(frames: &dyn Frames, sources: &mut [Source]) -> Result<()> {
    sources.par_iter_mut().try_for_each(|source| {
        for frame in &mut source.frames {
            if let Some(photo) = frame.photographs.first_mut() {
                let decode = |picture: Picture| Ok::<_, Error>(picture.pixels()?.codes());
                let normal = decode(frames.picture(&frame.id)?)?;
                let low = decode(frames.photograph(&frame.id, &photo.name)?)?;
                photo.facts = Some(photo.measured(&normal, &low));
            }
        }
        Ok(())
    })
}
