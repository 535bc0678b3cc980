//! A folder of frames.
//!
//! A folder with a `frames.jsonl` has the common interface. Its paths are relative to the folder:
//!
//! - `frames.jsonl`: one frame per line, `{"scene", "frame", "rgb", …}`; the name of a frame is `scene/frame`. A line may name
//!   maps of the size of the image: `depth`, in metres as `.npy` or in units of `depth_scale` metres as PNG; `sem`, the
//!   classes; and `over`, the segments. `over_source` is `renderer` or `connected_components` (objects) or `superpixel`
//!   (parts). Also optional: `depth_kind` (`planar` or `euclid`), `intrinsics` (`{"fx", "fy", "cx", "cy"}`), `room_gt`,
//!   `t` (seconds) and `pose`; and `dark`, photographs of the same scene in the dark: a path, `{"path", "ev", "name"}`, or a list of
//!   them ([`dark_photos`](super::dark_photos)).
//! - `classes.json`: the class of each number in `sem` ([`crate::labels`]).
//! - `dataset.json`: `{"schema": "darkqa.dataset/1", "name", "depth_kind", "light"}`; the last three are optional. `light` is `lit`, or
//!   `dark` for photographs that were taken in the dark.
//! - `scenes/<scene>/segments.json`: the segments that have names, `{"7": {"name", "canonical", "region"}}`.
//!
//! Without the list, every PNG, JPEG, WebP, TIFF and BMP file in the folder is a frame, named by its file name. The questions are in
//! `questions.jsonl` in the same folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;

use super::dark_photos::DarkField;
use super::image_names::{ImageNames, is_image};
use super::image_source::FrameFile;
use super::maps::{DepthFile, MapPaths};
use super::root::LeadsTo;
use super::view::FrameFacts;
use super::{Dataset, ImageSource, Root, SetArgs, SkipBad, ready_made, stem};
use crate::error::{Error, Result};
use crate::files::reading::{entries, json, json_lines};
use crate::labels;
use crate::picture::image_file::format::READ;
use crate::types::{DepthKind, FrameId, Intrinsics, Labels, SegmentName, Segmentation, SetLight};

/// The file that lists the frames of the common interface.
pub(super) const FRAMES: &str = "frames.jsonl";
/// The file of the questions about the frames of the folder.
pub(super) const QUESTIONS: &str = "questions.jsonl";
/// The file with the class of each number in the semantic maps.
const CLASSES: &str = "classes.json";
/// The file with the name of the data set and the kind of its depth.
const DATASET: &str = "dataset.json";
/// The value of `schema` in `dataset.json`.
const SCHEMA: &str = "darkqa.dataset/1";
/// The file with the names of the segments of a scene.
const SEGMENTS: &str = "segments.json";

/// The fields of `dataset.json` that are used.
#[derive(Debug, Default, Deserialize)]
struct DataSetInfo {
    schema: String,
    name: Option<String>,
    depth_kind: Option<DepthKind>,
    light: Option<SetLight>,
}

/// Scene → segment number → name. The file of each scene is read once.
type SceneNames = BTreeMap<String, Arc<BTreeMap<u32, SegmentName>>>;

/// The fields of a line of `frames.jsonl` that are used.
#[derive(Debug, Deserialize)]
struct FrameLine {
    scene: String,
    frame: String,
    rgb: PathBuf,
    depth: Option<PathBuf>,
    depth_scale: Option<f64>,
    sem: Option<PathBuf>,
    over: Option<PathBuf>,
    over_source: Option<SegmentSource>,
    depth_kind: Option<DepthKind>,
    intrinsics: Option<Intrinsics>,
    room_gt: Option<String>,
    dark: Option<DarkField>,
}

/// The way in which a map of segments was made.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SegmentSource {
    Renderer,
    ConnectedComponents,
    Superpixel,
}

/// The treatment of listed files that do not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MissingFiles {
    /// The list is refused.
    Refused,
    /// They are named when they are read, so that `--skip bad` leaves out their frames.
    Named,
}

impl MissingFiles {
    pub(super) fn new(skip: Option<SkipBad>) -> Self {
        match skip {
            Some(_) => Self::Named,
            None => Self::Refused,
        }
    }
}

