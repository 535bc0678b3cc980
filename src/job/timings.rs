//! Where the time of a run goes: [`Timings`].

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What a thread of the darkroom does, or what the asking waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimedStep {
    /// A file is read and decoded.
    Decode,
    /// Light is taken.
    Darken,
    /// An enhancement model works.
    Enhance,
    /// An image is encoded.
    Encode,
    /// An image waits until it is asked about.
    Waiting,
    /// Nothing is on the wire, for there is no image to ask about.
    Idle,
    /// As much is on the wire as may be.
    Full,
}

impl TimedStep {
    const ALL: [(Self, &str); 7] = [
        (Self::Decode, "decode"),
        (Self::Darken, "darken"),
        (Self::Enhance, "enhance"),
        (Self::Encode, "encode"),
        (Self::Waiting, "waiting"),
        (Self::Idle, "idle"),
        (Self::Full, "full"),
    ];
}

/// The time that went into each step, summed over threads.
#[derive(Debug, Default)]
pub(crate) struct Timings {
    nanoseconds: [AtomicU64; TimedStep::ALL.len()],
}

impl Timings {
    /// Does something, and counts its time.
    pub(crate) fn time<T>(&self, step: TimedStep, act: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let done = act();
        self.add(step, started.elapsed());
        done
    }

    pub(crate) fn add(&self, step: TimedStep, time: Duration) {
        self.nanoseconds[step as usize].fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
    }

    fn seconds(&self, step: TimedStep) -> f64 {
        self.nanoseconds[step as usize].load(Ordering::Relaxed) as f64 / 1e9
    }

    /// What bound a run that took so long on so many threads, in one line.
    pub(crate) fn told(&self, took: Duration, threads: usize) -> String {
        TimingsText {
            timings: self,
            took: took.as_secs_f64(),
            threads,
        }
        .to_string()
    }
}

struct TimingsText<'a> {
    timings: &'a Timings,
    took: f64,
    threads: usize,
}

impl fmt::Display for TimingsText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            timings,
            took,
            threads,
        } = *self;
        let making = [
            TimedStep::Decode,
            TimedStep::Darken,
            TimedStep::Enhance,
            TimedStep::Encode,
        ];
        let busy: f64 = making.iter().map(|step| timings.seconds(*step)).sum();
        write!(f, "timings: {took:.1} s; images:")?;
        for (step, name) in TimedStep::ALL {
            if making.contains(&step) {
                write!(f, " {name} {:.1} s,", timings.seconds(step))?;
            }
        }
        let (idle, full) = (
            timings.seconds(TimedStep::Idle),
            timings.seconds(TimedStep::Full),
        );
        write!(
            f,
            " {:.0} % of {threads} threads; they waited {:.1} s for requests; requests: none on the wire {idle:.1} s, all that may be \
             {full:.1} s; ",
            100.0 * busy / (took * threads as f64).max(1e-9),
            timings.seconds(TimedStep::Waiting)
        )?;
        let slowest = making
            .into_iter()
            .max_by(|a, b| timings.seconds(*a).total_cmp(&timings.seconds(*b)));
        f.write_str(match slowest {
            _ if full > idle && full > took / 4.0 => {
                "the endpoint binds: more --concurrency, or a faster endpoint, would help"
            }
            _ if idle < took / 4.0 => "nothing binds much",
            Some(TimedStep::Enhance) => {
                "making images binds, enhancement most: more cores, --shard over machines or --llie-max-side would help"
            }
            Some(TimedStep::Encode) => {
                "making images binds, encoding most: more cores, --shard over machines, or smaller images (--max-side, --image \
                 jpeg:95) would help"
            }
            _ => "making images binds: more cores or --shard over machines would help",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_what_binds() {
        let second = Duration::from_secs;
        let told = |steps: &[(TimedStep, u64)]| {
            let timings = Timings::default();
            for (step, seconds) in steps {
                timings.add(*step, second(*seconds));
            }
            timings.told(second(10), 2)
        };
        let line = told(&[
            (TimedStep::Encode, 12),
            (TimedStep::Decode, 6),
            (TimedStep::Idle, 9),
        ]);
        assert!(
            line.contains("decode 6.0 s") && line.contains("90 % of 2 threads"),
            "{line}"
        );
        assert!(line.contains("encoding most"), "{line}");
        assert!(told(&[(TimedStep::Full, 9)]).contains("the endpoint binds"));
        assert!(
            told(&[(TimedStep::Enhance, 9), (TimedStep::Idle, 5)]).contains("enhancement most")
        );
        assert!(
            told(&[(TimedStep::Encode, 1), (TimedStep::Idle, 1)]).contains("nothing binds much")
        );
    }
}
