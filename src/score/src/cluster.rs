//! Groups of questions that are not independent: [`Clusters`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;

use darkqa_ground::types::{FrameId, QuestionId};

/// The unit that is treated as independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ClusterUnit {
    /// Scenes: frames of one scene share its furniture and its light.
    Scene,
    /// Frames: questions about one frame share its pixels.
    Frame,
    /// Questions, if each is about a different frame, or if all are about the same frame.
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

/// Relations between frames that put them into one cluster.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FrameTies {
    /// Scene of each frame, if it is known; empty if the data name no scenes.
    pub scenes: BTreeMap<FrameId, String>,
    /// Images of each frame that consists of several.
    pub images: BTreeMap<FrameId, Vec<FrameId>>,
}

/// The cluster of each frame.
///
/// Questions of a frame and frames of a scene are not independent. Intervals that treat them as independent are too
/// narrow (Miller 2024, "Adding Error Bars to Evals", arXiv:2411.00640, section 2.2). The unit is the scene if there are at least
/// [`MIN_SCENES`], and some have more than one frame. A frame without a scene then counts as a scene of its own. Otherwise the unit is the
/// frame, or the question if there is only one frame. Questions with several images belong to one frame if they share an image with each
/// other, or with a question about that image alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clusters {
    unit: ClusterUnit,
    /// Cluster of each frame; empty if all questions are about one frame.
    by_frame: HashMap<FrameId, u32>,
    /// Cluster of each question, if all are about one frame.
    by_question: HashMap<QuestionId, u32>,
    count: usize,
}

/// Minimum number of scenes for clustering by scene. With fewer, the spread between scenes is poorly estimated, and frames are the
/// clusters.
pub const MIN_SCENES: usize = 8;

impl Clusters {
    /// Assigns clusters to questions, given with their frames.
    pub fn new<'a>(
        pairs: impl IntoIterator<Item = (&'a QuestionId, &'a FrameId)>,
        ties: &FrameTies,
    ) -> Self {
        let pairs: BTreeSet<(&FrameId, &QuestionId)> = pairs
            .into_iter()
            .map(|(question, frame)| (frame, question))
            .collect();
        let frames: BTreeSet<&FrameId> = pairs.iter().map(|(frame, _)| *frame).collect();
        let scenes: BTreeSet<(Option<&String>, Option<&FrameId>)> = frames
            .iter()
            .map(|frame| scene_or_frame(ties, frame))
            .collect();
        if scenes.len() >= MIN_SCENES && scenes.len() < frames.len() {
            let numbers: BTreeMap<_, u32> = scenes.into_iter().zip(0..).collect();
            return Self {
                unit: ClusterUnit::Scene,
                by_frame: frames
                    .iter()
                    .map(|frame| ((*frame).clone(), numbers[&scene_or_frame(ties, frame)]))
                    .collect(),
                count: numbers.len(),
                by_question: HashMap::new(),
            };
        }
        let (by_frame, count) = number_frames(&frames, &ties.images);
        if count == 1 {
            return Self {
                unit: ClusterUnit::Question,
                count: pairs.len(),
                by_frame: HashMap::new(),
                by_question: pairs
                    .iter()
                    .map(|(_, question)| (*question).clone())
                    .zip(0..)
                    .collect(),
            };
        }
        Self {
            unit: if pairs.len() == count {
                ClusterUnit::Question
            } else {
                ClusterUnit::Frame
            },
            count,
            by_frame,
            by_question: HashMap::new(),
        }
    }

    /// Unit that forms a cluster.
    #[must_use]
    pub fn unit(&self) -> ClusterUnit {
        self.unit
    }

    /// Number of clusters of all questions.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Index of the cluster of a question about a frame, from 0; `None` if that question was not asked.
    #[must_use]
    pub fn get(&self, frame: &FrameId, question: &QuestionId) -> Option<u32> {
        self.by_frame
            .get(frame)
            .or_else(|| self.by_question.get(question))
            .copied()
    }
}

/// Numbers the frames, and returns the count of numbers. Frames that share an image, directly or through others, get the same number.
fn number_frames(
    frames: &BTreeSet<&FrameId>,
    images: &BTreeMap<FrameId, Vec<FrameId>>,
) -> (HashMap<FrameId, u32>, usize) {
    /// Returns the root of a frame in the union-find forest, and shortens the path to it.
    fn root(parents: &mut [usize], mut frame: usize) -> usize {
        while parents[frame] != frame {
            parents[frame] = parents[parents[frame]];
            frame = parents[frame];
        }
        frame
    }
    let mut parents: Vec<usize> = (0..frames.len()).collect();
    let mut first_frames = HashMap::<&FrameId, usize>::new();
    for (index, frame) in frames.iter().enumerate() {
        let shown = images
            .get(*frame)
            .map_or(std::slice::from_ref(*frame), Vec::as_slice);
        for image in shown {
            let first = *first_frames.entry(image).or_insert(index);
            let [one, other] = [first, index].map(|frame| root(&mut parents, frame));
            parents[one.max(other)] = one.min(other);
        }
    }
    let mut numbers = HashMap::<usize, u32>::new();
    let mut by_frame = HashMap::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let next = numbers.len() as u32;
        let number = *numbers.entry(root(&mut parents, index)).or_insert(next);
        by_frame.insert((*frame).clone(), number);
    }
    (by_frame, numbers.len())
}