impl FrameLine {
    /// The files of the frame and the other facts of its line.
    fn source(
        self,
        root: &Root,
        info: &DataSetInfo,
        names: &SceneNames,
        missing: MissingFiles,
    ) -> Result<ImageSource, String> {
        let existing = |file: PathBuf| match missing {
            MissingFiles::Refused => root.file(root.folder(), &file),
            MissingFiles::Named => root.place(root.folder(), &file),
        };
        let rgb = existing(self.rgb)?;
        let dark = self.dark.map(|dark| dark.photos(existing)).transpose()?;
        let dark = dark.unwrap_or_default();
        let depth = self.depth.map(existing).transpose()?;
        let maps = MapPaths {
            depth: depth
                .map(|path| DepthFile::new(path, self.depth_scale))
                .transpose()?,
            semantic: self.sem.map(existing).transpose()?,
            segments: self.over.map(existing).transpose()?,
        };
        let focal = self
            .intrinsics
            .map_or(1.0, |camera| camera.fx.min(camera.fy));
        if !(focal.is_finite() && focal > 0.0) {
            return Err(format!(
                "a focal length of {focal} pixels; fx and fy above 0 expected"
            ));
        }
        let view = FrameFacts {
            depth_kind: self.depth_kind.or(info.depth_kind).unwrap_or_default(),
            intrinsics: self.intrinsics,
            segmentation: match self.over_source {
                Some(SegmentSource::Superpixel) => Segmentation::Parts,
                Some(SegmentSource::Renderer | SegmentSource::ConnectedComponents) | None => {
                    Segmentation::Instances
                }
            },
            names: names.get(&self.scene).cloned().unwrap_or_default(),
            room: self.room_gt,
            scene: self.scene,
        };
        Ok(ImageSource::File(Box::new(FrameFile {
            rgb,
            maps,
            view,
            dark,
        })))
    }
}

/// The frames of a folder and the labels of its maps, without questions.
pub(super) fn frames(folder: &Path, further: &[PathBuf], missing: MissingFiles) -> Result<Dataset> {
    let info = data_set_info(folder)?;
    let labels = labels(folder)?;
    let title = info.name.unwrap_or_default();
    let name = if title.is_empty() {
        stem(folder)
    } else {
        title.clone()
    };
    let dataset = Dataset::new(name, sources(folder, further, missing)?, Vec::new());
    Ok(Dataset {
        title,
        labels,
        ..dataset
    })
}

/// The labels of the semantic maps of a folder; `None` without a `classes.json`.
pub(super) fn labels(folder: &Path) -> Result<Option<Labels>> {
    let classes = folder.join(CLASSES);
    let labels = classes.exists().then(|| labels::read(&classes));
    labels.transpose()
}

fn data_set_info(folder: &Path) -> Result<DataSetInfo> {
    let path = folder.join(DATASET);
    if !path.exists() {
        return Ok(DataSetInfo::default());
    }
    let info: DataSetInfo = json(&path)?;
    if info.schema != SCHEMA {
        let problem = format_args!("schema {:?}; {SCHEMA:?} expected", info.schema);
        return Err(Error::data(path.display(), problem));
    }
    Ok(info)
}

/// The light in which the photographs of a folder were taken: as `dataset.json` states, else lit.
pub(super) fn light(folder: &Path) -> Result<SetLight> {
    Ok(data_set_info(folder)?.light.unwrap_or_default())
}

