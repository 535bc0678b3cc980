//! The first frames over the levels, as small pictures: [`samples`].

use std::collections::BTreeSet;

use serde::Serialize;

use crate::report::subject::light;
use crate::types::{Condition, EnhancerName, FrameId, Level, Thumbnail, Variant};

#[derive(Serialize)]
pub(super) struct Samples {
    levels: Vec<String>,
    rows: Vec<SampleRow>,
}

#[derive(Serialize)]
struct SampleRow {
    name: String,
    images: Vec<Option<Image>>,
}

#[derive(Serialize)]
struct Image {
    url: String,
    alt: String,
}

/// How many frames are shown as samples.
const SAMPLES: usize = 3;

/// The first frames over the levels: exposure drop, noise, and each enhancer.
pub(super) fn samples(thumbnails: &[Thumbnail]) -> Option<Samples> {
    let mut frames: Vec<&FrameId> = thumbnails
        .iter()
        .map(|thumbnail| &thumbnail.frame)
        .collect();
    frames.sort_unstable();
    frames.dedup();
    let level = |thumbnail: &Thumbnail| thumbnail.condition.degradation.level();
    let levels: BTreeSet<Level> = thumbnails.iter().map(level).collect();
    let lines: BTreeSet<(Variant, Option<&EnhancerName>)> = thumbnails
        .iter()
        .map(|t| {
            (
                t.condition.degradation.variant(),
                t.condition.enhancer.as_ref(),
            )
        })
        .filter(|(variant, _)| *variant != Variant::None)
        .collect();
    let lines = if lines.is_empty() {
        BTreeSet::from([(Variant::None, None)])
    } else {
        lines
    };
    let mut rows = Vec::new();
    for frame in frames.into_iter().take(SAMPLES) {
        for (variant, enhancer) in &lines {
            let of = |condition: &Condition, at: Level| {
                let degradation = condition.degradation;
                degradation.level() == at
                    && (degradation.variant() == *variant
                        && condition.enhancer.as_ref() == *enhancer
                        || at == Level::L0 && enhancer.is_none())
            };
            let images = levels.iter().map(|at| {
                let mut here = thumbnails
                    .iter()
                    .filter(|thumbnail| thumbnail.frame == *frame);
                let found = here.find(|thumbnail| of(&thumbnail.condition, *at))?;
                Some(Image {
                    url: found.small.clone(),
                    alt: format!("{} at {}", frame, found.condition),
                })
            });
            rows.push(SampleRow {
                name: format!("{frame}, {}", light(*variant, *enhancer)),
                images: images.collect(),
            });
        }
    }
    let named = levels
        .iter()
        .map(|level| format!("{level}, {} EV", level.exposure_drop().0));
    (!rows.is_empty()).then(|| Samples {
        levels: named.collect(),
        rows,
    })
}
