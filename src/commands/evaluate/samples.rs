//! The questions of an evaluation with their places in the run: [`Sample`].
//!
//! Choice of the frame shown to the control `observer:other-room`: [`OtherRooms`].

use std::collections::{BTreeMap, HashMap, HashSet};

use darkqa_base::error::Result;
use darkqa_base::types::{Digest, FrameId, Question, QuestionId};
use darkqa_data::Dataset;
use darkqa_engine::images::frames::{Source, first_question_per_frame};
use darkqa_runs::run_plan::RunPlan;

/// A question with its places in the run.
#[derive(Debug)]
pub(super) struct Sample {
    pub(super) question: Question,
    /// Position among all selected questions, for models that are asked only the first few.
    pub(super) place: usize,
    /// Position among all questions of the data.
    pub(super) file_place: usize,
    /// Index of the source that is the question's frame; `None` if another shard has it.
    pub(super) source: Option<usize>,
    /// Digest of the question's frame, over its file or all its files; `None` if no image is read.
    pub(super) digest: Option<Digest>,
    /// Index of the source that the control `observer:other-room` is shown; `None` without the control, or if another
    /// shard has it.
    pub(super) other_room: Option<usize>,
}

/// The selected questions, before they are samples.
pub(super) struct Selection {
    /// Selected questions of the whole run.
    pub(super) selected: Vec<Question>,
    /// Position of each question among all questions of the data.
    pub(super) file_places: HashMap<QuestionId, usize>,
    /// `None` if the control `observer:other-room` is not asked.
    pub(super) other_rooms: Option<OtherRooms>,
}

impl Selection {
    /// The questions about the frames of this run or shard, and those whose other room is a frame of it, in the order
    /// of their selection. Only the latter need a digest that no source has: from the plan if there is one, otherwise
    /// from the files.
    ///
    /// # Errors
    /// If a frame of another shard cannot be read.
    pub(super) fn samples(self, dataset: &Dataset, sources: &[Source], plan: Option<&RunPlan>) -> Result<Vec<Sample>> {
        let places: HashMap<&FrameId, usize> = sources.iter().map(|source| &source.name).zip(0..).collect();
        let mut other_digests = HashMap::<FrameId, Option<Digest>>::new();
        let mut samples = Vec::new();
        for (place, question) in self.selected.into_iter().enumerate() {
            // A shard has all questions about a frame or none.
            let source = places.get(&question.frame).copied();
            let shown = self.other_rooms.as_ref().and_then(|others| others.shown_for(&question.frame));
            let other_room = shown.and_then(|shown| places.get(shown).copied());
            let digest = match (source, other_room) {
                (None, None) => continue,
                (Some(source), _) => sources[source].digest(),
                (None, Some(_)) => {
                    if let Some(known) = other_digests.get(&question.frame) {
                        *known
                    } else {
                        let digest = match plan.and_then(|plan| plan.digest(&question.frame)) {
                            Some(digest) => Some(digest),
                            None => Source::from_questions(dataset, &question.frame)?.digest(),
                        };
                        other_digests.insert(question.frame.clone(), digest);
                        digest
                    }
                }
            };
            let file_place = self.file_places[&question.id];
            samples.push(Sample { question, place, file_place, source, digest, other_room });
        }
        Ok(samples)
    }
}

/// For each frame, the frame whose image is shown instead.
///
/// It is the next frame of another scene in the order of the run; after the last frame, the order starts again at the
/// first. All frames of the run are considered, so that shards and resumed runs choose the same.
#[derive(Debug, Default)]
pub(super) struct OtherRooms(BTreeMap<FrameId, FrameId>);

impl OtherRooms {
    /// Chooses the other frames; `None` if all frames are of one scene. A frame without a scene (empty) counts as a
    /// scene of its own.
    pub(super) fn new(questions: &[Question], scene: impl Fn(&FrameId) -> String) -> Option<Self> {
        let frames: Vec<&FrameId> =
            first_question_per_frame(questions).into_iter().map(|question| &question.frame).collect();
        let scenes: Vec<String> = frames
            .iter()
            .map(|frame| match scene(frame) {
                scene if scene.is_empty() => format!("frame {frame}"),
                scene => scene,
            })
            .collect();
        if scenes.iter().collect::<HashSet<_>>().len() < 2 {
            return None;
        }
        let count = frames.len();
        let mut others = BTreeMap::new();
        let mut next = 0;
        // Going backwards, `next` is the nearest later frame of another scene. For the last scene this is one of the
        // first frames, which is known only after one pass over all frames, so the loop makes two.
        for place in (0..2 * count).rev().map(|place| place % count) {
            let after = (place + 1) % count;
            if scenes[after] != scenes[place] {
                next = after;
            }
            others.insert(frames[place].clone(), frames[next].clone());
        }
        Some(Self(others))
    }

    /// The frame that is shown in place of a frame.
    pub(super) fn shown_for(&self, frame: &FrameId) -> Option<&FrameId> {
        self.0.get(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::{Choices, Evidence, Family};

    fn others(frames: &str) -> Option<String> {
        let questions: Vec<Question> = frames
            .chars()
            .enumerate()
            .map(|(id, frame)| Question {
                id: QuestionId(id.to_string()),
                frame: FrameId(frame.to_string()),
                family: Family::Closest,
                text: "?".into(),
                choices: Choices::new(vec!["a".into(), "b".into()], 0).unwrap(),
                group: None,
                evidence: Evidence::default(),
            })
            .collect();
        // Lower and upper case are frames of one scene; digits have none.
        let others = OtherRooms::new(&questions, |frame| frame.0.to_lowercase().replace(char::is_numeric, ""))?;
        frames.chars().map(|frame| Some(others.shown_for(&FrameId(frame.to_string())).unwrap().0.clone())).collect()
    }

    #[test]
    fn the_next_frame_of_another_scene_is_shown() {
        for (frames, shown) in [
            ("12", Some("21")),
            ("aAbB", Some("bbaa")),
            ("aAbBc", Some("bbcca")),
            ("adDA", Some("dAAd")),
            ("aabb", Some("bbaa")),
            ("123", Some("231")),
            ("aA", None),
            ("a", None),
            ("", None),
        ] {
            let found = others(frames);
            let expected = shown.map(str::to_owned);
            assert_eq!(found, expected, "{frames}");
        }
    }
}
