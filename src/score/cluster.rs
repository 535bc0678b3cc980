//! Which questions stand and fall together: [`Clusters`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;

use crate::types::{FrameId, QuestionId};

/// What is taken as independent of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ClusterUnit {
    /// Scenes: frames of one scene share its furniture and its light.
    Scene,
    /// Frames: questions about one frame share its pixels.
    Frame,
    /// Questions: each is about a frame of its own, or all are about one.
    Question,
}

impl fmt::Display for ClusterUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Scene => "scene",
            Self::Frame => "frame",
            Self::Question => "question",
        })
    }
}

/// The cluster of each frame.
///
/// Questions of a frame and frames of a scene are not independent, so that intervals which take them so are too narrow
/// (Miller 2024, "Adding Error Bars to Evals", arXiv:2411.00640, section 2.2). The unit is the scene where every frame has
/// one, there are at least [`FEWEST_SCENES`] and some have more than a frame; else the frame; of one frame alone the question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clusters {
    unit: ClusterUnit,
    of: HashMap<FrameId, u32>,
    /// Where all are about one frame: the cluster of each question.
    questions: HashMap<QuestionId, u32>,
    count: usize,
}

/// With fewer scenes than this their spread says too little; frames are the clusters then.
pub(crate) const FEWEST_SCENES: usize = 8;

impl Clusters {
    /// Clusters the frames of questions; `scenes` holds the scene of each frame where it is known.
    pub fn new<'a>(
        asked: impl IntoIterator<Item = (&'a QuestionId, &'a FrameId)>,
        scenes: &BTreeMap<FrameId, String>,
    ) -> Self {
        let asked: BTreeSet<(&FrameId, &QuestionId)> = asked
            .into_iter()
            .map(|(question, frame)| (frame, question))
            .collect();
        let frames: BTreeSet<&FrameId> = asked.iter().map(|(frame, _)| *frame).collect();
        let scene_of = |frame: &FrameId| scenes.get(frame).filter(|scene| !scene.is_empty());
        let known: Option<Vec<&String>> = frames.iter().map(|frame| scene_of(frame)).collect();
        let names: BTreeSet<&String> = known.iter().flatten().copied().collect();
        if known.is_some() && names.len() >= FEWEST_SCENES && names.len() < frames.len() {
            let numbers: BTreeMap<&String, u32> = names.into_iter().zip(0..).collect();
            let of = frames.iter().filter_map(|frame| {
                let number = numbers.get(scene_of(frame)?)?;
                Some(((*frame).clone(), *number))
            });
            return Self {
                unit: ClusterUnit::Scene,
                of: of.collect(),
                count: numbers.len(),
                questions: HashMap::new(),
            };
        }
        if frames.len() == 1 {
            return Self {
                unit: ClusterUnit::Question,
                count: asked.len(),
                of: HashMap::new(),
                questions: asked
                    .iter()
                    .map(|(_, question)| (*question).clone())
                    .zip(0..)
                    .collect(),
            };
        }
        Self {
            unit: if asked.len() == frames.len() {
                ClusterUnit::Question
            } else {
                ClusterUnit::Frame
            },
            count: frames.len(),
            of: frames.into_iter().cloned().zip(0..).collect(),
            questions: HashMap::new(),
        }
    }

    /// What the clusters are.
    #[must_use]
    pub fn unit(&self) -> ClusterUnit {
        self.unit
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The number of the cluster of a question about a frame, from 0; `None` where that was not asked.
    #[must_use]
    pub fn of(&self, frame: &FrameId, question: &QuestionId) -> Option<u32> {
        self.of
            .get(frame)
            .or_else(|| self.questions.get(question))
            .copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters(frames: usize, scenes: usize, questions: usize) -> Clusters {
        let frames: Vec<FrameId> = (0..frames).map(|i| FrameId(format!("f{i:03}"))).collect();
        let ids: Vec<QuestionId> = (0..questions)
            .map(|i| QuestionId(format!("q{i:03}")))
            .collect();
        let known = frames.iter().enumerate().filter(|_| scenes > 0);
        let known = known.map(|(i, frame)| (frame.clone(), format!("s{}", i % scenes.max(1))));
        let asked = ids.iter().zip(frames.iter().cycle());
        Clusters::new(asked, &known.collect())
    }

    #[test]
    fn scenes_go_before_frames_where_there_are_enough() {
        for (frames, scenes, questions, unit, count) in [
            (20, 10, 60, ClusterUnit::Scene, 10),
            (20, 4, 60, ClusterUnit::Frame, 20),
            (20, 0, 60, ClusterUnit::Frame, 20),
            (20, 20, 60, ClusterUnit::Frame, 20),
            (20, 0, 20, ClusterUnit::Question, 20),
            (1, 0, 20, ClusterUnit::Question, 20),
        ] {
            let made = clusters(frames, scenes, questions);
            assert_eq!((made.unit(), made.count()), (unit, count));
        }
        let made = clusters(20, 10, 60);
        let (first, second) = (FrameId("f003".into()), FrameId("f013".into()));
        let question = QuestionId("q000".into());
        assert_eq!(made.of(&first, &question), made.of(&second, &question));
        assert_eq!(made.of(&FrameId("else".into()), &question), None);
        let one = clusters(1, 0, 5);
        let frame = FrameId("f000".into());
        assert_ne!(
            one.of(&frame, &question),
            one.of(&frame, &QuestionId("q001".into()))
        );
    }
}
