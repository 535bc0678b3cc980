//! Frames of a video, decoded by the program `ffmpeg`: [`Video`].
//!
//! The log of ffmpeg: the facts about frames, damage and the version that it states ([`read_log`]).

use std::ffi::OsString;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use super::Nanoseconds;
use super::ffmpeg_colours::{FrameColours, needs_colours};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;
use darkqa_base::types::text::excerpt;
use darkqa_pictures::FrameConversion;
use darkqa_pictures::decode_rule::MAX_PIXELS;

/// Maximum length of an expression that selects frames, in bytes: a command line of Windows has at most 32,767
/// characters. Without the expression, all frames are decoded.
const MAX_SELECT: usize = 30_000;

/// Video file with metadata from ffmpeg.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    /// Container format that ffmpeg has to assume; `None` to find it out.
    format: Option<&'static str>,
    /// Duration in seconds; `None` if unknown.
    pub duration: Option<f64>,
    /// Codec, size and rate of the first video stream.
    pub stream: String,
    /// Option of the installed version to output every frame once.
    passthrough: [&'static str; 2],
    /// True if the pictures are only for displays with Dolby Vision.
    is_dolby_vision: bool,
}

/// Frame of a video.
#[derive(Debug)]
pub struct VideoFrame {
    /// Time from the start of the video.
    pub time: Nanoseconds,
    /// Image in sRGB.
    pub image: Rgb,
}

/// Conversion of the frames of a video to sRGB.
#[derive(Debug)]
struct VideoConversion {
    rule: FrameConversion,
    /// Number of pixels so far, and of those with light above white.
    pixels: usize,
    clipped: usize,
}

/// Running decoder of a video. Dropping it stops ffmpeg.
#[derive(Debug)]
pub struct VideoFrames {
    path: PathBuf,
    /// Codec of the video, as ffmpeg calls it.
    codec: String,
    /// Number of frames so far.
    count: usize,
    child: Child,
    output: BufReader<ChildStdout>,
    facts: Receiver<FrameFacts>,
    log: Option<JoinHandle<FfmpegLog>>,
    /// `None` if the codes are taken as sRGB codes.
    conversion: Option<VideoConversion>,
    /// Colours of the last frame.
    colours: Option<FrameColours>,
    /// The first frame, which was read to learn the colours.
    first: Option<Result<Option<VideoFrame>>>,
    /// The log after ffmpeg has ended.
    ended_log: FfmpegLog,
}

