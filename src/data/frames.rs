//! Reader of a folder of frames.
//!
//! The common format is a folder with a `frames.jsonl`. Paths are relative to the folder:
//!
//! - `frames.jsonl`: one frame per line, `{"scene", "frame", "rgb", …}`; the name of a frame is `scene/frame`. A line
//!   may name maps of the size of the image: `depth`, in metres as `.npy` or in units of `depth_scale` metres as PNG;
//!   `sem`, the classes; and `over`, the segments. `over_source` is `renderer` or `connected_components` (objects) or
//!   `superpixel` (parts). Also optional: `depth_kind` (`planar` or `euclid`), `intrinsics` (`{"fx", "fy", "cx",
//!   "cy"}`), `room_gt`, `t` (seconds) and `pose`; and `dark`, photographs of the same scene in the dark: a path,
//!   `{"path", "ev", "name"}`, or a list of them ([`dark_photos`](super::dark_photos)).
//! - `classes.json`: the class of each number in `sem` ([`darkqa_base::labels`]).
//! - `dataset.json`: `{"schema": "darkqa.dataset/1", "name", "depth_kind", "light"}`; the last three are optional.
//!   `light` is `lit`, or `dark` for photographs that were taken in the dark.
//! - `scenes/<scene>/segments.json`: the segments that have names, `{"7": {"name", "canonical", "region"}}`.
//!
//! Without `frames.jsonl`, every PNG, JPEG, WebP, TIFF and BMP file in the folder is a frame, named by its file name.
//! The questions are in `questions.jsonl` in the same folder.
//!
//! Image files among the paths of a folder: [`ImagePaths`].

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;

use super::dark_photos::DarkField;
use super::dataset::{Dataset, stem};
use super::maps::{DepthFile, FrameFacts, MapPaths};
use super::openeqa::{FrameFile, ImageSource};
use super::ready_made::{self, SetArgs, SkipBad};
use super::root::Root;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{entries, json, json_lines};
use darkqa_base::labels;
use darkqa_base::types::images::is_image_ending;
use darkqa_base::types::{DepthKind, FrameId, Intrinsics, Labels, SegmentName, Segmentation, SetLight};
use darkqa_pictures::image_file::format::SUPPORTED_FORMATS;

/// File that lists the frames.
pub(super) const FRAMES: &str = "frames.jsonl";

/// File of the questions about the frames.
pub(super) const QUESTIONS: &str = "questions.jsonl";

/// File with the class of each number in the semantic maps.
const CLASSES: &str = "classes.json";

/// File with the name of the data set, its light and the kind of its depth.
const DATASET: &str = "dataset.json";

/// Value of `schema` in `dataset.json`.
const SCHEMA: &str = "darkqa.dataset/1";

/// File with the names of the segments of a scene.
const SEGMENTS: &str = "segments.json";

/// Fields of `dataset.json` that are used.
#[derive(Debug, Default, Deserialize)]
struct DataSetInfo {
    schema: String,
    name: Option<String>,
    depth_kind: Option<DepthKind>,
    light: Option<SetLight>,
}

/// Scene → segment number → name. The file of each scene is read once.
type SegmentNames = BTreeMap<String, Arc<BTreeMap<u32, SegmentName>>>;

/// Fields of a line of `frames.jsonl` that are used.
#[derive(Debug, Deserialize)]
struct FrameFields {
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

/// Treatment of listed files that do not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MissingFiles {
    /// Refuse the list.
    Refuse,
    /// Report a missing file when it is read, so that `--skip bad` can leave out its frame.
    Defer,
}

impl MissingFiles {
    pub(super) fn new(skip: Option<SkipBad>) -> Self {
        match skip {
            Some(_) => Self::Defer,
            None => Self::Refuse,
        }
    }
}

