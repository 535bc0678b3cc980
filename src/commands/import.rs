//! `import`: writes the frames of another data set in the common interface.

mod conversion;
mod frame_writer;
mod lerobot;
mod lerobot_frames;
mod mcap_files;
mod recording;
mod video;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

use clap::{Args, Subcommand};
use ndarray::Array2;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use self::conversion::{conversion, not_a_bag};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::open;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Decides, FrameId, InputNote, Rgb};
use darkqa_data::FolderArgs;
use darkqa_data::frame_folder::{self, FrameOutput};
use darkqa_data::import::keyframes::{KeyFrameArgs, choose};
use darkqa_data::import::{Adapter, DataSetKind, FrameMaps, ListedFrame, MapArgs, open_all, unread_files};
use darkqa_engine::images::frames::InputTally;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::{ThreadArgs, pool};
use darkqa_pictures::{ImageFile, png};
use darkqa_report::text::words::first_names;
use darkqa_runs::Outcome;

/// Plausible typical depths of indoor frames, in millimetres (chosen). Outside this range, the depth scale is probably
/// wrong.
const ROOM_DEPTHS: std::ops::RangeInclusive<u32> = 300..=15_000;

/// The script that renders HM3D with habitat-sim in the layout that `import habitat` reads.
const HM3D_SCRIPT: &str = include_str!("../data/import/hm3d_frames.py");

/// Maximum number of words without a class that are printed.
const MAX_NAMED: usize = 12;

/// `import`, or another form of it.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct ImportCommand {
    /// The form; `None` for an import.
    #[command(subcommand)]
    form: Option<ImportForm>,
    /// Flags of the import.
    #[command(flatten)]
    import: Option<ImportArgs>,
}

/// The other forms of `import`.
#[derive(Debug, Subcommand)]
enum ImportForm {
    /// Print the Python script that renders HM3D with habitat-sim as `import habitat` reads it
    Script {
        /// The kind of data set; habitat has a script
        #[arg(value_name = "KIND", value_enum, add = Decides::Nothing)]
        kind: DataSetKind,
    },
    /// Take frames of a recording of a robot (ROS 2, Foxglove); without --out, list its topics with images
    Mcap(Box<recording::McapArgs>),
    /// Show how a bag of ROS 1 or 2 is converted into a file that `import mcap` reads
    Rosbag {
        /// The bag
        #[arg(value_name = "FILE", add = Decides::Nothing)]
        file: PathBuf,
    },
    /// Take frames of the episodes of a LeRobot data set; without --out, list its cameras
    #[command(name = "lerobot")]
    LeRobot(Box<lerobot::LeRobotArgs>),
    /// Take frames of a video, decoded by ffmpeg; without --out, describe it
    Video(Box<video::VideoArgs>),
}

/// The flags of `import`.
#[derive(Debug, Args)]
#[group(arg = "kind")]
struct ImportArgs {
    /// The kind of data set in --src
    #[arg(value_name = "KIND", value_enum, add = Decides::Pixels)]
    kind: DataSetKind,
    /// The data set, laid out as src/docs/importing.md shows; repeatable: several folders are joined, each scene with
    /// its folder's number if two have one of its name
    #[arg(long, value_name = "DIR", required = true, add = Decides::Pixels)]
    src: Vec<PathBuf>,
    /// Where the frames go, in the common interface
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: PathBuf,
    /// The name the data set gives itself; questions are named by it; default: the kind
    #[arg(long, value_name = "NAME", add = Decides::Reply)]
    name: Option<String>,
    /// Facts about the maps that the data set does not state.
    #[command(flatten)]
    map_args: MapArgs,
    /// The flags that select key frames.
    #[command(flatten)]
    key_frames: KeyFrameArgs,
    /// Write into a folder that holds frames already
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    force: bool,
    /// The reading of frames.
    #[command(flatten)]
    folders: FolderArgs,
    /// The number of threads.
    #[command(flatten)]
    threads: ThreadArgs,
}

