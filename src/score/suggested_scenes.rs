//! Scenes suggested by the names of frames: [`SuggestedScenes`].

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use regex::Regex;

use super::cluster::MIN_CLUSTERS;
use darkqa_base::types::FrameId;

/// Scenes guessed from the names of frames, if the data name no scenes. Only for a warning, never used as clusters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SuggestedScenes {
    /// Number of scenes.
    pub scenes: usize,
    /// Number of frames.
    pub frames: usize,
    /// First names of scenes, for the message.
    examples: Vec<String>,
    by: NamedBy,
}

/// The part of a frame's name that suggests its scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NamedBy {
    Folder,
    FileName,
}

/// A file name that begins with a numbered place, such as `scene0001_00` or `room-12.`.
static NUMBERED_PLACE: LazyLock<Option<Regex>> = LazyLock::new(|| {
    let places =
        "scene|room|house|home|apartment|building|place|location|site|video|clip|sequence|seq|episode|walk|trajectory";
    Regex::new(&format!(r"(?i)^((?:{places})[ _-]?[0-9]+)(?:[^0-9a-z].*)?$")).ok()
});

/// Number of scenes that a message names.
const MAX_NAMED: usize = 2;

impl SuggestedScenes {
    /// Guesses scenes from the folders or the beginnings of the file names of these frames. `None` if each scene would
    /// have one frame, or if one scene would have all frames.
    #[must_use]
    pub fn new<'f>(frames: impl IntoIterator<Item = &'f FrameId>) -> Option<Self> {
        let frames: BTreeSet<&str> = frames.into_iter().map(|frame| &*frame.0).collect();
        Self::grouped(&frames, NamedBy::Folder, folder)
            .or_else(|| Self::grouped(&frames, NamedBy::FileName, numbered_place))
            .or_else(|| {
                Self::grouped(&frames, NamedBy::FileName, before_number).filter(|found| found.scenes >= MIN_CLUSTERS)
            })
    }

    /// Groups frames by scene, which `scene_of` finds in the name. `None` if a name has no scene or the groups are
    /// unlikely to be scenes.
    fn grouped(frames: &BTreeSet<&str>, by: NamedBy, scene_of: fn(&str) -> Option<String>) -> Option<Self> {
        let mut scenes = BTreeMap::<String, usize>::new();
        for frame in frames {
            *scenes.entry(scene_of(frame)?).or_default() += 1;
        }
        // At least half of the frames must share their scene; random names with equal beginnings do not reach this.
        let shared: usize = scenes.values().filter(|count| **count > 1).sum();
        let is_likely = scenes.len() > 1 && 2 * shared >= frames.len() && shared > 0;
        is_likely.then(|| Self {
            scenes: scenes.len(),
            frames: frames.len(),
            examples: scenes.keys().take(MAX_NAMED).cloned().collect(),
            by,
        })
    }

    /// The suggestion as one sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let names = match self.by {
            NamedBy::Folder => "Folders",
            NamedBy::FileName => "File names",
        };
        let more = if self.scenes > self.examples.len() { ", …" } else { "" };
        format!(
            "{names} suggest {} scenes ({}{more}), but the data name none, so the {} frames count as independent",
            self.scenes,
            self.examples.join(", "),
            self.frames
        )
    }
}

/// Folder of a frame, if its name has one.
fn folder(frame: &str) -> Option<String> {
    let (folder, _) = frame.rsplit_once(['/', '\\'])?;
    Some(folder.to_owned())
}

/// File name of a frame without folder and extension.
fn stem(frame: &str) -> &str {
    let name = frame.rsplit(['/', '\\']).next().unwrap_or(frame);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Numbered place at the beginning of a file name.
fn numbered_place(frame: &str) -> Option<String> {
    let found = NUMBERED_PLACE.as_ref()?.captures(stem(frame))?;
    Some(found[1].to_owned())
}

/// Part of a file name before its last number, such as `kitchen` in `kitchen_003.png`.
fn before_number(frame: &str) -> Option<String> {
    let stem = stem(frame);
    let name = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let scene = name.trim_end_matches(['_', '-', ' ', '.']);
    let is_separated = scene.len() < name.len() && name.len() < stem.len();
    (is_separated && !scene.is_empty()).then(|| scene.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of suggested scenes, and the first of them.
    fn suggested(names: &[String]) -> Option<(usize, String)> {
        let frames: Vec<FrameId> = names.iter().map(|name| FrameId(name.clone())).collect();
        let found = SuggestedScenes::new(&frames)?;
        Some((found.scenes, found.examples[0].clone()))
    }

    fn names(count: usize, name: impl Fn(usize) -> String) -> Vec<String> {
        (0..count).map(name).collect()
    }

    #[test]
    fn folders_and_numbered_places_suggest_scenes() {
        for (frames, scenes, first) in [
            (names(42, |i| format!("scene{:04}_{i}.png", i % 19)), 19, "scene0000"),
            (names(12, |i| format!("scene{:04}_00_{i:06}.jpg", i / 3)), 4, "scene0000"),
            (names(9, |i| format!("Room-{}.{i}.png", i % 3)), 3, "Room-0"),
            (names(20, |i| format!("{}/{i}.png", i / 4)), 5, "0"),
            (names(20, |i| format!("images/k{}/{i}.png", i / 4)), 5, "images/k0"),
            (names(40, |i| format!("kitchen{}-a_{i:03}.png", i / 4)), 10, "kitchen0-a"),
        ] {
            assert_eq!(suggested(&frames), Some((scenes, first.to_owned())), "{frames:?}");
        }
    }

    #[test]
    fn plain_names_suggest_none() {
        for frames in [
            names(42, |i| format!("{i}.png")),
            names(42, |i| format!("COCO_val2014_{i:012}.jpg")),
            names(42, |i| format!("images/IMG_{i:04}.jpg")),
            names(42, |i| format!("{}_{i}.jpg", ["IMG", "DSC"][i % 2])),
            names(42, |i| format!("scene{i:04}_00.png")),
            names(42, |i| format!("{i}/0.png")),
            names(42, |i| format!("{:x}-{i}.png", i * 7919)),
            names(1, |_| "scene0001_00.png".to_owned()),
            Vec::new(),
        ] {
            assert_eq!(suggested(&frames), None, "{frames:?}");
        }
    }

    #[test]
    fn the_sentence_names_the_numbers() {
        let frames = names(42, |i| format!("scene{:04}_{i}.png", i % 19));
        let frames: Vec<FrameId> = frames.into_iter().map(FrameId).collect();
        assert_eq!(
            SuggestedScenes::new(&frames).unwrap().sentence(),
            "File names suggest 19 scenes (scene0000, scene0001, …), but the data name none, so the 42 frames count as independent"
        );
    }
}