impl Video {
    /// Reads the metadata of a file with ffmpeg.
    ///
    /// # Errors
    /// If ffmpeg is not on PATH, or finds no video in the file.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_as(path, None)
    }

    /// Reads the metadata of an MP4 file of a data set. A playlist in its place, which could name files elsewhere, is
    /// not read.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_mp4(path: &Path) -> Result<Self> {
        Self::open_as(path, Some("mov"))
    }

    fn open_as(path: &Path, format: Option<&'static str>) -> Result<Self> {
        darkqa_base::files::refuse_pipes(path).map_err(|e| Error::file(path, "read", e))?;
        let output = ffmpeg(path, format).stdin(Stdio::null()).output().map_err(|e| start_error(&e))?;
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        let Some((_, stream)) = log.split_once(" Video: ") else {
            let lines: Vec<String> = log.lines().map(str::to_owned).collect();
            let problem = format!("ffmpeg finds no video in it: {}", last_lines(&lines));
            return Err(Error::data(path.display(), problem));
        };
        let duration = log.split_once("Duration: ").and_then(|(_, rest)| parse_duration(rest.split(',').next()?));
        Ok(Self {
            path: path.to_owned(),
            format,
            duration,
            stream: stream.lines().next().unwrap_or_default().trim().to_owned(),
            passthrough: if supports_fps_mode(&log) { ["-fps_mode", "passthrough"] } else { ["-vsync", "passthrough"] },
            is_dolby_vision: log.lines().any(|line| line.contains("DOVI") && line.contains("compatibility id: 0")),
        })
    }

    /// Decodes one frame every `interval` seconds from the first one, or every frame if it is 0. Frames are converted
    /// to sRGB as the video states its colours: codes of BT.709 and similar ones are kept, wide primaries and HDR are
    /// converted.
    ///
    /// # Errors
    /// If ffmpeg cannot be started, or the colours of the video are not converted.
    pub fn frames(&self, interval: f64) -> Result<VideoFrames> {
        if interval == 0.0 {
            return self.converted(None);
        }
        // The small addend is for frames at a multiple of the interval, whose quotient may be rounded down.
        let [this, last] = ["t", "prev_selected_t"].map(|time| format!("floor(({time}-start_t)/{interval}+1e-7)"));
        self.converted(Some(&format!("isnan(prev_selected_t)+gt({this},{last})")))
    }

    /// Decodes at least the frames in these spans of time, each from its first second to its last, and converts them
    /// like [`Self::frames`].
    ///
    /// # Errors
    /// As [`Self::frames`].
    pub fn frames_within(&self, spans: &[[f64; 2]]) -> Result<VideoFrames> {
        let spans: Vec<String> = spans.iter().map(|[from, to]| format!("between(t,{from:.6},{to:.6})")).collect();
        let select = spans.join("+");
        self.converted(Some(&*select).filter(|select| select.len() <= MAX_SELECT))
    }

    /// Decodes the frames that an expression of ffmpeg's filter `select` selects, or all, and converts them to sRGB.
    fn converted(&self, select: Option<&str>) -> Result<VideoFrames> {
        let error = |problem: String| Error::data(self.path.display(), problem);
        if self.is_dolby_vision {
            let problem = "the pictures are only for displays with Dolby Vision; export the video for other displays (HDR10, HLG or SDR) first";
            return Err(error(problem.to_owned()));
        }
        let mut frames = self.decode(select, None)?;
        let first = frames.next_frame();
        let conversion = match &frames.colours {
            Some(colours) => colours.conversion(&self.path).map_err(error)?,
            None if needs_colours(&self.stream) && matches!(first, Ok(Some(_))) => {
                let problem = "this ffmpeg does not state the colours of frames, which are not sRGB; version 4.3 or later expected";
                return Err(error(problem.to_owned()));
            }
            None => None,
        };
        if let Some(conversion) = conversion {
            drop(frames);
            return self.decode(select, Some(conversion));
        }
        frames.first = Some(first);
        Ok(frames)
    }

    /// Starts ffmpeg. Frames that are converted are decoded to 16 bits.
    fn decode(&self, select: Option<&str>, conversion: Option<FrameConversion>) -> Result<VideoFrames> {
        let filter = match select {
            Some(select) => format!("select='{select}',showinfo"),
            None => "showinfo".to_owned(),
        };
        let mut command = ffmpeg(&self.path, self.format);
        command
            .args(["-map", "0:v:0", "-vf", &filter])
            .args(self.passthrough)
            .args(["-pix_fmt", if conversion.is_some() { "rgb48be" } else { "rgb24" }])
            .args(["-c:v", "ppm", "-f", "image2pipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| start_error(&e))?;
        let (Some(output), Some(log)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(start_error(&ErrorKind::BrokenPipe.into()));
        };
        let (sender, facts) = channel();
        let log = thread::spawn(move || read_log(log, &sender));
        let codec = self.stream.split([' ', ',']).next().unwrap_or_default();
        Ok(VideoFrames {
            path: self.path.clone(),
            codec: codec.to_owned(),
            count: 0,
            child,
            output: BufReader::with_capacity(1 << 20, output),
            facts,
            log: Some(log),
            conversion: conversion.map(VideoConversion::new),
            colours: None,
            first: None,
            ended_log: FfmpegLog::default(),
        })
    }
}

impl VideoConversion {
    fn new(conversion: FrameConversion) -> Self {
        Self { rule: conversion, pixels: 0, clipped: 0 }
    }

    fn convert(&mut self, samples: &[u16]) -> Vec<u8> {
        let (converted, clipped) = self.rule.convert(samples);
        self.pixels += samples.len() / 3;
        self.clipped += clipped;
        converted
    }
}

/// ffmpeg with a file as input. It may only open files, so a playlist in an untrusted file cannot lead to a server.
fn ffmpeg(path: &Path, format: Option<&str>) -> Command {
    let mut input = OsString::from("file:");
    input.push(path);
    let mut command = Command::new("ffmpeg");
    command
        .args(["-nostdin", "-nostats", "-protocol_whitelist", "file,pipe"])
        .args(format.iter().flat_map(|format| ["-f", format]))
        .arg("-i")
        .arg(input);
    command
}

/// Error if ffmpeg cannot be started.
fn start_error(problem: &std::io::Error) -> Error {
    let remedy = if problem.kind() == ErrorKind::NotFound {
        "not found on PATH; videos are decoded by it: install it (apt install ffmpeg, brew install ffmpeg), or give the folder of extracted images to --data".to_owned()
    } else {
        format!("cannot be started: {problem}")
    };
    Error::usage("ffmpeg", remedy)
}

impl VideoFrames {
    /// Reads the next frame; `None` at the end.
    ///
    /// # Errors
    /// If ffmpeg fails, its output is not an image, or the colours change.
    pub fn next_frame(&mut self) -> Result<Option<VideoFrame>> {
        if let Some(first) = self.first.take() {
            return first;
        }
        match self.read_image() {
            Ok(Some(image)) => {
                let facts = self.facts.recv().map_err(|_| self.failure("it states no time of a frame"))?;
                self.check_colours(&facts)?;
                self.colours = facts.colours;
                self.count += 1;
                let time = facts.time;
                Ok(Some(VideoFrame { time, image }))
            }
            Ok(None) => {
                let status = self.child.wait();
                // Without a decoder, some versions end without an error.
                if self.count == 0 && self.ended_log().lacks_decoder {
                    return Err(self.no_decoder());
                }
                if status.is_ok_and(|status| status.success()) {
                    return Ok(None);
                }
                Err(self.failure("it ends with an error"))
            }
            Err(problem) => Err(self.failure(&problem)),
        }
    }

    /// Checks that a frame needs the same conversion as the frames before it.
    fn check_colours(&mut self, facts: &FrameFacts) -> Result<()> {
        let (Some(before), Some(found)) = (&self.colours, &facts.colours) else {
            return Ok(());
        };
        if before == found {
            return Ok(());
        }
        let name =
            |conversion: Option<&FrameConversion>| conversion.map_or("sRGB codes", FrameConversion::name).to_owned();
        let expected = name(self.conversion.as_ref().map(|known| &known.rule));
        let found = match found.conversion(&self.path) {
            Ok(conversion) => name(conversion.as_ref()),
            Err(problem) => problem,
        };
        if found == expected {
            return Ok(());
        }
        let at = super::seconds(facts.time);
        let problem = format!("the colours change at {at:.3} s: {expected}, then {found}");
        Err(self.failure(&problem))
    }

    /// Name of the colours that are converted to sRGB; `None` if the codes are taken as sRGB codes.
    pub fn converted_from(&self) -> Option<&str> {
        self.conversion.as_ref().map(|found| found.rule.name())
    }

    /// Share of the pixels so far whose light is above white and was clipped; `None` if the video is not HDR.
    pub fn clipped_share(&self) -> Option<f64> {
        let found = self.conversion.as_ref()?;
        found.rule.is_hdr().then(|| found.clipped as f64 / found.pixels.max(1) as f64)
    }

    /// Reads the next image, in the format PPM.
    fn read_image(&mut self) -> Result<Option<Rgb>, String> {
        let Some(magic) = self.read_word()? else {
            return Ok(None);
        };
        let (width, height, max_value) = (self.read_number()?, self.read_number()?, self.read_number()?);
        let expected = if self.conversion.is_some() { 65_535 } else { 255 };
        let pixels = width.saturating_mul(height);
        if magic != "P6" || max_value != expected || pixels == 0 || pixels as u64 > MAX_PIXELS {
            return Err(format!("an image {magic} of {width} × {height} pixels"));
        }
        let samples = if let Some(conversion) = &mut self.conversion {
            let mut bytes = vec![0; pixels * 6];
            self.output.read_exact(&mut bytes).map_err(|e| e.to_string())?;
            let pairs = bytes.as_chunks::<2>().0.iter();
            let samples: Vec<u16> = pairs.map(|pair| u16::from_be_bytes(*pair)).collect();
            conversion.convert(&samples)
        } else {
            let mut samples = vec![0; pixels * 3];
            self.output.read_exact(&mut samples).map_err(|e| e.to_string())?;
            samples
        };
        Rgb::new(height, width, samples).map(Some).map_err(|e| e.to_string())
    }

    /// Reads a number in the head of an image.
    fn read_number(&mut self) -> Result<usize, String> {
        let word = self.read_word()?.unwrap_or_default();
        word.parse::<usize>().map_err(|_| format!("{word:?} in the head of an image"))
    }

    /// Reads the next word of the header of an image and the space after it; `None` at the end.
    fn read_word(&mut self) -> Result<Option<String>, String> {
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

    /// Message about damage that ffmpeg reported while it decoded the video to the end; `None` if it reported none.
    pub fn damage(mut self) -> Option<String> {
        let log = self.ended_log();
        let first = log.first_damage.as_ref()?;
        let count = match log.damage_lines {
            1 => "a problem".to_owned(),
            count => format!("{count} problems, first"),
        };
        Some(format!("ffmpeg reports {count}: {}", excerpt(first, 150)))
    }

    /// Stops ffmpeg, and returns the error with its last lines.
    fn failure(&mut self, problem: &str) -> Error {
        // These fail only if ffmpeg has already ended.
        drop(self.child.kill());
        drop(self.child.wait());
        let log = self.ended_log();
        let problem = format!("ffmpeg: {problem}; {}", last_lines(&log.last));
        Error::data(self.path.display(), problem)
    }

    /// The log of ffmpeg, which has ended.
    fn ended_log(&mut self) -> &FfmpegLog {
        if let Some(log) = self.log.take() {
            self.ended_log = log.join().unwrap_or_default();
        }
        &self.ended_log
    }

    /// The error if the installed ffmpeg has no decoder for the codec.
    fn no_decoder(&self) -> Error {
        let problem = format_args!(
            "the installed one has no decoder for {}, the codec of {}; install one that has (for av1 with libdav1d): apt install ffmpeg (Debian 11, Ubuntu 22.04 or later), brew install ffmpeg, or conda install -c conda-forge ffmpeg",
            self.codec,
            self.path.display()
        );
        Error::usage("ffmpeg", problem)
    }
}

impl Drop for VideoFrames {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Maximum number of lines of ffmpeg in an error message.
const MAX_LOG_LINES: usize = 2;

/// Facts about a frame in the log of ffmpeg.
#[derive(Debug)]
pub(super) struct FrameFacts {
    pub(super) time: Nanoseconds,
    /// `None` if this version of ffmpeg does not state them.
    pub(super) colours: Option<FrameColours>,
}

/// Log of ffmpeg.
#[derive(Debug, Default)]
pub(super) struct FfmpegLog {
    /// Last lines, without lines about frames.
    pub(super) last: Vec<String>,
    /// First line about damage.
    pub(super) first_damage: Option<String>,
    /// Number of lines about damage.
    pub(super) damage_lines: usize,
    /// True if ffmpeg has no decoder for the video.
    pub(super) lacks_decoder: bool,
}

/// Words in ffmpeg's lines about a codec that it cannot decode, in lower case. Its own decoder of AV1 needs a graphics
/// card.
const NO_DECODER_WORDS: [&str; 3] = ["no decoder found", "hardware accelerated av1 decoding", "decoder (codec"];

/// Words in ffmpeg's lines about damage, in lower case.
const DAMAGE_WORDS: [&str; 4] = ["error", "invalid", "corrupt", "truncating"];

impl FfmpegLog {
    fn add(&mut self, line: &str) {
        let words = line.to_lowercase();
        self.lacks_decoder |= NO_DECODER_WORDS.iter().any(|word| words.contains(word));
        // Names of files and their indented metadata may contain these words.
        let is_about_file =
            line.starts_with([' ', '\t']) || ["Input #", "Output #"].iter().any(|start| line.starts_with(start));
        if !is_about_file && DAMAGE_WORDS.iter().any(|word| words.contains(word)) {
            self.damage_lines += 1;
            self.first_damage.get_or_insert_with(|| line.to_owned());
        }
        self.last.push(line.trim().to_owned());
        if self.last.len() > MAX_LOG_LINES {
            self.last.remove(0);
        }
    }
}

/// Reads the log of a running ffmpeg, and sends the facts about the frames.
fn read_log(log: ChildStderr, facts: &Sender<FrameFacts>) -> FfmpegLog {
    let mut kept = FfmpegLog::default();
    let mut base = None;
    // The colours of a frame are on a later line than its time.
    let mut waiting: Option<FrameFacts> = None;
    // Sending fails if the rest of the video is not needed.
    let send = |found: Option<FrameFacts>| drop(found.map(|found| facts.send(found)));
    let mut lines = BufReader::new(log);
    let mut line = Vec::new();
    // Lines are read as bytes, because names in a file need not be UTF-8.
    while lines.read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
        let text = String::from_utf8_lossy(&line);
        base = parse_time_base(&text).or(base);
        if let Some(time) = base.and_then(|base| parse_frame_time(&text, base)) {
            let colours = None;
            send(waiting.replace(FrameFacts { time, colours }));
        } else if let Some(colours) = FrameColours::parse(&text) {
            send(waiting.take().map(|found| FrameFacts { colours: Some(colours), ..found }));
        } else if !text.contains("showinfo") {
            kept.add(text.trim_end());
        }
        line.clear();
    }
    send(waiting);
    kept
}

/// True if this version of ffmpeg supports `-fps_mode` (5.1 or later), from the first line of its log. Builds without a
/// number are recent.
fn supports_fps_mode(log: &str) -> bool {
    let version = log.split_once("ffmpeg version ").map_or("", |(_, rest)| rest);
    let version = version.trim_start_matches('n');
    let mut numbers = version.split(|c: char| !c.is_ascii_digit()).map(str::parse::<u32>);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor) >= (5, 1),
        (Some(Ok(major)), _) => major >= 6,
        _ => true,
    }
}

