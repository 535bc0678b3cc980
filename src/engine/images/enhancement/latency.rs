//! Time that an enhancer takes for an image, by size: [`Latency`].

use std::collections::BTreeMap;
use std::fmt;
use std::time::{Duration, Instant};

use crate::types::text::counted;

/// Times of an enhancer for images, one after the other.
#[derive(Debug, Default)]
pub(crate) struct Latency {
    /// Times by width and height, in the order of the images.
    by_size: BTreeMap<(usize, usize), Vec<Duration>>,
    /// Largest number of threads for an image.
    threads: usize,
}

impl Latency {
    /// No time yet, of an enhancer with at most this number of threads.
    pub(crate) fn new(threads: usize) -> Self {
        Self { by_size: BTreeMap::new(), threads }
    }

    /// Runs `enhance` for an image of this width and height, and adds its time.
    pub(crate) fn time<T>(&mut self, size: (usize, usize), enhance: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = enhance();
        self.add(size, started.elapsed());
        result
    }

    fn add(&mut self, size: (usize, usize), time: Duration) {
        self.by_size.entry(size).or_default().push(time);
    }
}

/// Times without the first one of a size, which includes the preparation for that size; all if it is the only one.
fn repeated(times: &[Duration]) -> Vec<Duration> {
    let mut times = if times.len() > 1 { times[1..].to_vec() } else { times.to_vec() };
    times.sort_unstable();
    times
}

/// The smallest time that at least this share of the sorted times do not exceed.
fn quantile(sorted: &[Duration], share: f64) -> Duration {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}

impl fmt::Display for Latency {
    /// One line per size: `latency: 640 × 480: 38 ms per image (median of 20 images; 95 % within 44 ms), up to 2 threads
    /// of x86_64, NAME OF THE CPU`. Empty without times.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for ((width, height), times) in &self.by_size {
            let sorted = repeated(times);
            let [median, most] = [0.5, 0.95].map(|share| milliseconds(quantile(&sorted, share)));
            let sample = match (times.len(), sorted.len()) {
                (1, _) => "one image, with the preparation for its size".to_owned(),
                (_, n) => format!("median of {}; 95 % within {most} ms", counted(n, "image")),
            };
            let threads = counted(self.threads, "thread");
            writeln!(
                f,
                "latency: {width} × {height}: {median} ms per image ({sample}), up to {threads} of {}",
                machine()
            )?;
        }
        Ok(())
    }
}

/// A time in milliseconds, with two digits at least: `0.48`, `4.8`, `48`, `480`.
fn milliseconds(time: Duration) -> String {
    let value = time.as_secs_f64() * 1e3;
    let decimals = match value {
        ..1.0 => 2,
        1.0..10.0 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

/// Architecture, and the name of the CPU where the system states it (Linux).
fn machine() -> String {
    let facts = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        facts.lines().find_map(|line| Some(line.strip_prefix("model name")?.split_once(':')?.1.trim().to_owned()));
    let architecture = std::env::consts::ARCH;
    name.map_or_else(|| architecture.to_owned(), |name| format!("{architecture}, {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_image_of_a_size_is_its_preparation() {
        let mut latency = Latency::new(2);
        assert_eq!(latency.to_string(), "");
        for ms in [900, 40, 10, 20, 30] {
            latency.add((640, 480), Duration::from_millis(ms));
        }
        latency.add((64, 48), Duration::from_micros(1500));
        let text = latency.to_string();
        let [small, large] = &text.lines().collect::<Vec<_>>()[..] else { panic!("{text}") };
        assert!(
            small.starts_with("latency: 64 × 48: 1.5 ms per image (one image, with the preparation for its size), ")
        );
        assert!(large.starts_with(
            "latency: 640 × 480: 20 ms per image (median of 4 images; 95 % within 40 ms), up to 2 threads of "
        ));
    }

    #[test]
    fn times_of_an_action_are_added() {
        let mut latency = Latency::new(1);
        assert_eq!(latency.time((8, 8), || 5), 5);
        assert!(latency.to_string().contains("8 × 8"));
    }
}