/// Imports frames, or prints the script that makes them.
///
/// # Errors
/// If there are no frames, the folder holds frames already, the typical depth is not that of a room, or no frame could
/// be read; or if the kind has no script.
pub(crate) fn import(command: &ImportCommand, progress: &Progress) -> Result<Outcome> {
    match (&command.form, &command.import) {
        (Some(ImportForm::Script { kind }), _) => print_script(*kind),
        (Some(ImportForm::Mcap(args)), _) => recording::import(args, progress),
        (Some(ImportForm::Rosbag { file }), _) => Err(rosbag_error(file)?),
        (Some(ImportForm::LeRobot(args)), _) => lerobot::import(args, progress),
        (Some(ImportForm::Video(args)), _) => video::import(args, progress),
        (None, Some(args)) => import_frames(args, progress),
        (None, None) => Err(Error::usage("KIND", "a kind of data set is missing")),
    }
}

fn print_script(kind: DataSetKind) -> Result<Outcome> {
    if kind != DataSetKind::Habitat {
        let problem = format_args!("only the kind habitat has a script, not {kind}");
        return Err(Error::usage("KIND", problem));
    }
    Ok(Outcome::text(Status::Complete, HM3D_SCRIPT.to_owned()))
}

/// The error that explains how to convert a bag. Bags of ROS 1 are not read directly, because the crate rosbag (0.6.3)
/// maps whole files into memory and needs bzip2 and lz4 in C.
///
/// # Errors
/// If the file cannot be read.
fn rosbag_error(file: &Path) -> Result<Error> {
    if !file.is_dir() {
        open(file).map_err(|e| Error::file(file, "read", e))?;
    }
    let problem = conversion(file).unwrap_or_else(|| not_a_bag(file));
    Ok(Error::data(file.display(), problem))
}

/// Imports frames. If one fails, the error is logged and counted, and the others continue.
fn import_frames(args: &ImportArgs, progress: &Progress) -> Result<Outcome> {
    let (src, out) = (&args.src, &args.out);
    let list = out.join("frames.jsonl");
    if !args.force && list.exists() {
        let problem = "the folder has frames already; --force overwrites them, another --out keeps both";
        return Err(Error::data(list.display(), problem));
    }
    let adapter = open_all(args.kind, src, &args.map_args, &args.folders.root.data_root)?;
    let frames = choose(&adapter.listing().frames, args.key_frames.selection(), args.key_frames.fps)?;
    let workers = pool(args.threads.threads)?;
    let (bar, tally) = (progress.bar("frames", frames.len()), InputTally::default());
    let written: Vec<Option<WrittenFrame>> = workers.install(|| {
        frames
            .par_iter()
            .map(|frame| {
                let written = write_frame(args, out, &*adapter, frame, &tally);
                bar.inc();
                written.map_err(|e| tracing::error!("{}/{}: {e}", frame.scene, frame.frame)).ok()
            })
            .collect()
    });
    drop(bar);
    tally.warn();
    let failed = written.iter().filter(|written| written.is_none()).count();
    let written: Vec<WrittenFrame> = written.into_iter().flatten().collect();
    if written.is_empty() {
        let folders: Vec<String> = src.iter().map(|folder| folder.display().to_string()).collect();
        return Err(Error::data(folders.join(", "), "no frame of it could be read"));
    }
    if adapter.assumes_metres() {
        check_unit(&written)?;
    }
    let note = depth_note(&written)?
        + &missing_maps_note(&written)
        + &depth_folders_note(&written)
        + &unread_files(src, &*adapter)?.line();
    let mut scenes: Vec<&str> = frames.iter().map(|frame| frame.scene.as_str()).collect();
    scenes.dedup();
    let listing = adapter.listing();
    for scene in &scenes {
        if let Some(names) = listing.names.get(*scene) {
            frame_folder::write_segment_names(out, scene, names)?;
        }
    }
    let mut info = json!({
        "schema": "darkqa.dataset/1",
        "name": args.name.as_deref().unwrap_or(&args.kind.to_string()),
        "label_space": listing.labels.space,
        "depth_kind": listing.depth_kind,
        "source": args.kind.to_string(),
    });
    if let Some(renders) = &listing.renders {
        info["renders"] = renders.clone();
    }
    let lines = written.iter().map(|written| &written.line);
    frame_folder::write_folder_files(out, &listing.labels, &info, lines)?;
    let listed = listing.frames.len();
    let mut output = format!(
        "{}: {} of {}{}{}\n{note}",
        out.display(),
        counted(written.len(), "frame"),
        counted(scenes.len(), "scene"),
        if listed == frames.len() { String::new() } else { format!(", chosen from {listed}") },
        if failed == 0 { String::new() } else { format!(", {failed} failed") }
    );
    output.push_str(&unlisted_note(&listing.unlisted));
    Ok(Outcome::wrote(out, Outcome::complete_if(failed == 0), output))
}

