//! Time that an enhancer takes for an image, by size: [`Latency`].

use std::collections::BTreeMap;
use std::fmt;
use std::time::{Duration, Instant};

use darkqa_base::types::Rgb;
use darkqa_base::types::manifests::EnhancerLatency;
use darkqa_enhance::Enhancer;

/// Time after which no further image is timed (chosen: a run waits no longer for it).
const ENOUGH: Duration = Duration::from_secs(2);

/// Times of an enhancer for images, one after the other.
#[derive(Debug, Default)]
pub struct Latency {
    /// Times by width and height, in the order of the images.
    by_size: BTreeMap<(usize, usize), Vec<Duration>>,
    /// Largest number of threads for an image.
    threads: usize,
}

impl Latency {
    /// No time yet, of an enhancer with at most this number of threads.
    pub fn new(threads: usize) -> Self {
        Self { by_size: BTreeMap::new(), threads }
    }

    /// Runs `enhance` for an image of this width and height, and adds its time. An image that fails has none.
    pub fn time<T, E>(&mut self, size: (usize, usize), enhance: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
        let started = Instant::now();
        let enhanced = enhance()?;
        self.add(size, started.elapsed());
        Ok(enhanced)
    }

    /// Times an enhancer on images until [`ENOUGH`] has passed. The images are not counted as enhanced images of a run.
    pub fn measure(enhancer: &mut Enhancer, images: &[Rgb]) -> Self {
        let mut latency = Self::new(enhancer.threads());
        let started = Instant::now();
        for image in images {
            // A failure is reported where the image is needed.
            let _ = latency.time((image.width(), image.height()), || enhancer.enhance_uncounted(image));
            if started.elapsed() > ENOUGH {
                break;
            }
        }
        latency
    }

    /// The times of each size, without the first one, which includes the preparation for that size, unless it is the
    /// only one.
    pub fn by_size(&self) -> Vec<EnhancerLatency> {
        self.by_size
            .iter()
            .map(|((width, height), times)| {
                let mut sorted = if times.len() > 1 { times[1..].to_vec() } else { times.clone() };
                sorted.sort_unstable();
                EnhancerLatency {
                    width: *width,
                    height: *height,
                    images: sorted.len(),
                    median_ms: quantile_ms(&sorted, 0.5),
                    within_95_ms: quantile_ms(&sorted, 0.95),
                    with_preparation: times.len() == 1,
                    threads: self.threads,
                    machine: machine(),
                }
            })
            .collect()
    }

    fn add(&mut self, size: (usize, usize), time: Duration) {
        self.by_size.entry(size).or_default().push(time);
    }
}

/// The smallest time that at least this share of the sorted times do not exceed, in milliseconds.
fn quantile_ms(sorted: &[Duration], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1].as_secs_f64() * 1e3
}

impl fmt::Display for Latency {
    /// One line per size; empty without times.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.by_size().iter().try_for_each(|latency| writeln!(f, "latency: {latency}"))
    }
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
        assert_eq!(latency.time((4, 4), || Err::<i32, &str>("refused")), Err("refused"));
        assert_eq!(latency.to_string(), "");
        assert_eq!(latency.time((8, 8), || Ok::<i32, &str>(5)), Ok(5));
        assert!(latency.to_string().contains("8 × 8"));
    }
}
