//! Choice of key frames, evenly spaced along a trajectory: [`KeyFrames`].

use std::num::NonZeroUsize;

use clap::Args;

use super::files::ListedFrame;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::positive;

/// Flags that choose the frames of each scene.
#[derive(Debug, Clone, Copy, Default, Args)]
#[command(next_help_heading = "Key frames")]
pub struct KeyFrameArgs {
    /// One frame every N seconds of a scene (DarkQA: 2); default: every frame
    #[arg(long, value_name = "SECONDS", value_parser = positive, conflicts_with = "count", add = Decides::Trials)]
    pub every: Option<f64>,
    /// This many frames of each scene, evenly spread; default: every frame
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub count: Option<NonZeroUsize>,
    /// Frames per second, if frames have no time of their own; default: not known
    #[arg(long, value_name = "N", value_parser = positive, add = Decides::Trials)]
    pub fps: Option<f64>,
}

impl KeyFrameArgs {
    /// Rule for the choice of frames.
    #[must_use]
    pub fn selection(&self) -> KeyFrames {
        match (self.every, self.count) {
            (Some(seconds), _) => KeyFrames::Seconds(seconds),
            (None, Some(count)) => KeyFrames::Count(count.get()),
            (None, None) => KeyFrames::All,
        }
    }
}

/// Rule for the choice of frames in each scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KeyFrames {
    /// All frames of the scene.
    All,
    /// One frame per interval of this many seconds, counted from the first frame (DarkQA: 2).
    Seconds(f64),
    /// This number of frames, evenly spaced.
    Count(usize),
}

/// Chooses the key frames of each scene. Frames are sorted by time if they have one, else by name.
///
/// With an interval, the k-th key frame is the first frame at k · seconds or later; no frame is chosen twice. With a
/// count N, the key frames of n frames are those at k · (n − 1) / (N − 1), rounded half to even.
///
/// # Errors
/// If an interval is given and a frame has no time.
pub fn choose(frames: &[ListedFrame], selection: KeyFrames, fps: Option<f64>) -> Result<Vec<ListedFrame>> {
    let mut chosen = Vec::new();
    for scene in frames.chunk_by(|a, b| a.scene == b.scene) {
        let mut timed: Vec<ListedFrame> = scene.to_vec();
        if let Some(fps) = fps.filter(|_| scene.iter().all(|frame| frame.time.is_none())) {
            for (number, frame) in timed.iter_mut().enumerate() {
                frame.time = Some(number as f64 / fps);
            }
        }
        timed.sort_by(|a, b| a.time.partial_cmp(&b.time).unwrap_or(std::cmp::Ordering::Equal));
        match selection {
            KeyFrames::All => {}
            KeyFrames::Count(count) => timed = evenly_spaced(timed, count),
            KeyFrames::Seconds(seconds) => timed = one_per_interval(timed, seconds)?,
        }
        chosen.extend(timed);
    }
    chosen.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
    Ok(chosen)
}

/// Chooses `count` frames at even distances.
fn evenly_spaced(frames: Vec<ListedFrame>, count: usize) -> Vec<ListedFrame> {
    let (last, gaps) = (frames.len() - 1, count.saturating_sub(1));
    let mut indices: Vec<usize> = (0..count)
        .map(|k| match gaps {
            0 => 0,
            gaps => (k as f64 * last as f64 / gaps as f64).round_ties_even() as usize,
        })
        .collect();
    indices.dedup();
    let mut frames: Vec<Option<ListedFrame>> = frames.into_iter().map(Some).collect();
    indices.into_iter().filter_map(|index| frames.get_mut(index)?.take()).collect()
}

/// Chooses the first frame of each interval.
fn one_per_interval(frames: Vec<ListedFrame>, seconds: f64) -> Result<Vec<ListedFrame>> {
    let (mut chosen, mut next, mut start) = (Vec::new(), 0.0, None);
    for frame in frames {
        let time = frame.time.ok_or_else(|| untimed(&frame))?;
        let since = time - *start.get_or_insert(time);
        if since >= next * seconds {
            next = libm::floor(since / seconds) + 1.0;
            // If the quotient was rounded, the next limit must still be later than this frame.
            if next * seconds <= since {
                next += 1.0;
            }
            chosen.push(frame);
        }
    }
    Ok(chosen)
}

fn untimed(frame: &ListedFrame) -> Error {
    let problem = format_args!(
        "the frame {}/{} has no time; state the frames per second with --fps, or use --count N, which needs no time",
        frame.scene, frame.frame
    );
    Error::usage("--every", problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(scene: &str, number: usize, time: Option<f64>) -> ListedFrame {
        ListedFrame {
            scene: scene.into(),
            frame: format!("{number:03}"),
            time,
            pose: None,
            intrinsics: None,
            room: None,
            rgb: "x.png".into(),
            index: number,
        }
    }

    fn names(frames: &[ListedFrame]) -> Vec<&str> {
        frames.iter().map(|frame| frame.frame.as_str()).collect()
    }

    #[test]
    fn one_frame_is_chosen_per_interval() {
        let times = [100.0, 100.5, 101.9, 102.0, 102.1, 107.0, 107.5, 108.0];
        let frames: Vec<ListedFrame> = (0..).zip(times).map(|(i, time)| frame("a", i, Some(time))).collect();
        let chosen = choose(&frames, KeyFrames::Seconds(2.0), None).unwrap();
        // The frames at 0, 2 and 7 s (the first after 4 s and after 6 s), and at 8 s.
        assert_eq!(names(&chosen), ["000", "003", "005", "007"]);
        let mut reversed = frames.clone();
        reversed.reverse();
        assert_eq!(choose(&reversed, KeyFrames::Seconds(2.0), None).unwrap(), chosen);
        assert_eq!(choose(&frames, KeyFrames::All, None).unwrap().len(), 8);
    }

    #[test]
    fn frame_rate_determines_times() {
        let frames: Vec<ListedFrame> = (0..61).map(|i| frame("a", i, None)).collect();
        let chosen = choose(&frames, KeyFrames::Seconds(2.0), Some(10.0)).unwrap();
        assert_eq!(names(&chosen), ["000", "020", "040", "060"]);
        let error = choose(&frames, KeyFrames::Seconds(2.0), None).unwrap_err().to_string();
        assert!(error.starts_with("--every: the frame a/000 has no time"), "{error}");
    }

    #[test]
    fn count_is_evenly_spread_in_each_scene() {
        let mut frames: Vec<ListedFrame> = (0..10).map(|i| frame("a", i, None)).collect();
        frames.extend((0..2).map(|i| frame("b", i, None)));
        let chosen = choose(&frames, KeyFrames::Count(4), None).unwrap();
        assert_eq!(names(&chosen), ["000", "003", "006", "009", "000", "001"]);
        assert_eq!(names(&choose(&frames, KeyFrames::Count(1), None).unwrap()), ["000", "000"]);
    }
}
