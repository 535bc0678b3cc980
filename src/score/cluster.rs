//! Groups of questions that are not independent: [`Clusters`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;

use darkqa_base::types::{Digest, FrameId, QuestionId};

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
    /// Digest of each frame's file, or of all its files, if it is known.
    pub digests: HashMap<FrameId, Digest>,
}

/// The cluster of each frame.
///
/// Questions of a frame and frames of a scene are not independent. Intervals that treat them as independent are too
/// narrow (Miller 2024, "Adding Error Bars to Evals", arXiv:2411.00640, section 2.2). Frames are joined if they show
/// the same picture, or if they consist of several images and share one with each other or with a question about that
/// image alone. The unit is the scene if there are two scenes or more, and some have more than one of these frames. A
/// frame without a scene then counts as a scene of its own. Otherwise the unit is the frame, or the question if there
/// is only one frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clusters {
    unit: ClusterUnit,
    /// Cluster of each frame; empty if all questions are about one frame.
    by_frame: HashMap<FrameId, u32>,
    /// Cluster of each question, if all are about one frame.
    by_question: HashMap<QuestionId, u32>,
    count: usize,
}

/// Recommended minimum number of clusters. With fewer, intervals are wide, and a comparison at five levels can have no
/// verdict (5 · 2 / 2⁷ = 0.08).
pub const MIN_CLUSTERS: usize = 8;

impl Clusters {
    /// Assigns clusters to questions, given with their frames.
    pub fn new<'a>(pairs: impl IntoIterator<Item = (&'a QuestionId, &'a FrameId)>, ties: &FrameTies) -> Self {
        let pairs: BTreeSet<(&FrameId, &QuestionId)> =
            pairs.into_iter().map(|(question, frame)| (frame, question)).collect();
        let mut frames: Vec<&FrameId> = pairs.iter().map(|(frame, _)| *frame).collect();
        frames.dedup();
        let (by_frame, count) = number_frames(&frames, ties, |_| None);
        if !ties.scenes.is_empty() {
            let (by_scene, scenes) = number_frames(&frames, ties, |frame| ties.scene(frame));
            if scenes > 1 && scenes < count {
                return Self {
                    unit: ClusterUnit::Scene,
                    by_frame: by_scene,
                    count: scenes,
                    by_question: HashMap::new(),
                };
            }
        }
        if count == 1 {
            return Self {
                unit: ClusterUnit::Question,
                count: pairs.len(),
                by_frame: HashMap::new(),
                by_question: pairs.iter().map(|(_, question)| (*question).clone()).zip(0..).collect(),
            };
        }
        Self {
            unit: if pairs.len() == count { ClusterUnit::Question } else { ClusterUnit::Frame },
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
        self.by_frame.get(frame).or_else(|| self.by_question.get(question)).copied()
    }
}

