//! The description of a LeRobot data set, `meta/info.json`: [`Info`].

use serde_json::{Map, Value};

/// Files in a chunk if `info.json` does not state it, as in LeRobot.
const CHUNK_SIZE: u64 = 1000;

/// Patterns of paths if `info.json` does not state them, as in LeRobot: of data files and of videos.
const PATHS_V2: [&str; 2] = [
    "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
];
const PATHS_V3: [&str; 2] = [
    "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
];

/// Layout of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// Versions 2.0 and 2.1: one file an episode.
    V2,
    /// Version 3.0: several episodes a file.
    V3,
}

/// Description of a data set.
#[derive(Debug)]
pub(super) struct Info {
    pub(super) layout: Layout,
    /// The version as stated, such as `v3.0`.
    pub(super) version: String,
    /// Frames per second of the data files.
    pub(super) fps: f64,
    /// Episodes in a chunk, in layout V2.
    pub(super) chunk_size: u64,
    /// Pattern of the paths of data files.
    pub(super) data_path: String,
    /// Pattern of the paths of videos.
    pub(super) video_path: String,
    pub(super) robot: Option<String>,
    /// Cameras, sorted by name.
    pub(super) cameras: Vec<Camera>,
    /// Number of features that are no cameras.
    pub(super) other_features: usize,
}

/// A camera of a data set: a feature with images.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Camera {
    pub(crate) name: String,
    pub(crate) form: ImageForm,
    /// True if the images are depth maps, which are not read.
    pub(crate) is_depth: bool,
    /// Size and codec as stated, such as `640×480 av1`; may be empty.
    pub(crate) description: String,
    /// Frames per second of its videos.
    pub(crate) fps: f64,
}

/// Where the images of a camera are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ImageForm {
    /// In video files.
    Video,
    /// In the data files, as image files in a column.
    Images,
}

impl ImageForm {
    /// The `dtype` in `info.json`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Video => "video",
            Self::Images => "image",
        }
    }
}

impl Info {
    /// Parses `info.json`.
    ///
    /// # Errors
    /// If the version is not supported, or a required field is missing; the message has the remedy.
    pub(super) fn parse(value: &Value) -> Result<Self, String> {
        let stated = value.get("codebase_version").and_then(Value::as_str);
        let version =
            stated.ok_or("no codebase_version; v2.0, v2.1 or v3.0 expected, as LeRobot writes it in this file")?;
        let layout = layout(version)?;
        let fps = positive(value.get("fps")).ok_or("no fps; the frames per second expected, a number above 0")?;
        let features = value
            .get("features")
            .and_then(Value::as_object)
            .ok_or("no features; an object with the columns and cameras expected")?;
        let cameras: Vec<Camera> =
            features.iter().filter_map(|(name, feature)| Camera::parse(name, feature, fps)).collect();
        let [data_path, video_path] = match layout {
            Layout::V2 => PATHS_V2,
            Layout::V3 => PATHS_V3,
        };
        let text = |key: &str| value.get(key).and_then(Value::as_str);
        Ok(Self {
            layout,
            version: version.to_owned(),
            fps,
            chunk_size: value.get("chunks_size").and_then(Value::as_u64).filter(|size| *size > 0).unwrap_or(CHUNK_SIZE),
            data_path: text("data_path").unwrap_or(data_path).to_owned(),
            video_path: text("video_path").unwrap_or(video_path).to_owned(),
            robot: text("robot_type").map(str::to_owned),
            other_features: features.len() - cameras.len(),
            cameras,
        })
    }
}

/// Layout of a version. Minor versions of LeRobot keep the layout.
fn layout(version: &str) -> Result<Layout, String> {
    let number = version.strip_prefix('v').unwrap_or(version);
    let major = number.split('.').next().unwrap_or_default();
    match major.parse::<u32>() {
        Ok(2) => Ok(Layout::V2),
        Ok(3) => Ok(Layout::V3),
        Ok(0 | 1) => Err(old_version(version)),
        _ => Err(format!(
            "version {version:?}; v2.0, v2.1 or v3.0 expected; take a newer darkqa-eval, or the revision v3.0 of the set: hf download USER/NAME --repo-type dataset --revision v3.0 --local-dir NEW"
        )),
    }
}

