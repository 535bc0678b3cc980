//! Frames of a video, decoded by the program ffmpeg: [`Video`].

use std::ffi::OsString;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};

use super::Nanoseconds;
use crate::error::{Error, Result};
use crate::picture::reading_rule::MOST_PIXELS;
use crate::types::Rgb;
use crate::types::text::excerpt;

/// The most lines of ffmpeg that are kept for a message.
const LAST_LINES: usize = 2;

/// A video file, as ffmpeg describes it.
#[derive(Debug)]
pub(crate) struct Video {
    path: PathBuf,
    /// Seconds; `None` if the file does not state it.
    pub(crate) duration: Option<f64>,
    /// Codec, size and rate of the first video stream.
    pub(crate) stream: String,
    /// The option of this version that keeps every frame once.
    passthrough: [&'static str; 2],
}

/// A frame of a video.
#[derive(Debug)]
pub(crate) struct VideoFrame {
    /// Time from the start of the video.
    pub(crate) time: Nanoseconds,
    pub(crate) image: Rgb,
}

/// The frames of a video while ffmpeg decodes it; it is stopped when this is dropped.
#[derive(Debug)]
pub(crate) struct VideoFrames {
    path: PathBuf,
    child: Child,
    output: BufReader<ChildStdout>,
    times: Receiver<Nanoseconds>,
    log: Option<JoinHandle<FfmpegLog>>,
}

/// Lines that ffmpeg wrote while it decoded.
#[derive(Debug, Default)]
struct FfmpegLog {
    /// The last lines, without those about frames.
    last: Vec<String>,
    /// The first line about damage, and the number of such lines.
    first_damage: Option<String>,
    damages: usize,
}

/// Words in ffmpeg's lines about damage, in lower case.
const DAMAGE_WORDS: [&str; 4] = ["error", "invalid", "corrupt", "truncating"];

impl FfmpegLog {
    fn add(&mut self, line: &str) {
        let words = line.to_lowercase();
        // The names of files, and their metadata, which are indented, are no damage.
        let is_about_file = line.starts_with([' ', '\t'])
            || ["Input #", "Output #"]
                .iter()
                .any(|start| line.starts_with(start));
        if !is_about_file && DAMAGE_WORDS.iter().any(|word| words.contains(word)) {
            self.damages += 1;
            self.first_damage.get_or_insert_with(|| line.to_owned());
        }
        self.last.push(line.trim().to_owned());
        if self.last.len() > LAST_LINES {
            self.last.remove(0);
        }
    }
}

impl Video {
    /// Asks ffmpeg about a file.
    ///
    /// # Errors
    /// If ffmpeg is not on PATH, or finds no video in the file.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        crate::files::reading::refuse_pipes(path).map_err(|e| Error::file(path, "read", e))?;
        let output = ffmpeg(path)
            .stdin(Stdio::null())
            .output()
            .map_err(|e| unstarted(&e))?;
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        let Some((_, stream)) = log.split_once(" Video: ") else {
            let lines: Vec<String> = log.lines().map(str::to_owned).collect();
            let problem = format!("ffmpeg finds no video in it: {}", last_lines(&lines));
            return Err(Error::data(path.display(), problem));
        };
        let duration = log
            .split_once("Duration: ")
            .and_then(|(_, rest)| clock(rest.split(',').next()?));
        Ok(Self {
            path: path.to_owned(),
            duration,
            stream: stream.lines().next().unwrap_or_default().trim().to_owned(),
            passthrough: if has_fps_mode(&log) {
                ["-fps_mode", "passthrough"]
            } else {
                ["-vsync", "passthrough"]
            },
        })
    }