/// Parses a duration such as `00:01:02.50` to seconds.
pub(super) fn parse_duration(text: &str) -> Option<f64> {
    let mut seconds = 0.0;
    for part in text.trim().split(':') {
        seconds = seconds * 60.0 + part.parse::<f64>().ok()?;
    }
    Some(seconds)
}

/// Parses the seconds per unit of time in the first line of the filter `showinfo`: numerator and denominator.
fn parse_time_base(line: &str) -> Option<[i64; 2]> {
    let (_, rest) = line.split_once("config in time_base: ")?;
    let (numerator, denominator) = rest.split(',').next()?.trim().split_once('/')?;
    let base = [numerator.parse().ok()?, denominator.parse().ok()?];
    base.iter().all(|number| *number > 0).then_some(base)
}

/// Parses the time in a line of `showinfo` about a frame. Its `pts_time` is not used, because six digits are too few
/// for long videos.
fn parse_frame_time(line: &str, [numerator, denominator]: [i64; 2]) -> Option<Nanoseconds> {
    let (_, rest) = line.split_once(" pts:")?;
    let units: i64 = rest.split_whitespace().next()?.parse().ok()?;
    let time = i128::from(units) * i128::from(numerator) * 1_000_000_000 / i128::from(denominator);
    Nanoseconds::try_from(time).ok()
}

