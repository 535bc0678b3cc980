//! Choice of the frame shown to the control `observer:other-room`: [`OtherRooms`].

use std::collections::{BTreeMap, HashSet};

use crate::engine::images::frames::first_question_per_frame;
use crate::types::{FrameId, Question};

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
    use crate::types::{Choices, Family, QuestionId};

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
                evidence: serde_json::Value::Null,
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
