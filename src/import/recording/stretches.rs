//! The clocks of topics, and the parts of a drive that are scenes: [`Stretches`].

use super::Nanoseconds;

/// A frame this much earlier than an earlier frame of its topic starts a new clock (chosen): messages overtake each other by less, and a
/// recording that is played again goes further back.
const SET_BACK: Nanoseconds = 5_000_000_000;

/// Topics whose first frames differ by this much more in their own times than in the recorder's have different clocks (chosen): a frame
/// reaches the recorder sooner.
const ANOTHER_CLOCK: Nanoseconds = 1_000_000_000;

/// The place of a frame in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    /// Time of the frame on the clock of its topic.
    pub(crate) time: Nanoseconds,
    /// Time from the first frame of the drive, 0 or more.
    pub(crate) since: Nanoseconds,
    /// Number of the stretch, from 0.
    pub(crate) stretch: u64,
}

/// The clock of one topic.
#[derive(Debug, Default)]
pub(crate) struct TopicClock(Option<ClockRun>);

/// The time since a clock was set.
#[derive(Debug, Clone, Copy)]
struct ClockRun {
    /// Time of the first frame on this clock, and from the first frame of the drive.
    first: Nanoseconds,
    since: Nanoseconds,
    /// The latest time of a frame on this clock.
    latest: Nanoseconds,
    /// The recorder's time of the last frame.
    log_time: Nanoseconds,
}

impl ClockRun {
    /// Time from the first frame of the drive, at a time on this clock.
    fn since(self, time: Nanoseconds) -> Nanoseconds {
        let passed = time.saturating_sub(self.first);
        self.since.saturating_add(passed).max(0)
    }
}

/// The stretches of a drive, of one length in time from the first frame, whatever frames are taken. The clocks of topics may differ; the
/// recorder's time relates them, also after a clock was set back. If that was set back, too, the next stretch begins.
#[derive(Debug)]
pub(crate) struct Stretches {
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
    pub(crate) fn new(seconds: f64) -> Self {
        Self {
            length: ((seconds * 1e9) as Nanoseconds).max(1),
            start: None,
        }
    }

    /// The recorder's time of the first frame.
    pub(crate) fn log_start(&self) -> Option<Nanoseconds> {
        self.start.map(|start| start.log_time)
    }

    /// The place of the next frame of a topic, from its time on the clock of its topic and that of the recorder.
    pub(crate) fn place(
        &mut self,
        clock: &mut TopicClock,
        time: Nanoseconds,
        log_time: Nanoseconds,
    ) -> Place {
        let start = *self.start.get_or_insert(DriveStart { time, log_time });
        let mut run = match clock.0 {
            Some(run) if run.latest.saturating_sub(time) <= SET_BACK => run,
            previous => ClockRun {
                first: time,
                since: self.first_of_clock(start, time, log_time, previous),
                latest: time,
                log_time,
            },
        };
        run.latest = run.latest.max(time);
        run.log_time = log_time;
        clock.0 = Some(run);
        let since = run.since(time);
        Place {
            time,
            since,
            stretch: (since / self.length).unsigned_abs(),
        }
    }

    /// Time from the first frame of the drive to the first frame of a clock: by the clock, if it is that of the drive's first frame, else
    /// by the recorder's. If both were set back, it goes on with the next stretch.
    fn first_of_clock(
        &self,
        start: DriveStart,
        time: Nanoseconds,
        log_time: Nanoseconds,
        previous: Option<ClockRun>,
    ) -> Nanoseconds {
        let recorded = log_time.saturating_sub(start.log_time);
        let Some(previous) = previous else {
            let stated = time.saturating_sub(start.time);
            let is_same = stated.saturating_sub(recorded).saturating_abs() <= ANOTHER_CLOCK;
            return if is_same { stated } else { recorded.max(0) };
        };
        if log_time > previous.log_time {
            return recorded.max(0);
        }
        let passed = previous.since(previous.latest) / self.length;
        let next = passed.saturating_add(1).saturating_mul(self.length);
        recorded.max(next)
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
    fn stretches_have_one_length_from_the_first_frame() {
        assert_eq!(stretches(&[5.0, 14.9, 15.0, 44.0]), [0, 0, 1, 3]);
    }

    #[test]
    fn a_clock_set_back_starts_the_next_stretch() {
        assert_eq!(stretches(&[100.0, 125.0, 3.0, 12.0, 14.0]), [0, 2, 3, 3, 4]);
        // A drive that is played again has its first time twice.
        assert_eq!(stretches(&[100.0, 125.0, 100.0, 111.0]), [0, 2, 3, 4]);
        // Frames that overtake each other do not.
        assert_eq!(stretches(&[100.0, 100.9, 100.2, 99.95]), [0, 0, 0, 0]);
    }

    #[test]
    fn topics_with_other_clocks_share_their_stretches() {
        for milliseconds in [0, 900, -1200, 2000, -1_600_000_000_000] {
            let offset = milliseconds * 1_000_000;
            let mut stretches = Stretches::new(10.0);
            let [mut front, mut rear] = [(); 2].map(|()| TopicClock::default());
            for second in 0..40 {
                let time = second * 1_000_000_000;
                let log_time = time + 20_000_000;
                let places = [
                    stretches.place(&mut front, time, log_time),
                    stretches.place(&mut rear, time + offset, log_time),
                ];
                let [front, rear] = places.map(|place| place.since);
                let difference = rear.saturating_sub(front);
                let expected = if milliseconds.abs() < 1000 { offset } else { 0 };
                assert_eq!(difference, expected, "{milliseconds}");
            }
        }
    }

    #[test]
    fn a_drive_that_is_played_again_goes_on_by_the_recorder() {
        let (mut stretches, mut clock) = (Stretches::new(10.0), TopicClock::default());
        let found = [(0, 0), (24, 24), (0, 25), (24, 49)].map(|(time, log_time)| {
            let [time, log_time] = [time, log_time].map(|seconds| seconds * 1_000_000_000);
            stretches.place(&mut clock, time, log_time).stretch
        });
        assert_eq!(found, [0, 2, 2, 4]);
    }

    #[test]
    fn any_times_have_places() {
        let (mut stretches, mut clock) = (Stretches::new(1e-9), TopicClock::default());
        for time in [i64::MIN, i64::MAX, 0, i64::MIN, -1, i64::MAX] {
            for log_time in [i64::MIN, 0, i64::MAX] {
                stretches.place(&mut clock, time, log_time);
            }
        }
    }
}
