//! `import lerobot`: imports frames of the episodes of a LeRobot data set, or lists its cameras.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::frame_writer::summary;
use super::lerobot_frames::EpisodeImport;
use super::mcap_files::slug;
use super::recording::check_output;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::text::counted;
use darkqa_data::RootArgs;
use darkqa_data::import::lerobot::{Camera, LeRobotSet};
use darkqa_data::import::recording::SamplingArgs;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::ThreadArgs;
use darkqa_runs::Outcome;

/// The flags of `import lerobot`.
#[derive(Debug, Args)]
pub(crate) struct LeRobotArgs {
    /// The folder of the data set, with meta, data and videos; versions 2.0, 2.1 and 3.0
    #[arg(value_name = "DIR", add = Decides::Pixels)]
    folder: PathBuf,
    /// A camera whose images are taken, repeatable; default: the only camera
    // The name of the field is not `camera`, which is a key of `--noise`.
    #[arg(long = "camera", visible_alias = "topic", value_name = "NAME", add = Decides::Trials)]
    from_camera: Vec<String>,
    /// Where the frames go; default: nowhere, the cameras are listed
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: Option<PathBuf>,
    /// The name the data set gives itself; default: the name of the folder
    #[arg(long, value_name = "NAME", add = Decides::Reply)]
    name: Option<String>,
    /// The flags that choose frames, in each episode.
    #[command(flatten)]
    sampling: SamplingArgs,
    /// Write into a folder that holds frames already
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    force: bool,
    /// The number of threads.
    #[command(flatten)]
    threads: ThreadArgs,
    /// Further folders with files of the set.
    #[command(flatten)]
    root: RootArgs,
}

/// Lists the cameras of a LeRobot data set, or imports frames of them.
///
/// # Errors
/// If the folder has no LeRobot data set of a supported version, several cameras have images and none is named, or no
/// frame could be read.
pub(crate) fn import(args: &LeRobotArgs, progress: &Progress) -> Result<Outcome> {
    let set = LeRobotSet::open(&args.folder, &args.root.data_root)?;
    let Some(out) = &args.out else {
        return listing(&set, &args.folder);
    };
    check_output(out, args.force)?;
    let cameras = selected_cameras(&set, &args.folder, &args.from_camera)?;
    let drive = set_name(set.folder());
    let threads = args.threads.threads;
    let mut import = EpisodeImport::open(&set, cameras, &args.sampling, out, &drive, threads)?;
    import.read(progress)?;
    let info = json!({
        "schema": "darkqa.dataset/1",
        "name": args.name.as_deref().unwrap_or(&drive),
        "source": "lerobot",
        "codebase_version": set.version(),
        "robot_type": set.robot(),
        "fps": set.fps(),
        "topics": import.camera_names(),
    });
    finish(import, args, out, &info)
}

/// Writes the files about all frames, and returns the result of the import.
fn finish(mut import: EpisodeImport<'_>, args: &LeRobotArgs, out: &Path, info: &Value) -> Result<Outcome> {
    let place = args.folder.display().to_string();
    import.problems.warn();
    let scenes = import.writer.finish(&place, info)?;
    let failed = import.writer.warn_of_failures();
    let frames = import.writer.written.len();
    let mut output = summary(out, frames, scenes, "one episode", import.seen, failed);
    let _ = writeln!(
        output,
        "cameras: {}; {} of each episode",
        import.camera_names().join(", "),
        args.sampling.description()
    );
    let tasks: BTreeSet<&str> =
        import.writer.written.iter().filter_map(|written| written.line.get("task")?.as_str()).collect();
    let _ = writeln!(output, "{}; {} frames a second", counted(tasks.len(), "task"), import.set.fps());
    Ok(Outcome::wrote(out, Outcome::complete_if(failed == 0 && import.problems.is_empty()), output))
}

/// The name of a set: that of its folder, or of its repository in a hub's cache.
fn set_name(folder: &Path) -> String {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let part = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let repository = folder.ancestors().nth(2).map(part).filter(|name| name.starts_with("datasets--"));
    let name =
        repository.as_deref().and_then(|name| name.rsplit("--").next()).map_or_else(|| part(&folder), str::to_owned);
    Some(slug(&name)).filter(|name| !name.is_empty()).unwrap_or_else(|| "lerobot".to_owned())
}

