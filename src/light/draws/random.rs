//! Counter-based random numbers: [`NoiseKey`], [`Stream`], [`Site`].
//!
//! A draw is a pure function of (seed, frame, component, sensor row, sensor column, index of the draw), so that it does
//! not depend on threads or order. The generator is Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as
//! 1, 2, 3", SC 2011), which passes BigCrush on plain counters; its key is taken from a BLAKE3 digest.
//!
//! Batches of samples: [`Lanes`].

use std::convert::Infallible;
use std::f64::consts::PI;

use rand::TryRng;
use rand::distr::{Distribution as _, Open01};
use rand::rand_core::utils::{fill_bytes_via_next_word, next_u64_via_u32};

use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Digest, FrameId, Severity};

/// Key of a frame's random numbers, derived from the seed of the run and the name of the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoiseKey {
    noise: Digest,
    /// Key of the camera's state; differs from `noise` if several frames share a camera.
    camera: Digest,
}

impl NoiseKey {
    /// The key of a frame for a seed.
    #[must_use]
    pub fn new(seed: u64, frame: &FrameId) -> Self {
        let parts: [&[u8]; 3] = [b"darkqa-eval noise", &seed.to_le_bytes(), frame.0.as_bytes()];
        let noise = Digest::from_parts(parts);
        Self { noise, camera: noise }
    }

    /// Replaces the camera's state by that of a walk; the noise of the frame stays.
    #[must_use]
    pub fn with_camera_of(self, walk: &Self) -> Self {
        Self { camera: walk.camera, ..self }
    }

    /// The key of the same frame at one severity, whose noise is independent of other severities. It is derived from
    /// the label, such as `L3` or `E3.3`.
    #[must_use]
    pub fn at(&self, severity: Severity) -> Self {
        let level = Kind::Sensor.label(severity);
        let [noise, camera] =
            [self.noise, self.camera].map(|digest| Digest::from_parts([digest.as_bytes(), level.as_bytes()]));
        Self { noise, camera }
    }

    /// The random numbers of one component, independent of all other components.
    #[must_use]
    pub fn stream(&self, component: Component) -> Stream {
        let key = match component {
            Component::Camera => self.camera,
            Component::Row
            | Component::RandomField
            | Component::ModelInput
            | Component::Motion
            | Component::Resamples => self.noise,
        };
        let digest = Digest::from_parts([key.as_bytes(), component.name().as_bytes()]);
        let [low, high] = [0, 4].map(|at| {
            let mut word = [0; 4];
            word.copy_from_slice(&digest.as_bytes()[at..at + 4]);
            u32::from_le_bytes(word)
        });
        Stream([low, high])
    }
}

/// Purpose of random numbers; each purpose has its own stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// The state of the camera.
    Camera,
    /// Row noise: one number per sensor row.
    Row,
    /// Numbers of each sensor site: see [`RandomField`].
    RandomField,
    /// Noise input of an enhancer.
    ModelInput,
    /// Frames drawn by a bootstrap.
    Resamples,
    /// The direction in which the camera turns.
    Motion,
}

impl Component {
    /// Name that enters the key of the stream. Adding or reordering components does not change the draws of others.
    fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Row => "row",
            Self::RandomField => "field",
            Self::ModelInput => "model input",
            Self::Resamples => "resamples",
            Self::Motion => "motion",
        }
    }
}

/// Random words of 32 bits for [`LANES`] sites of one sensor row, one word per site and use.
#[derive(Debug, Clone)]
pub struct RandomField {
    /// Two words per site for shot noise.
    pub shot: [Lanes<u32>; 2],
    /// One word per site for read noise.
    pub read: Lanes<u32>,
    /// One word per site for quantisation noise.
    pub quantisation: Lanes<u32>,
}

/// Row and column on the sensor, which also determine the Bayer plane and the position in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Site {
    row: u32,
    column: u32,
}

impl Site {
    /// The site at a sensor row and column, each below 2^32.
    #[must_use]
    pub fn new(row: usize, column: usize) -> Self {
        debug_assert!(row >> 32 == 0 && column >> 32 == 0);
        Self { row: row as u32, column: column as u32 }
    }
}

