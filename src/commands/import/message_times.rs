//! Times of the images of a topic: [`MessageTimes`].

use crate::data::import::recording::Nanoseconds;

/// Times of the images of a topic. Some drivers state one time stamp in all messages; the recorder's clock then
/// continues it.
#[derive(Debug, Default)]
pub(super) struct MessageTimes {
    /// Time stamp and log time of the first message.
    first: Option<[Nanoseconds; 2]>,
    /// True if a later message has another time stamp.
    has_changed: bool,
    /// True if a later message has another log time.
    log_advances: bool,
}

impl MessageTimes {
    /// The time of the next message from its time stamp, `None` if it has none, and the time of the recorder.
    pub(super) fn next(&mut self, stamp: Option<Nanoseconds>, log_time: Nanoseconds) -> Nanoseconds {
        let Some(stamp) = stamp else {
            return log_time;
        };
        let [first, first_log] = *self.first.get_or_insert([stamp, log_time]);
        self.has_changed |= stamp != first;
        self.log_advances |= log_time != first_log;
        if self.has_changed {
            return stamp;
        }
        stamp.saturating_add(log_time.saturating_sub(first_log))
    }

    /// True if several messages have the same time stamp, and none has another.
    pub(super) fn is_constant(&self) -> bool {
        self.log_advances && !self.has_changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(stamps: &[i64], log_times: &[i64]) -> (Vec<i64>, bool) {
        let mut times = MessageTimes::default();
        let found = stamps
            .iter()
            .zip(log_times)
            .map(|(stamp, log)| times.next((*stamp != 0).then_some(*stamp), *log))
            .collect();
        (found, times.is_constant())
    }

    #[test]
    fn constant_stamps_follow_the_recorder() {
        assert_eq!(times(&[7, 7, 7], &[100, 101, 105]), (vec![7, 8, 12], true));
        // Controls: stamps that advance, one message, no stamps, a recorder without a clock.
        assert_eq!(times(&[7, 9, 11], &[100, 101, 105]), (vec![7, 9, 11], false));
        assert_eq!(times(&[7], &[100]), (vec![7], false));
        assert_eq!(times(&[0, 0], &[100, 101]), (vec![100, 101], false));
        assert_eq!(times(&[7, 7], &[100, 100]), (vec![7, 7], false));
        // A stamp that is repeated once is no constant one.
        assert_eq!(times(&[7, 7, 9, 7], &[100, 101, 102, 103]), (vec![7, 8, 9, 7], false));
    }
}