    /// Decodes one frame every `interval` seconds from the first one, or every frame if it is 0.
    ///
    /// # Errors
    /// If ffmpeg cannot be started.
    pub(crate) fn frames(&self, interval: f64) -> Result<VideoFrames> {
        let filter = if interval > 0.0 {
            // The little more is for frames at a multiple of the interval, whose quotient may be rounded down.
            let number = |time: &str| format!("floor(({time}-start_t)/{interval}+1e-7)");
            let (this, last) = (number("t"), number("prev_selected_t"));
            format!("select='isnan(prev_selected_t)+gt({this},{last})',showinfo")
        } else {
            "showinfo".to_owned()
        };
        let mut command = ffmpeg(&self.path);
        command
            .args(["-map", "0:v:0", "-vf", &filter])
            .args(self.passthrough)
            .args(["-pix_fmt", "rgb24", "-c:v", "ppm", "-f", "image2pipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| unstarted(&e))?;
        let (Some(output), Some(log)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(unstarted(&ErrorKind::BrokenPipe.into()));
        };
        let (sender, times) = channel();
        let log = thread::spawn(move || {
            let mut kept = FfmpegLog::default();
            let mut base = None;
            let mut lines = BufReader::new(log);
            let mut line = Vec::new();
            // Bytes, because names in a file need not be UTF-8.
            while lines
                .read_until(b'\n', &mut line)
                .is_ok_and(|count| count > 0)
            {
                let text = String::from_utf8_lossy(&line);
                base = time_base(&text).or(base);
                match base.and_then(|base| time(&text, base)) {
                    // The receiver is gone if the rest of the video is not wanted.
                    Some(time) => drop(sender.send(time)),
                    None if text.contains("showinfo") => {}
                    None => kept.add(text.trim_end()),
                }
                line.clear();
            }
            kept
        });
        Ok(VideoFrames {
            path: self.path.clone(),
            child,
            output: BufReader::with_capacity(1 << 20, output),
            times,
            log: Some(log),
        })
    }
}

/// ffmpeg with a file as its input. Only files are opened: a playlist in a stranger's file leads to no server.
fn ffmpeg(path: &Path) -> Command {
    let mut input = OsString::from("file:");
    input.push(path);
    let mut command = Command::new("ffmpeg");
    command
        .args([
            "-nostdin",
            "-nostats",
            "-protocol_whitelist",
            "file,pipe",
            "-i",
        ])
        .arg(input);
    command
}

fn unstarted(problem: &std::io::Error) -> Error {
    let remedy = if problem.kind() == ErrorKind::NotFound {
        "not found on PATH; videos are decoded by it: install it (apt install ffmpeg, brew install ffmpeg), or give the folder of extracted images to --data".to_owned()
    } else {
        format!("cannot be started: {problem}")
    };
    Error::usage("ffmpeg", remedy)
}

/// Whether the version of ffmpeg knows `-fps_mode` (5.1), by its first line. Builds without a number are new.
fn has_fps_mode(log: &str) -> bool {
    let version = log
        .split_once("ffmpeg version ")
        .map_or("", |(_, rest)| rest);
    let version = version.trim_start_matches('n');
    let mut numbers = version
        .split(|c: char| !c.is_ascii_digit())
        .map(str::parse::<u32>);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor) >= (5, 1),
        (Some(Ok(major)), _) => major >= 6,
        _ => true,
    }
}

/// The seconds of a duration such as `00:01:02.50`.
fn clock(text: &str) -> Option<f64> {
    let mut seconds = 0.0;
    for part in text.trim().split(':') {
        seconds = seconds * 60.0 + part.parse::<f64>().ok()?;
    }
    Some(seconds)
}

/// The seconds of a unit of time in the first line of the filter `showinfo`: numerator and denominator.
fn time_base(line: &str) -> Option<[i64; 2]> {
    let (_, rest) = line.split_once("config in time_base: ")?;
    let (numerator, denominator) = rest.split(',').next()?.trim().split_once('/')?;
    let base = [numerator.parse().ok()?, denominator.parse().ok()?];
    base.iter().all(|number| *number > 0).then_some(base)
}

/// The time in a line of `showinfo` about a frame. Its `pts_time` has six digits, which are too few for long videos.
fn time(line: &str, [numerator, denominator]: [i64; 2]) -> Option<Nanoseconds> {
    let (_, rest) = line.split_once(" pts:")?;
    let units: i64 = rest.split_whitespace().next()?.parse().ok()?;
    let time = i128::from(units) * i128::from(numerator) * 1_000_000_000 / i128::from(denominator);
    Nanoseconds::try_from(time).ok()
}

fn last_lines(lines: &[String]) -> String {
    lines[lines.len().saturating_sub(LAST_LINES)..].join("; ")
}