/// A frame that was written.
struct WrittenFrame {
    /// Line in `frames.jsonl`.
    line: Map<String, Value>,
    /// Median depth in millimetres; `None` without a depth map.
    depth: Option<u32>,
    /// Greatest depth in millimetres; 0 without depth.
    farthest: u32,
    /// Folder of the depth map, for data sets with several depths per frame.
    depth_folder: Option<&'static str>,
}

/// The image of a frame with its maps. An image with maps keeps its stored orientation, which the maps have; an image
/// without maps is turned as its file states.
struct ImportedImage {
    file: ImageFile,
    rgb: Rgb,
    maps: FrameMaps,
}

impl ImportedImage {
    fn read(args: &ImportArgs, adapter: &dyn Adapter, frame: &ListedFrame) -> Result<Self> {
        let file = ImageFile::open(&frame.rgb, args.folders.decode.rule())?.ignoring_orientation();
        let rgb = file.decode()?;
        let maps = adapter.read_maps(frame, &rgb)?;
        let has_maps = maps.depth.is_some() || maps.semantic.is_some() || maps.segments.is_some();
        if has_maps || file.note() == InputNote::default() {
            return Ok(Self { file, rgb, maps });
        }
        let file = file.applying_orientation();
        let rgb = file.decode()?;
        Ok(Self { file, rgb, maps })
    }
}

fn write_frame(
    args: &ImportArgs,
    out: &Path,
    adapter: &dyn Adapter,
    frame: &ListedFrame,
    tally: &InputTally,
) -> Result<WrittenFrame> {
    for name in [&frame.scene, &frame.frame] {
        let mut parts = Path::new(name).components();
        if name.is_empty() || !parts.all(|part| matches!(part, Component::Normal(_))) {
            let problem = "this name of a scene or frame leads out of the output folder";
            return Err(Error::data(format_args!("{name:?}"), problem));
        }
    }
    let ImportedImage { file, rgb, maps } = ImportedImage::read(args, adapter, frame)?;
    let note = file.note();
    tally.add(&FrameId(frame.rgb.display().to_string()), &note);
    let output = FrameOutput { out, scene: &frame.scene, frame: &frame.frame };
    let mut line = output.line(rgb.width(), rgb.height());
    let source = frame.rgb.file_name().map(|name| name.to_string_lossy());
    line.insert("source".to_owned(), json!(source));
    // Files other than plain PNG are copied unchanged, so that they are decoded as everywhere else.
    let image = if file.extension() == "png" && note == InputNote::default() {
        output.write("rgb", "png", &png(&rgb)?)?
    } else {
        output.write("rgb", file.extension(), file.bytes())?
    };
    line.insert("rgb".to_owned(), json!(image));
    let FrameMaps { depth, semantic, segments, room } = maps;
    let median = depth.as_ref().and_then(median);
    let farthest = depth.iter().flatten().copied().max().unwrap_or(0);
    let depth_folder = adapter.depth_folder(frame);
    if let Some(depth) = &depth {
        output.write_depth(&mut line, depth, adapter.listing().depth_kind)?;
    }
    if let Some(semantic) = &semantic {
        output.write_semantic(&mut line, semantic)?;
    }
    if let Some(segments) = &segments {
        output.write_segments(&mut line, segments, adapter.listing().segmentation)?;
    }
    // Intrinsics belong to the stored orientation of the image.
    let is_stored = note.orientation.is_none();
    let intrinsics = is_stored.then(|| adapter.camera(frame, &rgb)).flatten();
    for (key, value) in [
        ("t", json!(frame.time)),
        ("pose", json!(frame.pose)),
        ("intrinsics", json!(intrinsics)),
        ("room_gt", json!(frame.room.clone().or(room))),
        ("depth_from", json!(depth_folder)),
    ] {
        if !value.is_null() {
            line.insert(key.to_owned(), value);
        }
    }
    Ok(WrittenFrame { line, depth: median, farthest, depth_folder })
}

