//! Choice of frames from a recording or video: [`SamplingArgs`] and [`Sampler`].

use std::num::NonZeroUsize;

use clap::Args;

use super::stretches::Place;
use super::thumbnail::Thumbnail;
use super::{Nanoseconds, seconds};
use crate::types::Decides;
use crate::types::flags::positive;

/// Default interval between two frames, in seconds, as in DarkQA.
const INTERVAL: f64 = 2.0;

/// Flags that choose the frames of each topic.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Key frames")]
pub(crate) struct SamplingArgs {
    /// One frame of each topic every N seconds; 0 takes every frame; default: 2, or every frame if another flag chooses
    #[arg(long, value_name = "SECONDS", value_parser = interval, add = Decides::Trials)]
    pub every: Option<f64>,
    /// The first frame at each of these times or later, in seconds from the first frame; default: by --every
    #[arg(long, value_name = "SECONDS,…", value_delimiter = ',', value_parser = interval, conflicts_with_all = ["every", "max_frames"], add = Decides::Trials)]
    pub at: Vec<f64>,
    /// At most N frames of each topic, evenly spread over its duration; default: no limit
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub max_frames: Option<NonZeroUsize>,
    /// Of the frames chosen otherwise, those that differ from the last one taken by more than this many 8-bit codes:
    /// the mean absolute difference of the grey means of 16 × 16 blocks; default: all of them
    #[arg(long, value_name = "CODES", value_parser = positive, add = Decides::Trials)]
    pub changed: Option<f64>,
}

/// Parses a number of seconds from 0 to a billion.
fn interval(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|seconds| (0.0..=1e9).contains(seconds))
        .ok_or_else(|| "a number of seconds from 0 to 1e9 expected".to_owned())
}

impl SamplingArgs {
    /// Interval between two frames in seconds: `--every`, or its default.
    pub(crate) fn interval(&self) -> f64 {
        let has_other_flag = !self.at.is_empty() || self.max_frames.is_some() || self.changed.is_some();
        self.every.unwrap_or(if has_other_flag { 0.0 } else { INTERVAL })
    }

    /// Sampler for a topic of this duration, in seconds.
    pub(crate) fn sampler(&self, duration: f64) -> Sampler {
        // For a duration D and N frames, frames are due at 0, D/N, 2D/N, ….
        let spread = self.max_frames.map_or(0.0, |limit| duration / limit.get() as f64);
        let mut at: Vec<Nanoseconds> = self.at.iter().map(|seconds| nanoseconds(*seconds)).collect();
        at.sort_unstable();
        at.dedup();
        Sampler {
            interval: nanoseconds(self.interval().max(spread)),
            at,
            limit: self.max_frames.map_or(usize::MAX, NonZeroUsize::get),
            progress: SamplerProgress::default(),
            min_change: self.changed,
            last_taken: None,
        }
    }

    /// Description of the choice.
    pub(crate) fn description(&self) -> String {
        let mut words = Vec::new();
        match self.at.len() {
            0 if self.interval() > 0.0 => words.push(format!("one every {} s", self.interval())),
            0 => {}
            1 => words.push("at 1 time".to_owned()),
            times => words.push(format!("at {times} times")),
        }
        if let Some(limit) = self.max_frames {
            words.push(format!("at most {limit}, evenly spread"));
        }
        if let Some(codes) = self.changed {
            words.push(format!("changed by more than {codes} codes"));
        }
        if words.is_empty() {
            words.push("every frame".to_owned());
        }
        words.join(", ")
    }
}

fn nanoseconds(seconds: f64) -> Nanoseconds {
    (seconds * 1e9).round() as Nanoseconds
}

/// Chooses the frames of one topic, one after the other.
#[derive(Debug)]
pub(crate) struct Sampler {
    /// Minimum time between two frames; 0 for every frame.
    interval: Nanoseconds,
    /// Times to sample since the first frame, sorted; empty if the interval decides.
    at: Vec<Nanoseconds>,
    /// Maximum number of frames.
    limit: usize,
    progress: SamplerProgress,
    /// Minimum difference from the last chosen frame, in 8-bit codes; `None` if pixels do not matter.
    min_change: Option<f64>,
    last_taken: Option<Thumbnail>,
}

/// Progress of a sampler.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SamplerProgress {
    /// Number of times given with `--at` that are in the past.
    passed: usize,
    /// Number of chosen frames.
    taken: usize,
    /// Time since the first frame of the drive when the next frame is due.
    next: Nanoseconds,
}

impl Sampler {
    /// The progress so far.
    pub(crate) fn progress(&self) -> SamplerProgress {
        self.progress
    }

    /// Returns to an earlier progress, so that the next frame takes the place of one that is broken.
    pub(crate) fn reset(&mut self, progress: SamplerProgress) {
        self.progress = progress;
    }

