//! `import video`: imports frames of a video, decoded by ffmpeg.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Map, json};

use super::frame_writer::{ChosenFrame, FrameSource, FrameWriter, summary};
use super::mcap_files::drive_name;
use super::recording::{DriveArgs, warn_of_missed};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_data::import::recording::video::{Video, VideoFrames};
use darkqa_data::import::recording::{GreyBlocks, SamplingArgs, Stretches, TopicClock, seconds};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::pool;
use darkqa_runs::Outcome;

/// The flags of `import video`.
#[derive(Debug, Args)]
pub(crate) struct VideoArgs {
    /// A video that ffmpeg reads, such as .mp4, .mkv or .webm
    #[arg(value_name = "FILE", add = Decides::Pixels)]
    file: PathBuf,
    /// Where the frames go; default: nowhere, the video is described
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: Option<PathBuf>,
    /// The flags that choose frames.
    #[command(flatten)]
    sampling: SamplingArgs,
    /// How frames are written.
    #[command(flatten)]
    written: DriveArgs,
}

/// Describes a video, or imports frames of it.
///
/// # Errors
/// If ffmpeg is not on PATH or cannot decode the file, or there is no frame.
pub(crate) fn import(args: &VideoArgs, progress: &Progress) -> Result<Outcome> {
    let video = Video::open(&args.file)?;
    let Some(out) = &args.out else {
        return Ok(describe(&video));
    };
    args.written.check(out)?;
    let duration = match (args.sampling.max_frames, video.duration) {
        (Some(_), None) => {
            let problem = "the video does not state its duration, over which frames would be spread; use --every";
            return Err(Error::usage("--max-frames", problem));
        }
        (_, duration) => duration.unwrap_or(0.0),
    };
    let path = args.file.display().to_string();
    let drive = drive_name(&args.file);
    let mut sampler = args.sampling.sampler(duration);
    let mut stretches = Stretches::new(args.written.stretch);
    let mut clock = TopicClock::default();
    let mut writer = FrameWriter::new(out, drive.clone(), u16::MAX, pool(args.written.threads.threads)?);
    let bar = progress.bar("seconds", duration as usize);
    let mut frames = video.frames(args.sampling.interval())?;
    let (mut seen, mut last, mut problem) = (0, 0.0_f64, None);
    loop {
        let frame = match frames.next_frame() {
            Ok(Some(frame)) => frame,
            Ok(None) => break,
            Err(e @ Error::Usage { .. }) => return Err(e),
            Err(e) => {
                problem = Some(e);
                break;
            }
        };
        let place = stretches.place(&mut clock, frame.time, frame.time);
        let name = format!("{seen:06}");
        seen += 1;
        let shown_seconds = last as usize;
        last = last.max(seconds(frame.time));
        bar.advance(last as usize - shown_seconds);
        let is_chosen =
            sampler.is_due(place) && (!sampler.compares_pixels() || sampler.has_changed(GreyBlocks::new(&frame.image)));
        if is_chosen {
            let frame = ChosenFrame {
                topic: path.clone(),
                name,
                place,
                time: frame.time,
                log_time: frame.time,
                facts: Map::new(),
                source: FrameSource::Image(frame.image),
            };
            writer.push(frame, true);
        }
    }
    drop(bar);
    warn_of_missed(&sampler, &path);
    let colours = converted_colours(&frames, &path);
    let problem = match problem {
        Some(problem) => Some(format!("{problem}; frames up to there are kept")),
        None => frames.damage().map(|problem| format!("{path}: {problem}; its frames are kept")),
    };
    let is_whole = problem.is_none();
    let early = early_end(&video, last, args.sampling.interval());
    if let Some(warning) = problem.or(early.map(|early| format!("{path}: {early}"))) {
        tracing::warn!("{warning}");
    }
    let mut info = args.written.info("video", &drive);
    if let Some(colours) = &colours {
        info["colours"] = json!(colours);
    }
    let scenes = writer.finish(&path, &info)?;
    let failed = writer.warn_of_failures();
    let mut output = summary(out, writer.written.len(), scenes, &format!("{} s", args.written.stretch), seen, failed);
    let _ = writeln!(output, "video: {}; {}", video.stream, args.sampling.description());
    if let Some(colours) = colours {
        let _ = writeln!(output, "colours: {colours}");
    }
    Ok(Outcome::wrote(out, Outcome::complete_if(failed == 0 && is_whole), output))
}

/// The stream and the duration of a video.
fn describe(video: &Video) -> Outcome {
    let duration = video.duration.map_or("unknown duration".to_owned(), |duration| format!("{duration} s"));
    Outcome::text(Outcome::complete_if(true), format!("{}; {duration}\n", video.stream))
}

/// The colours of the frames and their conversion; `None` if the codes are taken as sRGB codes. Warns of clipped light
/// in HDR.
fn converted_colours(frames: &VideoFrames, path: &str) -> Option<String> {
    let colours = frames.converted_from()?;
    if let Some(share) = frames.clipped_share() {
        tracing::warn!(
            "{path}: the video is {colours}: converted to sRGB, where light above 203 cd/m² becomes white ({:.1} % of the pixels)",
            100.0 * share
        );
    }
    Some(format!("{colours}, converted to sRGB"))
}

/// Seconds without frames that are normal at the end of a video, where the sound may be longer than the picture;
/// chosen.
const MAX_GAP: f64 = 2.0;

/// Warning that the frames of a video end long before its stated duration; `None` if they do not or the duration is
/// unknown. `last` is the time of the last frame and `interval` the time between frames, both in seconds.
fn early_end(video: &Video, last: f64, interval: f64) -> Option<String> {
    let duration = video.duration?;
    (duration - last > interval + MAX_GAP).then(|| {
        format!(
            "the frames end at {last:.1} s of {duration:.1} s, as in a file that is cut off, or of which the last frame is shown for long"
        )
    })
}