/// Something that joins all frames that have it.
#[derive(PartialEq, Eq, Hash)]
enum Tie<'a> {
    Image(&'a FrameId),
    Picture(Digest),
    Scene(&'a str),
}

/// Numbers the frames in the order of their scenes and names, and returns the count of numbers. Frames that share a
/// tie, directly or through others, get the same number.
fn number_frames<'a>(
    frames: &[&'a FrameId],
    ties: &'a FrameTies,
    scene_of: impl Fn(&FrameId) -> Option<&'a str>,
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
    let mut first_frames = HashMap::<Tie<'_>, usize>::new();
    for (index, frame) in frames.iter().enumerate() {
        let images = ties.images.get(*frame).map_or(std::slice::from_ref(*frame), Vec::as_slice);
        let own = images
            .iter()
            .map(Tie::Image)
            .chain(ties.digests.get(*frame).copied().map(Tie::Picture))
            .chain(scene_of(frame).map(Tie::Scene));
        for tie in own {
            let first = *first_frames.entry(tie).or_insert(index);
            let [one, other] = [first, index].map(|frame| root(&mut parents, frame));
            parents[one.max(other)] = one.min(other);
        }
    }
    let mut numbers = HashMap::<usize, u32>::new();
    let mut by_frame = HashMap::with_capacity(frames.len());
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by_key(|index| scene_of(frames[*index]));
    for index in order {
        let next = numbers.len() as u32;
        let number = *numbers.entry(root(&mut parents, index)).or_insert(next);
        by_frame.insert(frames[index].clone(), number);
    }
    (by_frame, numbers.len())
}

impl FrameTies {
    /// The scene of a frame; `None` if it has none.
    fn scene(&self, frame: &FrameId) -> Option<&str> {
        let scene = self.scenes.get(frame)?;
        (!scene.is_empty()).then_some(&**scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters(frames: usize, scenes: usize, questions: usize) -> Clusters {
        let frames: Vec<FrameId> = (0..frames).map(|i| FrameId(format!("f{i:03}"))).collect();
        let ids: Vec<QuestionId> = (0..questions).map(|i| QuestionId(format!("q{i:03}"))).collect();
        let known = frames
            .iter()
            .enumerate()
            .filter(|_| scenes > 0)
            .map(|(i, frame)| (frame.clone(), format!("s{}", i % scenes.max(1))));
        let pairs = ids.iter().zip(frames.iter().cycle());
        let scenes = known.collect();
        Clusters::new(pairs, &FrameTies { scenes, ..FrameTies::default() })
    }

    /// Cluster of each frame with its question.
    fn clusters_of(found: &Clusters, frames: &[FrameId], ids: &[QuestionId]) -> Vec<Option<u32>> {
        frames.iter().zip(ids).map(|(frame, id)| found.get(frame, id)).collect()
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
        assert!([1, 2, 5].iter().all(|frame| clusters[*frame] == clusters[0]));
        assert!(clusters[3] != clusters[0] && clusters[4] != clusters[0]);
        assert!(clusters[3] != clusters[4]);
        let apart = Clusters::new(ids.iter().zip(&frames), &FrameTies::default());
        assert_eq!((apart.count(), apart.unit()), (6, ClusterUnit::Question));
    }

    /// Cluster of each of six frames with one question each, of which 0 and 3 show the same picture.
    fn with_a_copy(scenes: &[&str]) -> (Clusters, Vec<Option<u32>>) {
        let frames: Vec<FrameId> = (0..6).map(|i| FrameId(format!("f{i}"))).collect();
        let ids: Vec<QuestionId> = (0..6).map(|i| QuestionId(format!("q{i}"))).collect();
        let ties = FrameTies {
            scenes: frames.iter().cloned().zip(scenes.iter().map(|&scene| scene.to_owned())).collect(),
            digests: [0, 3].map(|i| (frames[i].clone(), Digest::from_bytes(b"picture"))).into(),
            ..FrameTies::default()
        };
        let found = Clusters::new(ids.iter().zip(&frames), &ties);
        let clusters = clusters_of(&found, &frames, &ids);
        (found, clusters)
    }

    #[test]
    fn equal_pictures_are_one_frame() {
        let (found, clusters) = with_a_copy(&[]);
        assert_eq!((found.unit(), found.count()), (ClusterUnit::Frame, 5));
        assert_eq!(clusters[0], clusters[3]);
    }

    #[test]
    fn equal_pictures_join_their_scenes() {
        let (found, clusters) = with_a_copy(&["a", "a", "b", "b", "c", "c"]);
        assert_eq!((found.unit(), found.count()), (ClusterUnit::Scene, 2));
        assert_eq!(clusters[1], clusters[2]);
        assert_ne!(clusters[0], clusters[4]);
    }

    #[test]
    fn a_frame_without_a_scene_is_a_scene_of_its_own() {
        let frames: Vec<FrameId> = (0..30).map(|i| FrameId(format!("f{i:02}"))).collect();
        let ids: Vec<QuestionId> = (0..30).map(|i| QuestionId(format!("q{i}"))).collect();
        let ties = FrameTies {
            scenes: frames[..24].iter().enumerate().map(|(i, frame)| (frame.clone(), format!("s{}", i % 8))).collect(),
            ..FrameTies::default()
        };
        let found = Clusters::new(ids.iter().zip(&frames), &ties);
        assert_eq!((found.unit(), found.count()), (ClusterUnit::Scene, 8 + 6));
        let clusters = clusters_of(&found, &frames, &ids);
        assert!(clusters[0] == clusters[8] && clusters[0] != clusters[1]);
        assert!(clusters[28] != clusters[29]);
    }

    #[test]
    fn scenes_go_before_frames_if_there_are_two() {
        for (frames, scenes, questions, unit, count) in [
            (20, 10, 60, ClusterUnit::Scene, 10),
            (20, 4, 60, ClusterUnit::Scene, 4),
            (20, 2, 60, ClusterUnit::Scene, 2),
            (20, 1, 60, ClusterUnit::Frame, 20),
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
        assert_ne!(single.get(&frame, &question), single.get(&frame, &QuestionId("q001".into())));
    }
}