/// Segment number → name in a scene; empty without a `segments.json`.
fn segment_names(root: &Root, scene: &str) -> Result<Arc<BTreeMap<u32, SegmentName>>> {
    let below = Path::new("scenes").join(scene).join(SEGMENTS);
    let path = root.folder().join(&below);
    if !path.exists() {
        return Ok(Arc::default());
    }
    let path = root
        .file(root.folder(), &below)
        .map_err(|problem| Error::data("scene", problem))?;
    let names: BTreeMap<u32, SegmentName> = json(&path)?;
    let canonical = labels::canonical();
    if let Some((id, name)) = names
        .iter()
        .find(|(_, name)| !canonical.contains(&name.canonical))
    {
        let problem = format_args!(
            "segment {id} ({:?}) has the class {:?}, which is not a class of mpcat40",
            name.name, name.canonical
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok(Arc::new(names))
}

pub(super) fn open(folder: &Path, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
    let file = questions.map_or_else(|| folder.join(QUESTIONS), Path::to_owned);
    let missing = MissingFiles::new(set.bad);
    if questions.is_none() && !file.exists() {
        if folder.join(FRAMES).exists() && folder.join(CLASSES).exists() {
            return frames(folder, &set.root.data_root, missing);
        }
        let is_empty = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
        let what = if is_empty {
            "the folder is empty: "
        } else {
            ""
        };
        let problem = format_args!(
            "{what}no {QUESTIONS} or questions.csv in this folder, and no {FRAMES} with {CLASSES} to make questions of; --questions FILE names some, and --ask home asks about photographs without any"
        );
        return Err(Error::data(folder.display(), problem));
    }
    let mut others = other_questions(folder).filter(|_| questions.is_none());
    if let Some(other) = others.next() {
        tracing::warn!(
            "{0} is not read, because {QUESTIONS} is in the same folder; --data {0} reads it alone",
            other.display()
        );
    }
    let read = ready_made::about_frames(&file, set)?;
    Dataset::new(
        stem(folder),
        sources(folder, &set.root.data_root, missing)?,
        Vec::new(),
    )
    .with_questions_of(&file, read, set.bad)
}

/// The files of questions that are in a folder besides [`QUESTIONS`].
pub(super) fn other_questions(folder: &Path) -> impl Iterator<Item = PathBuf> {
    ["csv", "tsv", "json", "parquet"]
        .map(|ending| format!("questions.{ending}"))
        .map(|name| folder.join(name))
        .into_iter()
        .filter(|file| file.exists())
}

/// Whether a place is a folder of frames, and not a ready-made set.
pub(super) fn is_folder_of_frames(place: &Path, questions: Option<&Path>) -> bool {
    let has = |name: &str| place.join(name).exists();
    place.is_dir()
        && (questions.is_some() || has(FRAMES) || has(QUESTIONS) || !ready_made::holds_files(place))
}

/// The frames of a folder: those in `frames.jsonl`, or every image if there is no such list.
pub(super) fn sources(
    folder: &Path,
    further: &[PathBuf],
    missing: MissingFiles,
) -> Result<BTreeMap<FrameId, ImageSource>> {
    let list = folder.join(FRAMES);
    if list.exists() {
        frames_of_list(&Root::new(folder, further)?, &list, missing)
    } else {
        images(&Root::new(folder, further)?)
    }
}

/// One image file as a data set of one frame, named by its file name.
pub(super) fn image(path: &Path) -> Result<BTreeMap<FrameId, ImageSource>> {
    fs::metadata(path).map_err(|e| Error::file(path, "read", e))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let id = FrameId(name.into_owned());
    Ok([(id, ImageSource::image(path.to_owned()))].into())
}

fn frames_of_list(
    root: &Root,
    list: &Path,
    missing: MissingFiles,
) -> Result<BTreeMap<FrameId, ImageSource>> {
    let (info, mut names) = (data_set_info(root.folder())?, SceneNames::new());
    let mut sources = BTreeMap::new();
    for (number, line) in json_lines::<FrameLine>(list)? {
        let id = FrameId(format!("{}/{}", line.scene, line.frame));
        if !names.contains_key(&line.scene) {
            let of_scene = segment_names(root, &line.scene)
                .map_err(|problem| Error::line(list, number, problem))?;
            names.insert(line.scene.clone(), of_scene);
        }
        let source = line
            .source(root, &info, &names, missing)
            .map_err(|problem| Error::line(list, number, problem))?;
        if sources.insert(id.clone(), source).is_some() {
            let problem = format_args!("a second frame {:?}", id.0);
            return Err(Error::line(list, number, problem));
        }
    }
    Ok(sources)
}

/// Every image of a folder. Links that lead out of it are not followed, and a warning names them.
fn images(root: &Root) -> Result<BTreeMap<FrameId, ImageSource>> {
    let folder = root.folder();
    let mut sources = BTreeMap::new();
    let (mut all, mut links_out) = (Vec::new(), Vec::new());
    for path in entries(folder)? {
        match root.leads_to(&path) {
            LeadsTo::Within => all.push(path),
            LeadsTo::Outside => links_out.push(path),
            LeadsTo::Nowhere => {}
        }
    }
    root.warn_of_links_out(&links_out);
    let names = ImageNames::from_paths(all.clone());
    for path in &names.images {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        sources.insert(FrameId(name.into_owned()), ImageSource::image(path.clone()));
    }
    if sources.is_empty() {
        let has_images =
            |inner: &&PathBuf| entries(inner).is_ok_and(|of| of.iter().any(|path| is_image(path)));
        let questions = folder.join(QUESTIONS);
        let remedy = match all.iter().find(has_images) {
            Some(inner) if questions.exists() => format!(
                "; name {} if its lines have paths such as {}/IMAGE",
                questions.display(),
                inner.file_name().unwrap_or_default().to_string_lossy()
            ),
            Some(inner) => format!(
                "; a folder in it has some: name that one, as {}",
                inner.display()
            ),
            None => String::new(),
        };
        let unread = names
            .unread()
            .map_or(String::new(), |unread| format!("; {unread}"));
        let problem =
            format_args!("neither a {FRAMES} nor any {READ} image in this folder{unread}{remedy}");
        return Err(Error::data(folder.display(), problem));
    }
    names.warn_of_unread(folder);
    Ok(sources)
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, ImageBuffer, Luma, RgbImage};
    use ndarray::array;

    use super::*;

    /// A folder of one image, its maps and a `frames.jsonl` of one line with these extra keys.
    fn folder(keys: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        RgbImage::new(2, 1).save(at("rgb.png")).unwrap();
        let ids = GrayImage::from_raw(2, 1, vec![3, 4]).unwrap();
        ids.save(at("sem.png")).unwrap();
        let units = ImageBuffer::<Luma<u16>, _>::from_raw(2, 1, vec![0, 1500]).unwrap();
        units.save(at("deep.png")).unwrap();
        let line = format!(r#"{{"scene":"a","frame":"0","rgb":"rgb.png"{keys}}}"#);
        fs::write(at(FRAMES), format!("\n{line}\n")).unwrap();
        let question = r#"{"id":1,"frame":"a/0","question":"?","choices":["x","y"],"answer":"x"}"#;
        fs::write(at(QUESTIONS), question).unwrap();
        folder
    }

    #[test]
    fn a_frame_has_the_maps_its_line_names() {
        let id = FrameId("a/0".into());
        let bare = folder(r#","depth":null,"depth_scale":0.001"#);
        let frame = open(bare.path(), None, &SetArgs::default())
            .unwrap()
            .frame(&id)
            .unwrap();
        assert_eq!((&frame.id, frame.rgb.width()), (&id, 2));
        assert!(frame.depth.is_none() && frame.semantic.is_none() && frame.segments.is_none());
        let full = folder(
            r#","depth":"deep.png","depth_scale":0.002,"sem":"sem.png","over":"deep.png","t":1.5"#,
        );
        let frame = open(full.path(), None, &SetArgs::default())
            .unwrap()
            .frame(&id)
            .unwrap();
        assert_eq!(frame.depth.unwrap(), array![[0, 3000]]);
        assert_eq!(frame.semantic.unwrap(), array![[3, 4]]);
        assert_eq!(frame.segments.unwrap(), array![[0, 1500]]);
    }

    #[test]
    fn a_folder_of_folders_of_images_names_one_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let problem = || {
            sources(folder.path(), &[], MissingFiles::Refused)
                .err()
                .unwrap()
                .to_string()
        };
        assert!(problem().ends_with("in this folder"), "{}", problem());
        fs::create_dir(folder.path().join("inner")).unwrap();
        RgbImage::new(2, 1)
            .save(folder.path().join("inner/a.png"))
            .unwrap();
        assert!(problem().ends_with("inner"), "{}", problem());
    }

    #[test]
    fn every_file_that_a_line_names_must_exist() {
        for (keys, says) in [
            (r#","depth":"no.png","depth_scale":1"#, "no.png"),
            (r#","sem":"no.png""#, "no such file: "),
            (r#","over":"""#, "the path is empty"),
            (r#","depth":"deep.png""#, "depth_scale is missing"),
            (
                r#","depth":"deep.png","depth_scale":0"#,
                "depth_scale is 0;",
            ),
            (r#","depth":"deep.png","depth_scale":"mm""#, "invalid type"),
        ] {
            let folder = folder(keys);
            let error = open(folder.path(), None, &SetArgs::default())
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("frames.jsonl, line 2: ") && error.contains(says),
                "{error}"
            );
        }
    }

    #[test]
    fn a_byte_order_mark_is_ignored() {
        let folder = folder("");
        let list = folder.path().join(FRAMES);
        let text = fs::read_to_string(&list).unwrap();
        fs::write(&list, format!("\u{feff}{}", text.trim_start())).unwrap();
        assert!(open(folder.path(), None, &SetArgs::default()).is_ok());
    }

    #[test]
    fn a_broken_line_is_named_once() {
        let folder = folder("");
        fs::write(folder.path().join(FRAMES), "\n{\n").unwrap();
        let error = open(folder.path(), None, &SetArgs::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.ends_with("frames.jsonl, line 2: EOF while parsing an object"),
            "{error}"
        );
    }
}