    /// Chooses a frame by its time. If [`Self::compares_pixels`], [`Self::has_changed`] decides about a due frame.
    pub(crate) fn is_due(&mut self, place: Place) -> bool {
        let since = place.since;
        if self.progress.taken >= self.limit {
            return false;
        }
        if !self.at.is_empty() {
            let passed = self.at.partition_point(|time| *time <= since);
            let is_due = passed > self.progress.passed;
            self.progress.passed = self.progress.passed.max(passed);
            self.progress.taken += usize::from(is_due);
            return is_due;
        }
        let is_due = self.interval == 0 || since >= self.progress.next;
        if is_due && self.interval > 0 {
            self.progress.next = (since / self.interval + 1).saturating_mul(self.interval);
        }
        self.progress.taken += usize::from(is_due);
        is_due
    }

    /// True if the pixels decide about due frames.
    pub(crate) fn compares_pixels(&self) -> bool {
        self.min_change.is_some()
    }

    /// Chooses a due frame if it differs enough from the last chosen frame.
    pub(crate) fn has_changed(&mut self, thumbnail: Thumbnail) -> bool {
        let min_change = self.min_change.unwrap_or(0.0);
        let has_changed = self.last_taken.as_ref().is_none_or(|last| last.difference(&thumbnail) > min_change);
        if has_changed {
            self.last_taken = Some(thumbnail);
        } else {
            self.progress.taken -= 1;
        }
        has_changed
    }

    /// Times given with `--at`, in seconds, after the last frame.
    pub(crate) fn missed(&self) -> Vec<f64> {
        self.at.iter().skip(self.progress.passed).map(|time| seconds(*time)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Indices of the chosen frames, from frames at these times in seconds.
    fn chosen(args: &SamplingArgs, times: &[f64]) -> Vec<usize> {
        let duration = times.last().unwrap() - times[0];
        let mut sampler = args.sampler(duration);
        (0..times.len())
            .filter(|i| {
                sampler.is_due(Place {
                    time: nanoseconds(times[*i]),
                    since: nanoseconds(times[*i] - times[0]),
                    stretch: 0,
                })
            })
            .collect()
    }

    #[test]
    fn one_frame_is_chosen_per_interval() {
        let times = [100.0, 100.5, 101.9, 102.0, 102.1, 107.0, 107.5, 108.0];
        assert_eq!(chosen(&SamplingArgs::default(), &times), [0, 3, 5, 7]);
        let every = SamplingArgs { every: Some(0.0), ..SamplingArgs::default() };
        assert_eq!(chosen(&every, &times).len(), times.len());
    }

    #[test]
    fn broken_frame_gives_its_place_to_the_next() {
        let args = SamplingArgs { max_frames: NonZeroUsize::new(1), ..SamplingArgs::default() };
        let mut sampler = args.sampler(10.0);
        let place = |since| Place { time: since, since, stretch: 0 };
        let before = sampler.progress();
        assert!(sampler.is_due(place(0)));
        sampler.reset(before);
        assert!(sampler.is_due(place(1)));
        // Control: without a reset, no further frame is due.
        assert!(!sampler.is_due(place(2)));
    }

    #[test]
    fn first_frame_at_each_time_is_chosen() {
        let at = SamplingArgs { at: vec![5.0, 0.0, 1.95, 1.96, 99.0], ..SamplingArgs::default() };
        assert_eq!(chosen(&at, &[10.0, 11.0, 11.9, 12.0, 14.9, 15.1]), [0, 3, 5]);
    }

    fn most(n: usize) -> SamplingArgs {
        SamplingArgs { max_frames: NonZeroUsize::new(n), ..SamplingArgs::default() }
    }

    #[test]
    fn at_most_n_frames_are_evenly_spread() {
        let times: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.1).collect();
        assert_eq!(chosen(&most(5), &times), [0, 20, 40, 60, 80]);
        assert_eq!(chosen(&most(1), &times), [0]);
        assert_eq!(chosen(&most(1000), &times).len(), 101);
    }

    #[test]
    fn unchanged_frames_do_not_count() {
        let args = SamplingArgs { changed: Some(5.0), max_frames: NonZeroUsize::new(2), ..SamplingArgs::default() };
        let mut sampler = args.sampler(0.0);
        let found: Vec<bool> = (0..)
            .zip([10, 14, 15, 16, 200])
            .map(|(i, code)| {
                let place = Place { time: i, since: i, stretch: 0 };
                let grey = crate::types::Rgb::new(1, 1, vec![code; 3]).unwrap();
                sampler.is_due(place) && sampler.has_changed(Thumbnail::new(&grey))
            })
            .collect();
        // 15 differs by 5 from the last chosen frame, 10, and 16 by 6.
        assert_eq!(found, [true, false, false, true, false]);
    }
}