impl VideoFrames {
    /// The next frame; `None` at the end.
    ///
    /// # Errors
    /// If ffmpeg fails, or writes something else than an image.
    pub(crate) fn next(&mut self) -> Result<Option<VideoFrame>> {
        match self.image() {
            Ok(Some(image)) => {
                let time = self
                    .times
                    .recv()
                    .map_err(|_| self.failed("it states no time of a frame"))?;
                Ok(Some(VideoFrame { time, image }))
            }
            Ok(None) => {
                let status = self.child.wait();
                if status.is_ok_and(|status| status.success()) {
                    return Ok(None);
                }
                Err(self.failed("it ends with an error"))
            }
            Err(problem) => Err(self.failed(&problem)),
        }
    }

    /// The next image in the format PPM.
    fn image(&mut self) -> Result<Option<Rgb>, String> {
        let Some(magic) = self.word()? else {
            return Ok(None);
        };
        let mut number = || {
            let word = self.word()?.unwrap_or_default();
            word.parse::<usize>()
                .map_err(|_| format!("{word:?} in the head of an image"))
        };
        let (width, height, white) = (number()?, number()?, number()?);
        let pixels = width.saturating_mul(height);
        if magic != "P6" || white != 255 || pixels == 0 || pixels as u64 > MOST_PIXELS {
            return Err(format!("an image {magic} of {width} × {height} pixels"));
        }
        let mut samples = vec![0; pixels * 3];
        self.output
            .read_exact(&mut samples)
            .map_err(|e| e.to_string())?;
        Rgb::new(height, width, samples)
            .map(Some)
            .map_err(|e| e.to_string())
    }

    /// The next word of the head of an image, without the blank after it; `None` at the end.
    fn word(&mut self) -> Result<Option<String>, String> {
        let mut word = String::new();
        loop {
            let mut byte = [0];
            match self.output.read(&mut byte) {
                Ok(0) => return Ok((!word.is_empty()).then_some(word)),
                Ok(_) if byte[0].is_ascii_whitespace() => return Ok(Some(word)),
                Ok(_) if word.len() < 20 => word.push(char::from(byte[0])),
                Ok(_) => return Err(format!("{word:?} in place of an image")),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e.to_string()),
            }
        }
    }

    /// The damage that ffmpeg reported in a video that it decoded to the end; `None` if it reported none.
    pub(crate) fn damage(mut self) -> Option<String> {
        let log = self.log.take()?.join().ok()?;
        let first = log.first_damage?;
        let count = match log.damages {
            1 => "a problem".to_owned(),
            count => format!("{count} problems, first"),
        };
        Some(format!("ffmpeg reports {count}: {}", excerpt(&first, 150)))
    }

    /// The error for a failure of ffmpeg, with its last lines.
    fn failed(&mut self, problem: &str) -> Error {
        // Both may fail only because it has ended.
        drop(self.child.kill());
        drop(self.child.wait());
        let log = self
            .log
            .take()
            .and_then(|log| log.join().ok())
            .unwrap_or_default();
        let problem = format!("ffmpeg: {problem}; {}", last_lines(&log.last));
        Error::data(self.path.display(), problem)
    }
}

impl Drop for VideoFrames {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_no_damage() {
        let mut log = FfmpegLog::default();
        log.add("Input #0, mov, from 'file:error_cases/x.mp4':");
        log.add("    title           : Error 404");
        assert_eq!(log.damages, 0);
        log.add("[h264 @ 0x1] error while decoding MB 3 5");
        assert_eq!(log.damages, 1);
    }

    #[test]
    fn lines_of_ffmpeg_are_understood() {
        let base =
            time_base("[Parsed_showinfo_1 @ 0x55] config in time_base: 1/30000, frame_rate: 30/1");
        assert_eq!(base, Some([1, 30_000]));
        let line = "[Parsed_showinfo_1 @ 0x55] n:   3 pts:  45045 pts_time:1.5015  duration:  1";
        assert_eq!(time(line, [1, 30_000]), Some(1_501_500_000));
        assert_eq!(
            time("[Parsed_showinfo_1 @ 0x55] color_range:tv", [1, 1]),
            None
        );
        assert_eq!(clock(" 00:01:02.50"), Some(62.5));
        assert_eq!(clock("N/A"), None);
        for (version, expected) in [
            ("4.4.2-0ubuntu", false),
            ("5.0", false),
            ("5.1.6-0+deb12u1", true),
            ("n7.1", true),
            ("8", true),
            ("N-119", true),
        ] {
            assert_eq!(
                has_fps_mode(&format!("ffmpeg version {version} Copyright")),
                expected,
                "{version}"
            );
        }
    }
}
