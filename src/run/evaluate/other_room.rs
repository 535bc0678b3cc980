//! Which other frame the control `observer:other-room` is shown: [`OtherRooms`].

use std::collections::{BTreeMap, HashSet};

use crate::images::frames::first_asked;
use crate::types::{FrameId, Question};

/// The frame whose image is shown in place of each frame's own.
///
/// It is the next frame of another scene in the order of the run, from the last frame on to the first again. It is found among
/// all questions of the run, so that shards and resumed runs show the same.
#[derive(Debug, Default)]
pub(super) struct OtherRooms(BTreeMap<FrameId, FrameId>);

impl OtherRooms {
    /// The other frames; `None` if all frames are of one scene. A frame whose scene is not known (empty) is a scene by itself.
    pub(super) fn new(questions: &[Question], scene: impl Fn(&FrameId) -> String) -> Option<Self> {
        let frames: Vec<&FrameId> = first_asked(questions)
            .into_iter()
            .map(|question| &question.frame)
            .collect();
        let scene_of = |frame: &&FrameId| {
            let scene = scene(frame);
            if scene.is_empty() {
                format!("frame {frame}")
            } else {
                scene
            }
        };
        let scenes: Vec<String> = frames.iter().map(scene_of).collect();
        if scenes.iter().collect::<HashSet<_>>().len() < 2 {
            return None;
        }
        let count = frames.len();
        let mut others = BTreeMap::new();
        let mut next = 0;
        // From the last frame to the first, `next` is the nearest later frame of another scene. For the last scene of the order that
        // is the first frame, which is not known until the loop has gone through all frames once; so it does so twice.
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
        let question = |(id, frame): (usize, char)| Question {
            id: QuestionId(id.to_string()),
            frame: FrameId(frame.to_string()),
            family: Family::Closest,
            text: "?".into(),
            choices: Choices::new(vec!["a".into(), "b".into()], 0).unwrap(),
            group: None,
            evidence: serde_json::Value::Null,
        };
        let questions: Vec<Question> = frames.chars().enumerate().map(question).collect();
        // Lower and upper case are frames of one scene; digits have none.
        let scene = |frame: &FrameId| frame.0.to_lowercase().replace(char::is_numeric, "");
        let others = OtherRooms::new(&questions, scene)?;
        let shown = frames.chars().map(|frame| {
            let shown = others.shown_for(&FrameId(frame.to_string())).unwrap();
            shown.0.clone()
        });
        Some(shown.collect())
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
