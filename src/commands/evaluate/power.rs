//! The effect that a planned evaluation can detect: [`power_forecast`].

use std::collections::{BTreeSet, HashMap};

use crate::data::Dataset;
use crate::runs::power_forecast::PowerForecast;
use crate::types::degradations::Kind;
use crate::types::{Condition, Digest, FrameId, Question, Variant};
use darkqa_score::cluster::{Clusters, FrameTies};
use darkqa_score::tested_sentences::RunContents;

/// The effect that these questions can detect; `None` without questions, or if a true answer is unknown. `digests` are
/// those of the frames, as far as they are known.
pub(super) fn power_forecast(
    dataset: &Dataset,
    questions: &[Question],
    digests: &HashMap<FrameId, Digest>,
    contents: RunContents,
) -> Option<PowerForecast> {
    if questions.iter().any(|question| question.choices.truth().is_none()) {
        return None;
    }
    let mut ties = FrameTies { digests: digests.clone(), ..FrameTies::default() };
    for question in questions {
        let frame = &question.frame;
        let (scene, several) = (dataset.scene(frame), dataset.image_series(frame));
        if !scene.is_empty() {
            ties.scenes.insert(frame.clone(), scene);
        }
        if !several.is_empty() {
            ties.images.insert(frame.clone(), several.to_vec());
        }
    }
    let pairs = questions.iter().map(|question| (&question.id, &question.frame));
    let clusters = Clusters::new(pairs, &ties);
    let question_clusters: Vec<u32> =
        questions.iter().filter_map(|question| clusters.get(&question.frame, &question.id)).collect();
    PowerForecast::new(&clusters, &question_clusters, contents)
}

/// The numbers of models, enhancers and lights of a run with these conditions.
pub(super) fn run_contents(conditions: &[Condition], models: usize) -> RunContents {
    let variants: BTreeSet<Variant> = conditions.iter().map(Condition::variant).collect();
    let last = variants.iter().filter_map(|variant| variant.kind).max();
    let lights = variants.iter().filter(|variant| variant.kind == last);
    let base = last.and_then(Kind::base);
    let enhancers: BTreeSet<_> = conditions.iter().filter_map(|condition| condition.enhancer.as_ref()).collect();
    RunContents {
        models: models.max(1),
        enhancers: enhancers.len(),
        lights: lights.count(),
        has_noise: base.is_some() && variants.iter().any(|variant| variant.kind == base),
    }
}
