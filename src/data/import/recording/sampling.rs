//! Choice of frames from a recording or video: [`SamplingArgs`] and [`Sampler`].
//!
//! Division of a drive into stretches of equal duration, one scene each: [`Stretches`].
//!
//! Small grey copy of a frame, to compare frames: [`GreyBlocks`].

use std::num::NonZeroUsize;

use clap::Args;

use super::{Nanoseconds, seconds};
use darkqa_base::types::flags::positive;
use darkqa_base::types::{Decides, Rgb};

/// Default interval between two frames, in seconds, as in DarkQA.
const INTERVAL: f64 = 2.0;

/// Flags that choose the frames of each topic.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Key frames")]
pub struct SamplingArgs {
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
    pub fn interval(&self) -> f64 {
        let has_other_flag = !self.at.is_empty() || self.max_frames.is_some() || self.changed.is_some();
        self.every.unwrap_or(if has_other_flag { 0.0 } else { INTERVAL })
    }

    /// Sampler for a topic of this duration, in seconds.
    pub fn sampler(&self, duration: f64) -> Sampler {
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
    pub fn description(&self) -> String {
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
pub struct Sampler {
    /// Minimum time between two frames; 0 for every frame.
    interval: Nanoseconds,
    /// Times to sample since the first frame, sorted; empty if the interval decides.
    at: Vec<Nanoseconds>,
    /// Maximum number of frames.
    limit: usize,
    progress: SamplerProgress,
    /// Minimum difference from the last chosen frame, in 8-bit codes; `None` if pixels do not matter.
    min_change: Option<f64>,
    last_taken: Option<GreyBlocks>,
}

/// Progress of a sampler.
#[derive(Debug, Clone, Copy, Default)]
pub struct SamplerProgress {
    /// Number of times given with `--at` that are in the past.
    passed: usize,
    /// Number of chosen frames.
    taken: usize,
    /// Time since the first frame of the drive when the next frame is due.
    next: Nanoseconds,
}

impl Sampler {
    /// The progress so far.
    pub fn progress(&self) -> SamplerProgress {
        self.progress
    }

    /// Returns to an earlier progress, so that the next frame takes the place of one that is broken.
    pub fn reset(&mut self, progress: SamplerProgress) {
        self.progress = progress;
    }

    /// Chooses a frame by its time. If [`Self::compares_pixels`], [`Self::has_changed`] decides about a due frame.
    pub fn is_due(&mut self, place: Place) -> bool {
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
    pub fn compares_pixels(&self) -> bool {
        self.min_change.is_some()
    }

    /// Chooses a due frame if it differs enough from the last chosen frame.
    pub fn has_changed(&mut self, thumbnail: GreyBlocks) -> bool {
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
    pub fn missed(&self) -> Vec<f64> {
        self.at.iter().skip(self.progress.passed).map(|time| seconds(*time)).collect()
    }
}

/// Maximum time that a message arrives out of order (chosen). A frame that goes further back starts a new clock, as in
/// a recording that is played again.
const MAX_REORDERING: Nanoseconds = 5_000_000_000;

/// Maximum difference between the delays of two topics to the recorder (chosen). If the first frames of two topics
/// differ more than this, the topics have different clocks.
const MAX_DELAY_DIFFERENCE: Nanoseconds = 1_000_000_000;

/// Position of a frame in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Time of the frame on the clock of its topic.
    pub time: Nanoseconds,
    /// Time since the first frame of the drive, at least 0.
    pub since: Nanoseconds,
    /// Number of the stretch, from 0.
    pub stretch: u64,
}

/// Clock of one topic.
#[derive(Debug, Default)]
pub struct TopicClock(Option<ClockRun>);

/// Run of a clock without a jump back.
#[derive(Debug, Clone, Copy)]
struct ClockRun {
    /// Time of the first frame on this clock.
    first: Nanoseconds,
    /// Time of the first frame since the first frame of the drive.
    since: Nanoseconds,
    /// Latest time of a frame on this clock.
    latest: Nanoseconds,
    /// Log time of the last frame.
    log_time: Nanoseconds,
}

impl ClockRun {
    /// Converts a time on this clock to the time since the first frame of the drive.
    fn since(self, time: Nanoseconds) -> Nanoseconds {
        let passed = time.saturating_sub(self.first);
        self.since.saturating_add(passed).max(0)
    }
}

/// Stretches of equal duration, counted from the first frame of the drive, whether or not it is chosen. The topics may
/// have different clocks; the log time relates them, also after a clock jumped back. If the log time jumped back, too,
/// the next stretch starts.
#[derive(Debug)]
pub struct Stretches {
    /// Duration of a stretch.
    length: Nanoseconds,
    start: Option<DriveStart>,
}

/// Times of the first frame of a drive.
#[derive(Debug, Clone, Copy)]
struct DriveStart {
    time: Nanoseconds,
    log_time: Nanoseconds,
}

impl Stretches {
    /// Stretches of this duration.
    pub fn new(seconds: f64) -> Self {
        Self { length: ((seconds * 1e9) as Nanoseconds).max(1), start: None }
    }

    /// Log time of the first frame.
    pub fn log_start(&self) -> Option<Nanoseconds> {
        self.start.map(|start| start.log_time)
    }

    /// Position of the next frame of a topic, from its time on the clock of its topic and its log time.
    pub fn place(&mut self, clock: &mut TopicClock, time: Nanoseconds, log_time: Nanoseconds) -> Place {
        let start = *self.start.get_or_insert(DriveStart { time, log_time });
        let mut run = match clock.0 {
            Some(run) if run.latest.saturating_sub(time) <= MAX_REORDERING => run,
            previous => ClockRun {
                first: time,
                since: self.start_of_run(start, time, log_time, previous),
                latest: time,
                log_time,
            },
        };
        run.latest = run.latest.max(time);
        run.log_time = log_time;
        clock.0 = Some(run);
        let since = run.since(time);
        Place { time, since, stretch: (since / self.length).unsigned_abs() }
    }

    /// Time from the first frame of the drive to the first frame of a clock run: by the clock if it is the same as the
    /// clock of the drive's first frame, else by the log time. If both jumped back, the run starts with the next
    /// stretch.
    fn start_of_run(
        &self,
        start: DriveStart,
        time: Nanoseconds,
        log_time: Nanoseconds,
        previous: Option<ClockRun>,
    ) -> Nanoseconds {
        let by_log = log_time.saturating_sub(start.log_time);
        let Some(previous) = previous else {
            let by_clock = time.saturating_sub(start.time);
            let is_same_clock = by_clock.saturating_sub(by_log).saturating_abs() <= MAX_DELAY_DIFFERENCE;
            return if is_same_clock { by_clock } else { by_log.max(0) };
        };
        if log_time > previous.log_time {
            return by_log.max(0);
        }
        let passed = previous.since(previous.latest) / self.length;
        let next = passed.saturating_add(1).saturating_mul(self.length);
        by_log.max(next)
    }
}

/// Blocks along each side.
const SIDE: usize = 16;

/// Mean grey codes of 16 × 16 blocks; grey is the mean of the three channels.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyBlocks(Vec<f64>);

impl GreyBlocks {
    /// Makes the thumbnail of an image.
    pub fn new(image: &Rgb) -> Self {
        let mut blocks = vec![(0_u64, 0_u64); SIDE * SIDE];
        for (y, row) in image.samples().chunks_exact(image.width() * 3).enumerate() {
            let line = &mut blocks[y * SIDE / image.height() * SIDE..][..SIDE];
            for (x, pixel) in row.chunks_exact(3).enumerate() {
                let (sum, count) = &mut line[x * SIDE / image.width()];
                *sum += pixel.iter().map(|code| u64::from(*code)).sum::<u64>();
                *count += 3;
            }
        }
        // An image smaller than the grid has empty blocks, the same ones in every frame.
        Self(blocks.into_iter().filter(|(_, count)| *count > 0).map(|(sum, count)| sum as f64 / count as f64).collect())
    }

    /// Mean absolute difference of the blocks, in 8-bit codes. Frames of other sizes may have fewer blocks; only the
    /// blocks that both have are compared.
    pub fn difference(&self, other: &Self) -> f64 {
        let count = self.0.len().min(other.0.len()).max(1);
        self.0.iter().zip(&other.0).map(|(a, b)| (a - b).abs()).sum::<f64>() / count as f64
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
                let grey = darkqa_base::types::Rgb::new(1, 1, vec![code; 3]).unwrap();
                sampler.is_due(place) && sampler.has_changed(GreyBlocks::new(&grey))
            })
            .collect();
        // 15 differs by 5 from the last chosen frame, 10, and 16 by 6.
        assert_eq!(found, [true, false, false, true, false]);
    }

    fn nanoseconds(seconds: f64) -> Nanoseconds {
        (seconds * 1e9) as Nanoseconds
    }

    fn stretches(times: &[f64]) -> Vec<u64> {
        let (mut stretches, mut clock) = (Stretches::new(10.0), TopicClock::default());
        times
            .iter()
            .map(|time| nanoseconds(*time))
            .map(|time| stretches.place(&mut clock, time, time).stretch)
            .collect()
    }

    #[test]
    fn stretches_are_counted_from_the_first_frame() {
        assert_eq!(stretches(&[5.0, 14.9, 15.0, 44.0]), [0, 0, 1, 3]);
    }

    #[test]
    fn clock_that_jumps_back_starts_the_next_stretch() {
        assert_eq!(stretches(&[100.0, 125.0, 3.0, 12.0, 14.0]), [0, 2, 3, 3, 4]);
        // A drive that is played again repeats its first time.
        assert_eq!(stretches(&[100.0, 125.0, 100.0, 111.0]), [0, 2, 3, 4]);
        // Frames that are slightly out of order do not start a stretch.
        assert_eq!(stretches(&[100.0, 100.9, 100.2, 99.95]), [0, 0, 0, 0]);
    }

    #[test]
    fn topics_with_different_clocks_share_stretches() {
        for milliseconds in [0, 900, -1200, 2000, -1_600_000_000_000] {
            let offset = milliseconds * 1_000_000;
            let mut stretches = Stretches::new(10.0);
            let [mut front, mut rear] = [(); 2].map(|()| TopicClock::default());
            for second in 0..40 {
                let time = second * 1_000_000_000;
                let log_time = time + 20_000_000;
                let places =
                    [stretches.place(&mut front, time, log_time), stretches.place(&mut rear, time + offset, log_time)];
                let [front, rear] = places.map(|place| place.since);
                let difference = rear.saturating_sub(front);
                let expected = if milliseconds.abs() < 1000 { offset } else { 0 };
                assert_eq!(difference, expected, "{milliseconds}");
            }
        }
    }

    #[test]
    fn replayed_drive_continues_by_log_time() {
        let (mut stretches, mut clock) = (Stretches::new(10.0), TopicClock::default());
        let found = [(0, 0), (24, 24), (0, 25), (24, 49)].map(|(time, log_time)| {
            let [time, log_time] = [time, log_time].map(|seconds| seconds * 1_000_000_000);
            stretches.place(&mut clock, time, log_time).stretch
        });
        assert_eq!(found, [0, 2, 2, 4]);
    }

    #[test]
    fn extreme_times_do_not_overflow() {
        let (mut stretches, mut clock) = (Stretches::new(1e-9), TopicClock::default());
        for time in [i64::MIN, i64::MAX, 0, i64::MIN, -1, i64::MAX] {
            for log_time in [i64::MIN, 0, i64::MAX] {
                stretches.place(&mut clock, time, log_time);
            }
        }
    }

    fn flat(code: u8) -> GreyBlocks {
        GreyBlocks::new(&Rgb::new(20, 33, vec![code; 20 * 33 * 3]).unwrap())
    }

    #[test]
    fn the_difference_is_in_codes() {
        assert!((flat(10).difference(&flat(17)) - 7.0).abs() < 1e-9);
        let mut half = vec![0; 32 * 32 * 3];
        half[..16 * 32 * 3].fill(200);
        let half = GreyBlocks::new(&Rgb::new(32, 32, half).unwrap());
        let black = GreyBlocks::new(&Rgb::black(32, 32));
        assert!((half.difference(&black) - 100.0).abs() < 1e-9);
    }
}