impl FrameFields {
    /// Converts the line to the files of its frame and the facts about it.
    fn into_source(
        self,
        root: &Root,
        info: &DataSetInfo,
        names: &SegmentNames,
        missing: MissingFiles,
    ) -> Result<ImageSource, String> {
        let resolve = |file: PathBuf| match missing {
            MissingFiles::Refuse => root.file(root.folder(), &file),
            MissingFiles::Defer => root.path(root.folder(), &file),
        };
        let rgb = resolve(self.rgb)?;
        let dark = match self.dark {
            Some(dark) => dark.into_photos(resolve)?,
            None => Vec::new(),
        };
        let depth = self.depth.map(resolve).transpose()?;
        let maps = MapPaths {
            depth: depth.map(|path| DepthFile::new(path, self.depth_scale)).transpose()?,
            semantic: self.sem.map(resolve).transpose()?,
            segments: self.over.map(resolve).transpose()?,
        };
        let focal = self.intrinsics.map_or(1.0, |camera| camera.fx.min(camera.fy));
        if !(focal.is_finite() && focal > 0.0) {
            return Err(format!("a focal length of {focal} pixels; fx and fy above 0 expected"));
        }
        let facts = FrameFacts {
            depth_kind: self.depth_kind.or(info.depth_kind).unwrap_or_default(),
            intrinsics: self.intrinsics,
            segmentation: match self.over_source {
                Some(SegmentSource::Superpixel) => Segmentation::Parts,
                Some(SegmentSource::Renderer | SegmentSource::ConnectedComponents) | None => Segmentation::Instances,
            },
            names: names.get(&self.scene).cloned().unwrap_or_default(),
            room: self.room_gt,
            scene: self.scene,
        };
        Ok(ImageSource::File(Box::new(FrameFile { rgb, maps, facts, dark })))
    }
}

/// Opens an image file or a folder of frames, without questions. Paths may also lead into the folders in `further`.
/// No image is read.
pub fn open_images(path: &Path, further: &[PathBuf]) -> Result<Dataset> {
    let sources = if path.is_dir() {
        let sources = sources(path, further, MissingFiles::Refuse)?;
        if !path.join(FRAMES).exists() {
            warn_of_subfolders(path, further)?;
        }
        sources
    } else {
        image(path)?
    };
    Ok(Dataset::new(stem(path), sources, Vec::new()))
}

/// Opens a folder of frames with the labels of its maps, without questions. No image is read.
pub fn open_frames(folder: &Path, further: &[PathBuf]) -> Result<Dataset> {
    if !folder.is_dir() {
        return Err(Error::usage("DATA", format_args!("{}: no such folder of frames", folder.display())));
    }
    frames(folder, further, MissingFiles::Refuse)
}

/// Opens a folder of frames with the labels of its maps, without questions; what is missing is refused or left out.
pub(super) fn frames(folder: &Path, further: &[PathBuf], missing: MissingFiles) -> Result<Dataset> {
    let root = Root::new(folder, further)?;
    let info = data_set_info(&root)?;
    let labels = labels(folder, further)?;
    let title = info.name.unwrap_or_default();
    let name = if title.is_empty() { stem(folder) } else { title.clone() };
    let dataset = Dataset::new(name, sources(folder, further, missing)?, Vec::new());
    Ok(dataset.with_title_and_labels(title, labels))
}

/// Labels of the semantic maps of a folder; `None` without a `classes.json`.
pub(super) fn labels(folder: &Path, further: &[PathBuf]) -> Result<Option<Labels>> {
    let classes = Root::new(folder, further)?.own_file(CLASSES)?;
    classes.map(|classes| labels::read(&classes)).transpose()
}

fn data_set_info(root: &Root) -> Result<DataSetInfo> {
    let Some(path) = root.own_file(DATASET)? else {
        return Ok(DataSetInfo::default());
    };
    let info: DataSetInfo = json(&path)?;
    if info.schema != SCHEMA {
        let problem = format_args!("schema {:?}; {SCHEMA:?} expected", info.schema);
        return Err(Error::data(path.display(), problem));
    }
    Ok(info)
}

/// Light in which the photographs of a folder were taken, from `dataset.json`; lit by default.
pub(super) fn light(folder: &Path, further: &[PathBuf]) -> Result<SetLight> {
    let info = data_set_info(&Root::new(folder, further)?)?;
    Ok(info.light.unwrap_or_default())
}

