//! The log of ffmpeg: the facts about frames, damage and the version that it states ([`read_log`]).

use std::io::{BufRead, BufReader};
use std::process::ChildStderr;
use std::sync::mpsc::Sender;

use super::Nanoseconds;
use super::ffmpeg_colours::FrameColours;

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
pub(super) fn read_log(log: ChildStderr, facts: &Sender<FrameFacts>) -> FfmpegLog {
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
pub(super) fn supports_fps_mode(log: &str) -> bool {
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
pub(super) fn last_lines(lines: &[String]) -> String {
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
