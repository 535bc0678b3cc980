//! Estimate of the memory that a run needs: [`MemoryCost`].
//!
//! ONNX Runtime does not report how much memory a graph needs. So small images are enhanced first, and the growth of
//! the process's memory between them gives the bytes per pixel, and the bytes per squared pixel count if attention over
//! all pixels makes the growth quadratic. This needs Linux's `/proc`; on other systems, memory is not estimated.

use std::fs;

use super::control_group::unused_memory;

/// Sides of the probe images, in pixels; chosen: attention over 64² pixels takes 67 MB of 32-bit floats, over 256² it
/// would take 17 GB, and that probe is then skipped.
pub(super) const PROBE_SIDES: [usize; 4] = [64, 128, 256, 512];

/// Bytes of the input and output tensors per pixel: three 32-bit floats each.
const TENSOR_BYTES_PER_PIXEL: f64 = 24.0;

/// Ratio of the growth between the last two probes to linear growth above which the growth counts as quadratic; chosen.
const CURVATURE_RATIO: f64 = 1.25;

/// Maximum growth, in bytes, that a probe may hide by reusing freed memory. The GNU C library returns larger blocks to
/// the system at once (`DEFAULT_MMAP_THRESHOLD_MAX` on 64 bits). Measured: 22 MB for Zero-DCE and RUAS after an image
/// of 1280 × 720.
const MAX_HIDDEN_BYTES: f64 = (32 << 20) as f64;

/// Memory that a run needs as a function of its number of pixels n: `linear` · n + `square` · n² bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MemoryCost {
    linear: f64,
    square: f64,
}

impl MemoryCost {
    /// Cost of only the input and output tensors, a lower bound.
    pub(super) fn for_tensors() -> Self {
        Self { linear: TENSOR_BYTES_PER_PIXEL, square: 0.0 }
    }

    /// Cost from the pixels of the last three probes and the resident bytes after each; `None` if the memory did not
    /// grow, or for fewer than two probes. With two probes, all growth counts as quadratic, because that is why a third
    /// one was skipped.
    pub(super) fn from_probes(measured: &[(usize, u64)]) -> Option<Self> {
        let points: Vec<(f64, f64)> = measured[measured.len().saturating_sub(3)..]
            .iter()
            .map(|(pixels, bytes)| (*pixels as f64, *bytes as f64))
            .collect();
        match points[..] {
            [a, b] if b.1 > a.1 => Some(Self { linear: 0.0, square: (b.1 - a.1) / (b.0 * b.0 - a.0 * a.0) }),
            [a, b, c] if c.1 > b.1 => {
                let (first, second) = ((b.1 - a.1).max(0.0), c.1 - b.1);
                let linear = second / (c.0 - b.0);
                if second <= CURVATURE_RATIO * (first + MAX_HIDDEN_BYTES) * (c.0 - b.0) / (b.0 - a.0) {
                    return Some(Self { linear, square: 0.0 });
                }
                // Newton's divided differences of the parabola through the three probes.
                let first = first / (b.0 - a.0);
                let square = (linear - first) / (c.0 - a.0);
                Some(Self { linear: (first - square * (a.0 + b.0)).max(0.0), square })
            }
            _ => None,
        }
    }

    /// Bytes that a probe of `pixels` needs if all growth between the last two probes was quadratic; 0 for fewer than
    /// two probes.
    pub(super) fn worst_case_bytes(measured: &[(usize, u64)], pixels: usize) -> f64 {
        let last_two = &measured[measured.len().saturating_sub(2)..];
        match Self::from_probes(last_two) {
            Some(cost) => cost.bytes(pixels),
            None => 0.0,
        }
    }

    fn bytes(self, pixels: usize) -> f64 {
        let pixels = pixels as f64;
        pixels * (self.linear + self.square * pixels)
    }

    /// Checks that a run of `pixels` fits into the `available` bytes.
    ///
    /// # Errors
    /// The needed and the available memory, in gigabytes.
    pub(super) fn check_fit(self, pixels: usize, available: u64) -> Result<(), [f64; 2]> {
        const GIGABYTE: f64 = 1e9;
        let needed = self.bytes(pixels);
        if needed <= available as f64 { Ok(()) } else { Err([needed / GIGABYTE, available as f64 / GIGABYTE]) }
    }
}

/// Resident memory of this process, in bytes.
pub(crate) fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    kilobytes(&status, "VmRSS:")
}