/// Names of the segments of a scene by number; empty without a `segments.json`.
fn segment_names(root: &Root, scene: &str) -> Result<Arc<BTreeMap<u32, SegmentName>>> {
    let below = Path::new("scenes").join(scene).join(SEGMENTS);
    let path = root.folder().join(&below);
    if !path.exists() {
        return Ok(Arc::default());
    }
    let path = root.file(root.folder(), &below).map_err(|problem| Error::data("scene", problem))?;
    let names: BTreeMap<u32, SegmentName> = json(&path)?;
    let canonical = labels::canonical();
    if let Some((id, name)) = names.iter().find(|(_, name)| !canonical.contains(&name.canonical)) {
        let problem = format_args!(
            "segment {id} ({:?}) has the class {:?}, which is not a class of mpcat40",
            name.name, name.canonical
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok(Arc::new(names))
}

/// Opens a folder of frames with its questions; `questions` replaces its `questions.jsonl`.
pub(super) fn open(folder: &Path, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
    let missing = MissingFiles::new(set.bad);
    let root = Root::new(folder, &set.root.data_root)?;
    let file = match questions {
        Some(named) => Some(named.to_owned()),
        None => root.own_file(QUESTIONS)?,
    };
    let Some(file) = file else {
        if folder.join(FRAMES).exists() && folder.join(CLASSES).exists() {
            return frames(folder, &set.root.data_root, missing);
        }
        let is_empty = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
        let what = if is_empty { "the folder is empty: " } else { "" };
        let problem = format_args!(
            "{what}no {QUESTIONS} or questions.csv in this folder, and no {FRAMES} with {CLASSES} to make questions of; --questions FILE names some, and --ask home asks about photographs without any"
        );
        return Err(Error::data(folder.display(), problem));
    };
    if questions.is_none()
        && let Some(other) = other_question_files(folder).next()
    {
        tracing::warn!(
            "{0} is not read, because {QUESTIONS} is in the same folder; --data {0} reads it alone",
            other.display()
        );
    }
    let read = ready_made::questions_about_frames(&file, set)?;
    Dataset::new(stem(folder), sources(folder, &set.root.data_root, missing)?, Vec::new())
        .with_file_questions(&file, read, set.bad)
}

/// Question files of a folder other than [`QUESTIONS`].
pub(super) fn other_question_files(folder: &Path) -> impl Iterator<Item = PathBuf> {
    ["csv", "tsv", "json", "parquet"]
        .map(|ending| format!("questions.{ending}"))
        .map(|name| folder.join(name))
        .into_iter()
        .filter(|file| file.exists())
}

/// True if the place is a folder of frames, not a ready-made set.
pub(super) fn is_folder_of_frames(place: &Path, questions: Option<&Path>) -> bool {
    place.is_dir()
        && (questions.is_some()
            || [FRAMES, QUESTIONS].iter().any(|name| place.join(name).exists())
            || !ready_made::is_set_folder(place))
}

/// Frames of a folder: those in `frames.jsonl`, or every image if there is no such list.
pub(super) fn sources(
    folder: &Path,
    further: &[PathBuf],
    missing: MissingFiles,
) -> Result<BTreeMap<FrameId, ImageSource>> {
    let root = Root::new(folder, further)?;
    match root.own_file(FRAMES)? {
        Some(list) => listed_frames(&root, &list, missing),
        None => images(&root),
    }
}

/// A single frame from an image file, named by its file name.
pub(super) fn image(path: &Path) -> Result<BTreeMap<FrameId, ImageSource>> {
    fs::metadata(path).map_err(|e| Error::file(path, "read", e))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let id = FrameId(name.into_owned());
    Ok([(id, ImageSource::image(path.to_owned()))].into())
}

fn listed_frames(root: &Root, list: &Path, missing: MissingFiles) -> Result<BTreeMap<FrameId, ImageSource>> {
    let (info, mut names) = (data_set_info(root)?, SegmentNames::new());
    let mut sources = BTreeMap::new();
    for (number, line) in json_lines::<FrameFields>(list)? {
        let id = FrameId(format!("{}/{}", line.scene, line.frame));
        if !names.contains_key(&line.scene) {
            let scene_names = segment_names(root, &line.scene).map_err(|problem| Error::line(list, number, problem))?;
            names.insert(line.scene.clone(), scene_names);
        }
        let source =
            line.into_source(root, &info, &names, missing).map_err(|problem| Error::line(list, number, problem))?;
        if sources.insert(id.clone(), source).is_some() {
            let problem = format_args!("a second frame {:?}", id.0);
            return Err(Error::line(list, number, problem));
        }
    }
    Ok(sources)
}

/// Every image of a folder. Links out of the folder are not followed; a warning names the first.
fn images(root: &Root) -> Result<BTreeMap<FrameId, ImageSource>> {
    let folder = root.folder();
    let mut sources = BTreeMap::new();
    let mut links_out = Vec::new();
    let all = root.entries(folder, &mut links_out)?;
    root.warn_of_links_out(&links_out);
    let found = ImagePaths::from_paths(all.clone());
    for path in &found.images {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        insert_image(&mut sources, name.into_owned(), path)?;
    }
    if sources.is_empty() {
        let questions = folder.join(QUESTIONS);
        let remedy = match all.iter().find(|path| has_images(path)) {
            Some(inner) if questions.exists() => format!(
                "; name {} if its lines have paths such as {}/IMAGE",
                questions.display(),
                inner.file_name().unwrap_or_default().to_string_lossy()
            ),
            Some(inner) => format!("; a folder in it has some: name that one, as {}", inner.display()),
            None => String::new(),
        };
        let unread = found.unsupported_note().map_or(String::new(), |unread| format!("; {unread}"));
        let problem =
            format_args!("neither a {FRAMES} nor any {SUPPORTED_FORMATS} image in this folder{unread}{remedy}");
        return Err(Error::data(folder.display(), problem));
    }
    found.warn_of_unsupported(folder);
    Ok(sources)
}

/// Warns if a folder in this one has images: they are not read. Links out of the folder and hidden folders are left
/// out.
fn warn_of_subfolders(folder: &Path, further: &[PathBuf]) -> Result<()> {
    let root = Root::new(folder, further)?;
    let inner: Vec<PathBuf> = root
        .entries(folder, &mut Vec::new())?
        .into_iter()
        .filter(|path| !is_hidden(path) && has_images(path))
        .collect();
    if let Some(first) = inner.first() {
        let count = match inner.len() {
            1 => "the images of 1 folder in it are not read:".to_owned(),
            n => format!("the images of {n} folders in it are not read, as"),
        };
        tracing::warn!("{}: {count} {}; name such a folder, too, to read them", folder.display(), first.display());
    }
    Ok(())
}

/// Adds an image as a frame of this name.
///
/// # Errors
/// If another image has the name: the bytes of a file name that are not UTF-8 all become the replacement character.
pub(super) fn insert_image(sources: &mut BTreeMap<FrameId, ImageSource>, name: String, path: &Path) -> Result<()> {
    let image = ImageSource::image(path.to_owned());
    if sources.insert(FrameId(name), image).is_some() {
        let problem = "another file has the same name but for bytes that are not UTF-8; rename it";
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// True if the path is a folder with an image directly in it.
fn has_images(folder: &Path) -> bool {
    entries(folder).is_ok_and(|inner| inner.iter().any(|path| is_image(path)))
}

/// Extensions of image formats that are not supported.
const UNSUPPORTED: [&str; 28] = [
    "heic", "heif", "hif", "avif", "gif", "jxl", "jp2", "j2k", "jpf", "psd", "tga", "ico", "ppm", "pgm", "pnm", "pfm",
    "hdr", "dng", "cr2", "cr3", "nef", "arw", "orf", "raf", "rw2", "pef", "srw", "svg",
];

/// Image files in supported and in unsupported formats.
pub struct ImagePaths {
    pub(super) images: Vec<PathBuf>,
    unsupported: Vec<PathBuf>,
}

impl ImagePaths {
    /// Sorts paths by their extensions. Folders and other files are left out.
    pub fn from_paths(paths: impl IntoIterator<Item = PathBuf>) -> Self {
        let (mut images, mut unsupported) = (Vec::new(), Vec::new());
        for path in paths {
            if is_image(&path) {
                images.push(path);
            } else if is_file_with_extension(&path, |extension| UNSUPPORTED.contains(&&*extension.to_ascii_lowercase()))
            {
                unsupported.push(path);
            }
        }
        Self { images, unsupported }
    }

    /// Message with the number of unsupported images and the name of the first; `None` if all are supported.
    pub(super) fn unsupported_note(&self) -> Option<String> {
        let first = self.unsupported.first()?;
        let count = match self.unsupported.len() {
            1 => "1 file looks like an image and is not read".to_owned(),
            n => format!("{n} files look like images and are not read"),
        };
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        Some(format!("{count}, as {name}; {SUPPORTED_FORMATS} expected, so convert them first"))
    }

    /// Warns if the folder has images in unsupported formats.
    pub fn warn_of_unsupported(&self, folder: &Path) {
        if let Some(note) = self.unsupported_note() {
            tracing::warn!("{}: {note}", folder.display());
        }
    }
}

/// True if the path is a file with the extension of a supported image format.
pub fn is_image(path: &Path) -> bool {
    is_file_with_extension(path, is_image_ending)
}

fn is_file_with_extension(path: &Path, is_wanted: impl Fn(&str) -> bool) -> bool {
    path.extension().and_then(|extension| extension.to_str()).is_some_and(is_wanted) && path.is_file()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use image::{GrayImage, ImageBuffer, Luma, RgbImage};
    use ndarray::array;

    use super::super::{DataSource, Photographs};
    use super::*;

    /// A folder of one image, its maps and a `frames.jsonl` of one line with these extra keys.
    fn folder(keys: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        RgbImage::new(2, 1).save(root.join("rgb.png")).unwrap();
        let ids = GrayImage::from_raw(2, 1, vec![3, 4]).unwrap();
        ids.save(root.join("sem.png")).unwrap();
        let units = ImageBuffer::<Luma<u16>, _>::from_raw(2, 1, vec![0, 1500]).unwrap();
        units.save(root.join("deep.png")).unwrap();
        let line = format!(r#"{{"scene":"a","frame":"0","rgb":"rgb.png"{keys}}}"#);
        fs::write(root.join(FRAMES), format!("\n{line}\n")).unwrap();
        let question = r#"{"id":1,"frame":"a/0","question":"?","choices":["x","y"],"answer":"x"}"#;
        fs::write(root.join(QUESTIONS), question).unwrap();
        folder
    }

    #[test]
    fn guessed_answer_format_is_reported() {
        let folder = folder("");
        for (answer, format) in [(r#""x""#, None), ("0", Some("answer = answer (index0)"))] {
            let question = format!(r#"{{"id":1,"frame":"a/0","question":"?","choices":["x","y"],"answer":{answer}}}"#);
            fs::write(folder.path().join(QUESTIONS), question).unwrap();
            let dataset = open(folder.path(), None, &SetArgs::default()).unwrap();
            let summary = dataset.summary().join("\n");
            match format {
                None => assert_eq!(summary, ""),
                Some(format) => assert!(summary.contains(format), "{summary}"),
            }
        }
    }

    #[test]
    fn frame_spelled_otherwise_is_named() {
        let folder = folder("");
        let question = r#"{"id":1,"frame":"A%2F0","question":"?","choices":["x","y"],"answer":"x"}"#;
        fs::write(folder.path().join(QUESTIONS), question).unwrap();
        let problem = open(folder.path(), None, &SetArgs::default()).unwrap_err();
        assert!(
            problem.to_string().contains("does not have (its frame \"a/0\" differs only in spelling)"),
            "{problem}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn names_alike_without_utf8_are_refused() {
        use std::os::unix::ffi::OsStrExt as _;

        let folder = tempfile::tempdir().unwrap();
        for name in [&b"\xE9.png"[..], b"\xE8.png"] {
            fs::write(folder.path().join(std::ffi::OsStr::from_bytes(name)), "").unwrap();
        }
        let listed = sources(folder.path(), &[], MissingFiles::Refuse).map(|_| ());
        let place = DataSource::Path(folder.path().to_owned());
        let searched = Photographs::open(&place, &SetArgs::default()).map(|_| ());
        for problem in [listed, searched] {
            let problem = problem.unwrap_err().to_string();
            assert!(problem.contains("not UTF-8; rename it"), "{problem}");
        }
    }

    #[test]
    fn frame_has_the_maps_of_its_line() {
        let id = FrameId("a/0".into());
        let bare = folder(r#","depth":null,"depth_scale":0.001"#);
        let frame = open(bare.path(), None, &SetArgs::default()).unwrap().frame(&id).unwrap();
        assert_eq!((&frame.id, frame.rgb.width()), (&id, 2));
        assert!(frame.depth.is_none() && frame.semantic.is_none() && frame.segments.is_none());
        let full = folder(r#","depth":"deep.png","depth_scale":0.002,"sem":"sem.png","over":"deep.png","t":1.5"#);
        let frame = open(full.path(), None, &SetArgs::default()).unwrap().frame(&id).unwrap();
        assert_eq!(frame.depth.unwrap(), array![[0, 3000]]);
        assert_eq!(frame.semantic.unwrap(), array![[3, 4]]);
        assert_eq!(frame.segments.unwrap(), array![[0, 1500]]);
    }

    fn refusal(folder: &Path) -> String {
        sources(folder, &[], MissingFiles::Refuse).err().unwrap().to_string()
    }

    #[test]
    fn folder_without_images_suggests_a_subfolder() {
        let folder = tempfile::tempdir().unwrap();
        assert!(refusal(folder.path()).ends_with("in this folder"), "{}", refusal(folder.path()));
        fs::create_dir(folder.path().join("inner")).unwrap();
        RgbImage::new(2, 1).save(folder.path().join("inner/a.png")).unwrap();
        assert!(refusal(folder.path()).ends_with("inner"), "{}", refusal(folder.path()));
    }

    #[test]
    fn missing_or_invalid_maps_are_errors() {
        for (keys, message) in [
            (r#","depth":"no.png","depth_scale":1"#, "no.png"),
            (r#","sem":"no.png""#, "no such file: "),
            (r#","over":"""#, "the path is empty"),
            (r#","depth":"deep.png""#, "depth_scale is missing"),
            (r#","depth":"deep.png","depth_scale":0"#, "depth_scale is 0;"),
            (r#","depth":"deep.png","depth_scale":"mm""#, "invalid type"),
        ] {
            let folder = folder(keys);
            let error = open(folder.path(), None, &SetArgs::default()).unwrap_err().to_string();
            assert!(error.contains("frames.jsonl, line 2: ") && error.contains(message), "{error}");
        }
    }

    #[test]
    fn byte_order_mark_is_ignored() {
        let folder = folder("");
        let list = folder.path().join(FRAMES);
        let text = fs::read_to_string(&list).unwrap();
        fs::write(&list, format!("\u{feff}{}", text.trim_start())).unwrap();
        assert!(open(folder.path(), None, &SetArgs::default()).is_ok());
    }

    #[test]
    fn error_names_the_broken_line_once() {
        let folder = folder("");
        fs::write(folder.path().join(FRAMES), "\n{\n").unwrap();
        let error = open(folder.path(), None, &SetArgs::default()).unwrap_err().to_string();
        assert!(error.ends_with("frames.jsonl, line 2: EOF while parsing an object"), "{error}");
    }

    #[test]
    fn files_are_sorted_by_extension() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["a.PNG", "b.webp", "c.tiff", "d.HEIC", "e.avif", "f.txt", "g"];
        let paths = names.map(|name| folder.path().join(name));
        for path in &paths {
            fs::write(path, "").unwrap();
        }
        let inner = folder.path().join("inner.png");
        fs::create_dir(&inner).unwrap();
        let found = ImagePaths::from_paths(paths.into_iter().chain([inner]));
        let images: Vec<_> = found.images.iter().map(|path| path.file_name().unwrap()).collect();
        assert_eq!(images, ["a.PNG", "b.webp", "c.tiff"]);
        assert_eq!(
            found.unsupported_note().unwrap(),
            "2 files look like images and are not read, as d.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected, so convert them first"
        );
        assert_eq!(ImagePaths::from_paths([folder.path().join("f.txt")]).unsupported_note(), None);
    }
}