/// The scene of a frame, or the frame itself if it has no scene.
fn scene_or_frame<'a>(
    ties: &'a FrameTies,
    frame: &'a FrameId,
) -> (Option<&'a String>, Option<&'a FrameId>) {
    match ties.scenes.get(frame).filter(|scene| !scene.is_empty()) {
        Some(scene) => (Some(scene), None),
        None => (None, Some(frame)),
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
        let known = frames
            .iter()
            .enumerate()
            .filter(|_| scenes > 0)
            .map(|(i, frame)| (frame.clone(), format!("s{}", i % scenes.max(1))));
        let pairs = ids.iter().zip(frames.iter().cycle());
        let scenes = known.collect();
        Clusters::new(
            pairs,
            &FrameTies {
                scenes,
                ..FrameTies::default()
            },
        )
    }

    /// Cluster of each frame with its question.
    fn clusters_of(found: &Clusters, frames: &[FrameId], ids: &[QuestionId]) -> Vec<Option<u32>> {
        frames
            .iter()
            .zip(ids)
            .map(|(frame, id)| found.get(frame, id))
            .collect()
    }

    #[test]
    fn frames_that_share_an_image_are_one_cluster() {
        let ids: Vec<QuestionId> = (0..6).map(|i| QuestionId(format!("q{i}"))).collect();
        let frames = ["ab", "bc", "c", "d", "ef", "a c"].map(|images| FrameId(images.to_owned()));
        let ties = FrameTies {
            images: frames
                .iter()
                .filter(|frame| frame.0.len() > 1)
                .map(|frame| {
                    let images = frame
                        .0
                        .chars()
                        .filter(|letter| *letter != ' ')
                        .map(|letter| FrameId(letter.to_string()))
                        .collect();
                    (frame.clone(), images)
                })
                .collect(),
            ..FrameTies::default()
        };
        let found = Clusters::new(ids.iter().zip(&frames), &ties);
        assert_eq!((found.count(), found.unit()), (3, ClusterUnit::Frame));
        let clusters = clusters_of(&found, &frames, &ids);
        assert!(
            [1, 2, 5]
                .iter()
                .all(|frame| clusters[*frame] == clusters[0])
        );
        assert!(clusters[3] != clusters[0] && clusters[4] != clusters[0]);
        assert!(clusters[3] != clusters[4]);
        let apart = Clusters::new(ids.iter().zip(&frames), &FrameTies::default());
        assert_eq!((apart.count(), apart.unit()), (6, ClusterUnit::Question));
    }

    #[test]
    fn a_frame_without_a_scene_is_a_scene_of_its_own() {
        let frames: Vec<FrameId> = (0..30).map(|i| FrameId(format!("f{i:02}"))).collect();
        let ids: Vec<QuestionId> = (0..30).map(|i| QuestionId(format!("q{i}"))).collect();
        let ties = FrameTies {
            scenes: frames[..24]
                .iter()
                .enumerate()
                .map(|(i, frame)| (frame.clone(), format!("s{}", i % 8)))
                .collect(),
            ..FrameTies::default()
        };
        let found = Clusters::new(ids.iter().zip(&frames), &ties);
        assert_eq!((found.unit(), found.count()), (ClusterUnit::Scene, 8 + 6));
        let clusters = clusters_of(&found, &frames, &ids);
        assert!(clusters[0] == clusters[8] && clusters[0] != clusters[1]);
        assert!(clusters[28] != clusters[29]);
    }

    #[test]
    fn scenes_go_before_frames_if_there_are_enough() {
        for (frames, scenes, questions, unit, count) in [
            (20, 10, 60, ClusterUnit::Scene, 10),
            (20, 4, 60, ClusterUnit::Frame, 20),
            (20, 0, 60, ClusterUnit::Frame, 20),
            (20, 20, 60, ClusterUnit::Frame, 20),
            (20, 0, 20, ClusterUnit::Question, 20),
            (1, 0, 20, ClusterUnit::Question, 20),
        ] {
            let found = clusters(frames, scenes, questions);
            assert_eq!((found.unit(), found.count()), (unit, count));
        }
        let found = clusters(20, 10, 60);
        let (first, second) = (FrameId("f003".into()), FrameId("f013".into()));
        let question = QuestionId("q000".into());
        assert_eq!(found.get(&first, &question), found.get(&second, &question));
        assert_eq!(found.get(&FrameId("else".into()), &question), None);
        let single = clusters(1, 0, 5);
        let frame = FrameId("f000".into());
        assert_ne!(
            single.get(&frame, &question),
            single.get(&frame, &QuestionId("q001".into()))
        );
    }
}
