//! Division of a drive into stretches of equal duration, one scene each: [`Stretches`].

use super::Nanoseconds;

/// Maximum time that a message arrives out of order (chosen). A frame that goes further back starts a new clock, as in
/// a recording that is played again.
const MAX_REORDERING: Nanoseconds = 5_000_000_000;

/// Maximum difference between the delays of two topics to the recorder (chosen). If the first frames of two topics
/// differ more than this, the topics have different clocks.
const MAX_DELAY_DIFFERENCE: Nanoseconds = 1_000_000_000;

/// Position of a frame in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    /// Time of the frame on the clock of its topic.
    pub(crate) time: Nanoseconds,
    /// Time since the first frame of the drive, at least 0.
    pub(crate) since: Nanoseconds,
    /// Number of the stretch, from 0.
    pub(crate) stretch: u64,
}

/// Clock of one topic.
#[derive(Debug, Default)]
pub(crate) struct TopicClock(Option<ClockRun>);

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
pub(crate) struct Stretches {
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
    pub(crate) fn new(seconds: f64) -> Self {
        Self { length: ((seconds * 1e9) as Nanoseconds).max(1), start: None }
    }

    /// Log time of the first frame.
    pub(crate) fn log_start(&self) -> Option<Nanoseconds> {
        self.start.map(|start| start.log_time)
    }

    /// Position of the next frame of a topic, from its time on the clock of its topic and its log time.
    pub(crate) fn place(&mut self, clock: &mut TopicClock, time: Nanoseconds, log_time: Nanoseconds) -> Place {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