/// The cameras to import: the named ones, or the only one with images.
fn selected_cameras<'a>(set: &'a LeRobotSet, folder: &Path, named: &[String]) -> Result<Vec<&'a Camera>> {
    let readable: Vec<&Camera> = set.cameras().iter().filter(|camera| !camera.is_depth).collect();
    let names: Vec<&str> = readable.iter().map(|camera| &*camera.name).collect();
    if names.is_empty() {
        return Err(no_cameras(set, folder));
    }
    let names = names.join(", ");
    if named.is_empty() {
        if readable.len() > 1 {
            let problem = format_args!("several cameras have images; choose one or more of {names}");
            return Err(Error::usage("--camera", problem));
        }
        return Ok(readable);
    }
    for name in named {
        let known = set.cameras().iter().find(|camera| camera.name == *name);
        let problem = match known {
            Some(camera) if camera.is_depth => {
                format!("{name} has depth, which is not read; cameras with images: {names}")
            }
            Some(_) => continue,
            None => format!("no camera {name:?}; cameras with images: {names}"),
        };
        return Err(Error::usage("--camera", problem));
    }
    let chosen: Vec<&Camera> = readable.into_iter().filter(|camera| named.contains(&camera.name)).collect();
    let slugs: BTreeSet<String> = chosen.iter().map(|camera| slug(&camera.name)).collect();
    if slugs.len() < chosen.len() {
        let problem = "two of the cameras give their frames the same names; import them into two folders";
        return Err(Error::usage("--camera", problem));
    }
    Ok(chosen)
}

/// The error for a set without a camera that can be read.
fn no_cameras(set: &LeRobotSet, folder: &Path) -> Error {
    let problem = match set.cameras() {
        [] => format!("no camera with images: its {} have numbers alone", counted(set.other_features(), "feature")),
        [camera, ..] => format!("no camera with images: {} has depth", camera.name),
    };
    Error::data(folder.display(), problem)
}

/// Lists the cameras.
///
/// # Errors
/// If no camera has images, or the episodes cannot be read.
fn listing(set: &LeRobotSet, folder: &Path) -> Result<Outcome> {
    if set.cameras().iter().all(|camera| camera.is_depth) {
        return Err(no_cameras(set, folder));
    }
    let episodes = set.episodes(&[])?;
    let rows: u64 = episodes.iter().fold(0, |rows, episode| rows.saturating_add(episode.length));
    let seconds = rows as f64 / set.fps();
    let cells: Vec<[String; 3]> = set
        .cameras()
        .iter()
        .map(|camera| {
            let form = if camera.is_depth { "not read: depth".to_owned() } else { camera.description.clone() };
            [camera.name.clone(), camera.form.name().to_owned(), form]
        })
        .collect();
    let width = |cell: usize| {
        let widths = cells.iter().map(|cells| cells[cell].chars().count());
        widths.max().unwrap_or(0)
    };
    let [names, forms, descriptions] = [0, 1, 2].map(width);
    let mut lines = String::new();
    for (camera, [name, form, description]) in set.cameras().iter().zip(&cells) {
        let rate = camera.fps.min(set.fps());
        let frames = (seconds * rate).round() as usize;
        let _ = writeln!(
            lines,
            "{name:names$}  {form:forms$}  {description:descriptions$}  {}, {rate:.1} Hz, {seconds:.1} s",
            counted(frames, "frame"),
        );
    }
    let _ = writeln!(lines, "{} without images", counted(set.other_features(), "further feature"));
    let tasks = set.tasks();
    let _ = writeln!(
        lines,
        "LeRobot {}: {}, {}",
        set.version(),
        counted(episodes.len(), "episode"),
        counted(tasks.as_ref().map_or(0, std::collections::BTreeMap::len), "task")
    );
    if let Err(e) = &tasks {
        tracing::warn!("{e}");
    }
    Ok(Outcome::text(Outcome::complete_if(tasks.is_ok()), lines))
}