/// Random numbers of one component of one frame, addressed by site and by the index of the draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream([u32; 2]);

impl Stream {
    /// Four words of 32 random bits for the `draw`-th draw at a site.
    #[inline(always)]
    #[must_use]
    pub fn words(self, site: Site, draw: u32) -> [u32; 4] {
        philox([site.column, site.row, draw, 0], self.0)
    }

    /// The words of [`LANES`] sites of a row: `first` and every other column from there, the sites of one Bayer plane.
    #[inline(always)]
    #[must_use]
    pub fn field(self, first: Site) -> RandomField {
        let mut field = RandomField { shot: [[0; LANES]; 2], read: [0; LANES], quantisation: [0; LANES] };
        for lane in 0..LANES {
            let column = first.column.wrapping_add(2 * lane as u32);
            let site = Site { column, ..first };
            let words = self.words(site, 0);
            field.shot[0][lane] = words[0];
            field.shot[1][lane] = words[1];
            field.read[lane] = words[2];
            field.quantisation[lane] = words[3];
        }
        field
    }

    /// A generator of the words of one site, for the distributions of `rand`.
    #[must_use]
    pub fn at(self, site: Site) -> SiteWords {
        SiteWords { stream: self, site, next: 0 }
    }
}

/// Generator of the words of one site, for numbers that are drawn once per frame or row.
#[derive(Debug, Clone)]
pub struct SiteWords {
    stream: Stream,
    site: Site,
    next: u32,
}

impl SiteWords {
    /// A standard normal number (Box and Muller 1958), from the four words of one draw.
    pub fn normal(&mut self) -> f64 {
        let [radius, angle]: [f64; 2] = [Open01.sample(self), Open01.sample(self)];
        (-2.0 * libm::log(radius)).sqrt() * libm::cos(2.0 * PI * angle)
    }
}

impl TryRng for SiteWords {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        let words = self.stream.words(self.site, self.next / 4);
        let word = words[self.next as usize % 4];
        self.next += 1;
        Ok(word)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        next_u64_via_u32(self)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        fill_bytes_via_next_word(bytes, || self.try_next_u32())
    }
}

/// The block function Philox4x32 with ten rounds.
#[inline(always)]
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let first = u64::from(counter[0]) * 0xD251_1F53;
        let second = u64::from(counter[2]) * 0xCD9E_8D57;
        counter = [
            (second >> 32) as u32 ^ counter[1] ^ key[0],
            second as u32,
            (first >> 32) as u32 ^ counter[3] ^ key[1],
            first as u32,
        ];
        key[0] = key[0].wrapping_add(0x9E37_79B9);
        key[1] = key[1].wrapping_add(0xBB67_AE85);
    }
    counter
}

/// Samples that a kernel processes at once.
pub(crate) const LANES: usize = 64;

/// Batch of [`LANES`] numbers, one per sample.
pub(crate) type Lanes<T> = [T; LANES];

#[cfg(test)]
mod tests {
    use super::*;

    fn key(seed: u64, frame: &str) -> NoiseKey {
        NoiseKey::new(seed, &FrameId(frame.to_owned()))
    }