/// Joins the last lines of a log.
fn last_lines(lines: &[String]) -> String {
    lines[lines.len().saturating_sub(MAX_LOG_LINES)..].join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_are_not_damage() {
        let mut log = FfmpegLog::default();
        log.add("Input #0, mov, from 'file:error_cases/x.mp4':");
        log.add("    title           : Error 404");
        assert_eq!(log.damage_lines, 0);
        log.add("[h264 @ 0x1] error while decoding MB 3 5");
        assert_eq!(log.damage_lines, 1);
    }

    #[test]
    fn log_of_ffmpeg_is_parsed() {
        let base = parse_time_base("[Parsed_showinfo_1 @ 0x55] config in time_base: 1/30000, frame_rate: 30/1");
        assert_eq!(base, Some([1, 30_000]));
        let line = "[Parsed_showinfo_1 @ 0x55] n:   3 pts:  45045 pts_time:1.5015  duration:  1";
        assert_eq!(parse_frame_time(line, [1, 30_000]), Some(1_501_500_000));
        assert_eq!(parse_frame_time("[Parsed_showinfo_1 @ 0x55] color_range:tv", [1, 1]), None);
        assert_eq!(parse_duration(" 00:01:02.50"), Some(62.5));
        assert_eq!(parse_duration("N/A"), None);
        for (version, expected) in [
            ("4.4.2-0ubuntu", false),
            ("5.0", false),
            ("5.1.6-0+deb12u1", true),
            ("n7.1", true),
            ("8", true),
            ("N-119", true),
        ] {
            assert_eq!(supports_fps_mode(&format!("ffmpeg version {version} Copyright")), expected, "{version}");
        }
    }
}