/// Memory that this process may still use, in bytes: the minimum of the machine's free memory and the unused memory of
/// its control groups.
pub(crate) fn available() -> Option<u64> {
    let free = kilobytes(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")?;
    Some(unused_memory().map_or(free, |unused| unused.min(free)))
}

/// Value of a line like `VmRSS:  1234 kB`, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let value: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024 * value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels of each probe and the resident bytes after it, for a model of this cost of which `hidden` bytes reuse
    /// freed memory.
    fn measured(hidden: f64, cost: impl Fn(f64) -> f64) -> Vec<(usize, u64)> {
        PROBE_SIDES
            .iter()
            .map(|side| side * side)
            .map(|pixels| {
                let grown = (cost(pixels as f64) - hidden).max(0.0);
                (pixels, 60_000_000 + grown as u64)
            })
            .collect()
    }

    #[test]
    fn cost_is_computed_from_growth() {
        assert_eq!(MemoryCost::from_probes(&[(64, 5), (128, 5), (256, 5)]), None);
        assert_eq!(MemoryCost::from_probes(&[(64, 7), (128, 6), (256, 5)]), None);
        assert_eq!(MemoryCost::from_probes(&[(64, 7)]), None);
        let cost = MemoryCost::from_probes(&measured(0.0, |pixels| 800.0 * pixels)).unwrap();
        assert_eq!(cost.check_fit(1_000_000, 801_000_000), Ok(()));
        let [needed, available] = cost.check_fit(1_000_000, 500_000_000).unwrap_err();
        assert!((needed - 0.8).abs() < 1e-3 && (available - 0.5).abs() < 1e-9);
    }

    #[test]
    fn reused_memory_does_not_make_linear_growth_quadratic() {
        // Zero-DCE after an image of 1280 × 720: sides in pixels, and memory in MiB.
        let zero_dce = [(64 * 64, 77 << 20), (128 * 128, 79 << 20), (256 * 256, 110 << 20), (512 * 512, 344 << 20)];
        let cost = MemoryCost::from_probes(&zero_dce).unwrap();
        let [needed, _] = cost.check_fit(2560 * 1440, 1).unwrap_err();
        assert!((3.0..5.0).contains(&needed), "{needed}");
        for per_pixel in [50.0, 200.0, 1000.0, 20_000.0] {
            for hidden in [0.0, MAX_HIDDEN_BYTES] {
                let points = measured(hidden, |pixels| per_pixel * pixels);
                if let Some(cost) = MemoryCost::from_probes(&points) {
                    assert!(cost.square.abs() < 1e-12, "{per_pixel} {hidden}");
                }
            }
        }
    }

    #[test]
    fn attention_over_all_pixels_is_quadratic() {
        let attention = measured(0.0, |pixels| 100.0 * pixels + 4.0 * pixels * pixels);
        let cost = MemoryCost::from_probes(&attention).unwrap();
        // Attention over 640 × 480 pixels takes 378 GB.
        let [needed, _] = cost.check_fit(640 * 480, 8_000_000_000).unwrap_err();
        assert!((needed - 377.5).abs() < 1.0, "{needed}");
        // Attention at a quarter of the image's size, with reused memory.
        let coarse = measured(MAX_HIDDEN_BYTES, |pixels| 500.0 * pixels + pixels * pixels / 64.0);
        let [needed, _] = MemoryCost::from_probes(&coarse).unwrap().check_fit(2560 * 1440, 1).unwrap_err();
        assert!((200.0..250.0).contains(&needed), "{needed}");
        // From two probes, the third would need 17 GB; without it, the estimate is no smaller.
        let worst = MemoryCost::worst_case_bytes(&attention[..2], 256 * 256);
        assert!((worst / 17.2e9 - 1.0).abs() < 0.1, "{worst}");
        let two = MemoryCost::from_probes(&attention[..2]).unwrap();
        assert!(two.check_fit(640 * 480, 370_000_000_000).is_err());
        // A linear model stays within this bound.
        let linear = measured(0.0, |pixels| 1000.0 * pixels);
        assert!(MemoryCost::worst_case_bytes(&linear[..3], 512 * 512) < 2e9);
        assert!(MemoryCost::worst_case_bytes(&linear[..1], 256 * 256).abs() < 1e-9);
    }

    #[test]
    fn memory_figures_of_the_system_are_parsed() {
        assert_eq!(kilobytes("A: 1 kB\nVmRSS:\t  12 kB\n", "VmRSS:"), Some(12_288));
        assert_eq!(kilobytes("VmRSS: much", "VmRSS:"), None);
        if cfg!(target_os = "linux") {
            let resident = resident().unwrap();
            assert!(resident > 100_000 && available().unwrap() > 0);
        }
    }
}