/// The message for version 1. LeRobot 0.3.3 is the last release with a converter from it.
pub(super) fn old_version(version: &str) -> String {
    format!(
        "version {version:?}; v2.0, v2.1 or v3.0 expected. The hub may have a newer revision:\n  hf download USER/NAME --repo-type dataset --revision v2.1 --local-dir NEW\nElse convert your own set on the hub; the converter writes the new files to NEW/v2.0/USER/NAME and to a branch v2 there:\n  pip install lerobot==0.3.3\n  python -m lerobot.datasets.v2.convert_dataset_v1_to_v2 --repo-id USER/NAME --single-task TASK --local-dir NEW --test-branch v2"
    )
}

fn positive(value: Option<&Value>) -> Option<f64> {
    value.and_then(Value::as_f64).filter(|number| number.is_finite() && *number > 0.0)
}

impl Camera {
    /// Parses a feature; `None` if it has no images.
    fn parse(name: &str, feature: &Value, fps: f64) -> Option<Self> {
        let form = match feature.get("dtype").and_then(Value::as_str)? {
            "video" => ImageForm::Video,
            "image" => ImageForm::Images,
            _ => return None,
        };
        // Version 2.0 has `video_info` in some sets.
        let empty = Map::new();
        let info =
            ["info", "video_info"].iter().find_map(|key| feature.get(key).and_then(Value::as_object)).unwrap_or(&empty);
        let is_depth = ["is_depth_map", "video.is_depth_map"]
            .iter()
            .any(|key| info.get(*key).and_then(Value::as_bool) == Some(true));
        let codec = info.get("video.codec").and_then(Value::as_str).filter(|_| form == ImageForm::Video);
        let words: Vec<String> = size(feature).into_iter().chain(codec.map(str::to_owned)).collect();
        Some(Self {
            name: name.to_owned(),
            form,
            is_depth,
            description: words.join(" "),
            fps: positive(info.get("video.fps")).unwrap_or(fps),
        })
    }
}

/// Width and height in the shape of a feature, which is [height, width, channels], or [channels, height, width] in
/// older sets.
fn size(feature: &Value) -> Option<String> {
    let shape: Vec<u64> = feature.get("shape")?.as_array()?.iter().map(Value::as_u64).collect::<Option<_>>()?;
    let [first, second, third] = shape[..] else {
        return None;
    };
    let is_channel = |count: u64| (1..=4).contains(&count);
    let [height, width] = if is_channel(first) && !is_channel(third) { [second, third] } else { [first, second] };
    Some(format!("{width}×{height}"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn info(version: &str) -> Value {
        json!({
            "codebase_version": version, "fps": 30,
            "features": {
                "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "info": {"video.codec": "av1", "video.fps": 15}},
                "observation.image": {"dtype": "image", "shape": [3, 96, 128], "names": null},
                "depth": {"dtype": "video", "shape": [48, 64, 1], "info": {"is_depth_map": true}},
                "old_depth": {"dtype": "video", "shape": [48, 64, 1], "video_info": {"video.is_depth_map": true}},
                "action": {"dtype": "float32", "shape": [2]},
            },
        })
    }

    #[test]
    fn cameras_are_features_with_images() {
        let info = Info::parse(&info("v3.0")).unwrap();
        assert_eq!((info.layout, info.other_features), (Layout::V3, 1));
        let facts: Vec<(&str, &str, bool, f64)> = info
            .cameras
            .iter()
            .map(|camera| (&*camera.name, &*camera.description, camera.is_depth, camera.fps))
            .collect();
        assert_eq!(
            facts,
            [
                ("depth", "64×48", true, 30.0),
                ("observation.image", "128×96", false, 30.0),
                ("observation.images.top", "640×480 av1", false, 15.0),
                ("old_depth", "64×48", true, 30.0),
            ]
        );
        assert_eq!(info.video_path, PATHS_V3[1]);
    }

    #[test]
    fn versions_are_checked() {
        for version in ["v2.0", "v2.1", "2.1", "v3.0", "v3.1"] {
            assert!(Info::parse(&info(version)).is_ok(), "{version}");
        }
        for (version, remedy) in [
            ("v1.6", "convert_dataset_v1_to_v2"),
            ("v4.0", "a newer darkqa-eval"),
            ("new", "v2.0, v2.1 or v3.0 expected"),
        ] {
            let problem = Info::parse(&info(version)).unwrap_err();
            assert!(problem.contains(remedy), "{problem}");
        }
    }

    #[test]
    fn missing_fields_are_named() {
        for key in ["codebase_version", "fps", "features"] {
            let mut value = info("v3.0");
            value[key] = Value::Null;
            assert!(Info::parse(&value).unwrap_err().contains(key));
        }
        let mut value = info("v3.0");
        value["fps"] = json!(0);
        assert!(Info::parse(&value).is_err());
    }
}