    /// Known answers from Random123, the library of the authors.
    #[test]
    fn philox_gives_the_known_answers() {
        let cases = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, answer) in cases {
            assert_eq!(philox(counter, key), answer);
        }
    }

    /// Uniform numbers are the middles of 2^52 equal cells of (0, 1), so that both u and 1 − u are exact. With 53 bits,
    /// the largest number would round to 1, where the quantile functions are infinite.
    #[test]
    fn unit_numbers_are_the_middles_of_cells() {
        let stream = key(5, "frame").stream(Component::Camera);
        let mut words = stream.at(Site::new(3, 0));
        for draw in 0..100 {
            let [a, b, c, d] = stream.words(Site::new(3, 0), draw).map(u64::from);
            for word in [b << 32 | a, d << 32 | c] {
                let unit: f64 = Open01.sample(&mut words);
                let middle = ((word >> 12) as f64 + 0.5) / (1_u64 << 52) as f64;
                assert_eq!(unit.to_bits(), middle.to_bits());
            }
        }
    }

    #[test]
    fn seed_frame_and_component_each_give_another_stream() {
        let first = key(7, "a").stream(Component::RandomField);
        assert_eq!(first, key(7, "a").stream(Component::RandomField));
        assert_ne!(first, key(8, "a").stream(Component::RandomField));
        assert_ne!(first, key(7, "b").stream(Component::RandomField));
        assert_ne!(first, key(7, "a").stream(Component::Row));
    }

    /// Each bit is 1 for half of the sites, and words of neighbouring sites, rows, draws or uses differ in half of
    /// their bits (5 sigma).
    #[test]
    fn bits_are_balanced_and_neighbours_independent() {
        let stream = key(1, "frame").stream(Component::RandomField);
        let (rows, columns) = (256, 512);
        let mut ones = [[0u32; 32]; 4];
        let mut flips = [0u64; 6];
        for row in 0..rows {
            for column in 0..columns {
                let words = stream.words(Site::new(row, column), 0);
                for (counts, word) in ones.iter_mut().zip(words) {
                    for (bit, count) in counts.iter_mut().enumerate() {
                        *count += word >> bit & 1;
                    }
                }
                let others = [
                    stream.words(Site::new(row, column + 1), 0)[0],
                    stream.words(Site::new(row + 1, column), 0)[0],
                    stream.words(Site::new(row, column), 1)[0],
                    words[1],
                    words[2],
                    words[3],
                ];
                for (count, other) in flips.iter_mut().zip(others) {
                    *count += u64::from((words[0] ^ other).count_ones());
                }
            }
        }
        let n = (rows * columns) as f64;
        for count in ones.iter().flatten() {
            assert!((f64::from(*count) - n / 2.0).abs() < 5.0 * (n / 4.0).sqrt());
        }
        for count in flips {
            let bits = 32.0 * n;
            assert!((count as f64 - bits / 2.0).abs() < 5.0 * (bits / 4.0).sqrt());
        }
    }

    #[test]
    fn lanes_are_the_sites_of_a_plane() {
        let stream = key(4, "frame").stream(Component::RandomField);
        let field = stream.field(Site::new(7, 129));
        for lane in [0, 1, LANES - 1] {
            let words = stream.words(Site::new(7, 129 + 2 * lane), 0);
            let found = [field.shot[0], field.shot[1], field.read, field.quantisation];
            assert_eq!(found.map(|lanes| lanes[lane]), words);
        }
    }

    /// χ² test over 64 × 64 cells of a number and its right neighbour.
    #[test]
    fn neighbours_are_uniform_and_independent() {
        const CELLS: usize = 64;
        let stream = key(2, "frame").stream(Component::RandomField);
        let mut cells = vec![0u32; CELLS * CELLS];
        let n = 400_000;
        for i in 0..n {
            let (row, column) = (i / 1000, i % 1000);
            let [left, right] = [2 * column, 2 * column + 1].map(|column| {
                let unit: f64 = Open01.sample(&mut stream.at(Site::new(row, column)));
                (unit * CELLS as f64) as usize
            });
            cells[left * CELLS + right] += 1;
        }
        let expected = f64::from(n as u32) / cells.len() as f64;
        let chi: f64 = cells.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
        let freedom = (cells.len() - 1) as f64;
        assert!((chi - freedom).abs() < 5.0 * (2.0 * freedom).sqrt(), "{chi}");
    }

    #[test]
    fn normal_numbers_have_the_normal_moments() {
        let stream = key(3, "frame").stream(Component::Row);
        let n = 400_000;
        let mut moments = [0.0; 4];
        for i in 0..n {
            let z = stream.at(Site::new(i, 0)).normal();
            let mut power = 1.0;
            for moment in &mut moments {
                power *= z;
                *moment += power / n as f64;
            }
        }
        // The variances of the four sample moments are 1, 2, 15 and 96 over n.
        for (moment, (mean, variance)) in moments.iter().zip([(0.0, 1.0), (1.0, 2.0), (0.0, 15.0), (3.0, 96.0)]) {
            let bound = 5.0 * f64::sqrt(variance / n as f64);
            assert!((moment - mean).abs() < bound, "{moment} against {mean}");
        }
    }
}
