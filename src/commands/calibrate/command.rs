//! `calibrate`: measures a camera from frames of its sensor, and writes a file for `--noise camera`.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::commands::calibrate::report;
use crate::commands::calibrate::{
    CalibrateSettings, CameraFit, Cfa, Crop, ReadOptions, Recording, calibrate as measure, camera_file,
};
use crate::data::PixelLimit;
use crate::engine::images::progress::Progress;
use crate::engine::images::workers::{ThreadArgs, pool};
use crate::error::{Error, Result};
use crate::files::write;
use crate::runs::Outcome;
use crate::types::Decides;
use crate::types::manifests::Status;

/// The flags of `calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    /// The recording: DIR/SETTING/ for each ISO or gain, in it bias/, flat-NAME/ for each exposure (pairs of evenly lit
    /// frames), and if you have them dark-NAME/ and white/; or DIR/frames.csv with the columns file, setting, kind
    /// (bias, flat, dark, white), exposure
    ///
    /// Frames are mosaics of one channel as 16-bit PNG, TIFF or binary PGM, as `dcraw -D -4 -T -t 0` (`-t 0`: not
    /// turned) and rawpy's raw_image_visible give them. RAW files of makers (DNG, CR2, NEF) are not read.
    #[arg(value_name = "DIR", add = Decides::Pixels)]
    pub recording: PathBuf,
    /// The camera file to write, for --noise camera, with the ending .toml; its figure goes beside it, with the ending
    /// .svg
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The colour filters of the upper left corner of the frames, row by row; mono for none
    #[arg(long, value_enum, default_value_t, add = Decides::Pixels)]
    pub cfa: Cfa,
    /// The black level in ADU; default: the whole number nearest to the mean of all bias frames
    #[arg(long, value_name = "CODE", add = Decides::Pixels)]
    pub black: Option<u16>,
    /// The code of white; default: the greatest code of the frames in white/
    #[arg(long, value_name = "CODE", add = Decides::Pixels)]
    pub white: Option<u16>,
    /// Use only this part of each frame, in sites: to leave out a masked border; default: all of it
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", add = Decides::Pixels)]
    pub crop: Option<Crop>,
    /// The name of the camera; default: the name of DIR
    #[arg(long, value_name = "NAME", add = Decides::Pixels)]
    pub name: Option<String>,
    /// Print the numbers as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// The maximum size of a frame.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Measures a camera and writes its file and figure.
///
/// # Errors
/// If a frame cannot be used, the recording is unsuitable, or a file cannot be written.
pub(crate) fn calibrate(args: &CalibrateArgs, progress: &Progress) -> Result<Outcome> {
    if args.out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
        let problem = format!(
            "{} does not end in .toml, by which --noise camera recognises a camera file; its figure gets the ending .svg",
            args.out.display()
        );
        return Err(Error::usage("--out", problem));
    }
    let figure = args.out.with_extension("svg");
    let recording = Recording::open(&args.recording)?;
    let settings = settings(args)?;
    let workers = pool(args.threads.threads)?;
    let bar = progress.bar("settings", recording.settings());
    let camera = workers.install(|| measure(&args.recording, &recording, &settings, || bar.inc()))?;
    drop(bar);
    write(&args.out, camera_file(&camera)?.as_bytes())?;
    write(&figure, report::figure(&camera)?.as_bytes())?;
    Ok(Outcome::wrote(&args.out, Status::Complete, output(args, &camera, &figure)?))
}

fn settings(args: &CalibrateArgs) -> Result<CalibrateSettings> {
    let name = match &args.name {
        Some(name) => name.clone(),
        None => folder_name(&args.recording)?,
    };
    Ok(CalibrateSettings {
        read: ReadOptions { cfa: args.cfa, crop: args.crop, most_pixels: args.limit.max_pixels.get() },
        black: args.black,
        white: args.white,
        name,
    })
}

/// The name of a folder, also for `.`.
fn folder_name(folder: &Path) -> Result<String> {
    let whole = folder.canonicalize().map_err(|e| Error::file(folder, "read", e))?;
    let name = whole.file_name().unwrap_or_default();
    Ok(name.to_string_lossy().into_owned())
}

/// The text for standard output.
fn output(args: &CalibrateArgs, camera: &CameraFit, figure: &Path) -> Result<String> {
    if args.json {
        for warning in &camera.warnings {
            tracing::warn!("{warning}");
        }
        return report::json(camera);
    }
    Ok(format!(
        "{}{}: the camera, for --noise camera; {}: its fits\n",
        report::table(camera),
        args.out.display(),
        figure.display()
    ))
}