/// The median of all depths above 0, in millimetres; `None` if no depth is above 0.
fn median(depth: &Array2<u32>) -> Option<u32> {
    let mut depths: Vec<u32> = depth.iter().copied().filter(|depth| *depth > 0).collect();
    let middle = depths.len().checked_sub(1)? / 2;
    Some(*depths.select_nth_unstable(middle).1)
}

/// Checks that depth without a stated unit is not normalised: values of 0..1 in all frames, as habitat-lab gives them
/// by default, are either a share of the sensor's range or a scene of which nothing is farther than a metre.
///
/// # Errors
/// If no depth is above 1.
fn check_unit(written: &[WrittenFrame]) -> Result<()> {
    let farthest = written.iter().map(|written| written.farthest).max();
    let Some(farthest @ 1..=1_000) = farthest else {
        return Ok(());
    };
    let problem = format_args!(
        "all values are in 0..1 (the greatest is {}): depth normalised to the range of its sensor, as habitat-lab gives it by default (normalize_depth), or metres; state the metres of the value 1, for example --depth-scale 10 for habitat-lab's default of max_depth, or --depth-scale 1 for metres",
        metres(farthest)
    );
    Err(Error::data("depth", problem))
}

/// The note about the typical depth.
///
/// # Errors
/// If the typical depth is not plausible for rooms.
fn depth_note(written: &[WrittenFrame]) -> Result<String> {
    let mut medians: Vec<u32> = written.iter().filter_map(|written| written.depth).collect();
    let Some(middle) = medians.len().checked_sub(1) else {
        return Ok("no depth: there will be no questions about the closest object\n".to_owned());
    };
    medians.sort_unstable();
    let typical = medians[middle / 2];
    if !ROOM_DEPTHS.contains(&typical) {
        let problem = format_args!(
            "the typical depth of the frames is {} m, but that of rooms is between {} and {} m; set --depth-scale to the metres per unit of depth",
            metres(typical),
            metres(*ROOM_DEPTHS.start()),
            metres(*ROOM_DEPTHS.end())
        );
        return Err(Error::data("depth", problem));
    }
    Ok(format!("typical depth: {:.2} m\n", metres(typical)))
}

fn metres(depth: u32) -> f64 {
    f64::from(depth) / 1000.0
}

/// The note about frames without a map, for each kind of map that only some frames have, and about missing class maps.
fn missing_maps_note(written: &[WrittenFrame]) -> String {
    let mut note = String::new();
    for (key, noun) in [("depth", "depth"), ("sem", "class map"), ("over", "segments")] {
        let lacking = written.iter().filter(|written| !written.line.contains_key(key)).count();
        if lacking == written.len() && key == "sem" {
            note += "no class maps: there will be no questions by rule\n";
        } else if lacking > 0 && lacking < written.len() {
            let frames = counted(written.len(), "frame");
            let _ = writeln!(note, "without {noun}: {lacking} of {frames}");
        }
    }
    note
}

/// The note about the folders that depth was read from; empty if the data set has one depth per frame.
fn depth_folders_note(written: &[WrittenFrame]) -> String {
    let mut counts = BTreeMap::new();
    for folder in written.iter().filter_map(|written| written.depth_folder) {
        *counts.entry(folder).or_insert(0_usize) += 1;
    }
    let counts: Vec<String> = counts.iter().map(|(folder, count)| format!("{folder} {count}")).collect();
    if counts.is_empty() {
        return String::new();
    }
    format!("frames by the folder of their depth: {}\n", counts.join(", "))
}

/// The note about words for which no table has a class; empty if there are none.
fn unlisted_note(unlisted: &BTreeMap<String, usize>) -> String {
    if unlisted.is_empty() {
        return String::new();
    }
    let mut list: Vec<(&String, &usize)> = unlisted.iter().collect();
    list.sort_by_key(|(word, count)| (std::cmp::Reverse(**count), *word));
    let named: Vec<String> = list.iter().map(|(word, count)| format!("{word:?} {count}")).collect();
    format!("without a class of mpcat40, taken as misc: {}\n", first_names(&named, MAX_NAMED))
}
