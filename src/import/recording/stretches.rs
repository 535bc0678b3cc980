//! The parts of a drive that are scenes: [`Stretches`].

use super::Nanoseconds;

/// A frame this much earlier than an earlier frame starts a new clock (chosen): recorders write the topics of one moment within
/// milliseconds, and a clock that was set goes further.
const SET_BACK: Nanoseconds = 1_000_000_000;

/// The place of a frame in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    /// Time of the first frame since the clock was set.
    pub(crate) start: Nanoseconds,
    /// Time of the frame.
    pub(crate) time: Nanoseconds,
    /// Number of the stretch, from 0.
    pub(crate) stretch: u64,
}

/// The stretches of a drive, of one length in time from the first frame, whatever frames are taken. If time goes back by more than a
/// second, the next stretch begins.
#[derive(Debug)]
pub(crate) struct Stretches {
    length: Nanoseconds,
    /// Number of the first stretch since the clock was set, and of the last one.
    first: u64,
    last: u64,
    start: Option<Nanoseconds>,
    latest: Nanoseconds,
}

impl Stretches {
    pub(crate) fn new(seconds: f64) -> Self {
        Self {
            length: ((seconds * 1e9) as Nanoseconds).max(1),
            first: 0,
            last: 0,
            start: None,
            latest: Nanoseconds::MIN,
        }
    }

    /// Time of the first frame since the clock was set.
    pub(crate) fn start(&self) -> Option<Nanoseconds> {
        self.start
    }

    /// The place of the next frame.
    pub(crate) fn place(&mut self, time: Nanoseconds) -> Place {
        let back = self.latest.saturating_sub(time);
        let is_set = back > SET_BACK;
        let start = match self.start {
            Some(start) if !is_set => start,
            previous => {
                self.first = self.last.saturating_add(u64::from(previous.is_some()));
                self.latest = time;
                time
            }
        };
        self.start = Some(start);
        self.latest = self.latest.max(time);
        let since = time.saturating_sub(start).max(0);
        let stretch = self
            .first
            .saturating_add((since / self.length).unsigned_abs());
        self.last = self.last.max(stretch);
        Place {
            start,
            time,
            stretch,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretches(times: &[f64]) -> Vec<u64> {
        let mut stretches = Stretches::new(10.0);
        times
            .iter()
            .map(|time| stretches.place((time * 1e9) as Nanoseconds).stretch)
            .collect()
    }

    #[test]
    fn stretches_have_one_length_from_the_first_frame() {
        assert_eq!(stretches(&[5.0, 14.9, 15.0, 44.0]), [0, 0, 1, 3]);
    }

    #[test]
    fn a_clock_set_back_starts_the_next_stretch() {
        assert_eq!(stretches(&[100.0, 125.0, 3.0, 12.0, 14.0]), [0, 2, 3, 3, 4]);
        // Frames that overtake each other do not.
        assert_eq!(stretches(&[100.0, 100.9, 100.2, 99.95]), [0, 0, 0, 0]);
    }

    #[test]
    fn any_times_have_places() {
        let mut stretches = Stretches::new(1e-9);
        for time in [i64::MIN, i64::MAX, 0, i64::MIN, -1, i64::MAX] {
            stretches.place(time);
        }
    }
}
