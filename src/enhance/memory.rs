//! Estimate of the memory that a whole image needs: [`MemoryCost`].
//!
//! ONNX Runtime does not report how much memory a graph needs. So two small parts of the image are enhanced first, and the
//! growth of the process between them gives the bytes per pixel. This needs Linux's `/proc`; on other systems nothing is
//! estimated.

use std::fs;

/// Sides of the two parts, in pixels.
pub(super) const PROBES: [usize; 2] = [128, 256];

/// Memory that a model needs for one pixel, in bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MemoryCost(f64);

impl MemoryCost {
    /// Cost from the resident bytes after each of the two parts; `None` if they did not grow.
    pub(super) fn of(resident: [u64; 2]) -> Option<Self> {
        let grown = resident[1]
            .checked_sub(resident[0])
            .filter(|grown| *grown > 0)?;
        let pixels = PROBES[1] * PROBES[1] - PROBES[0] * PROBES[0];
        Some(Self(grown as f64 / pixels as f64))
    }

    /// Checks that an image of `pixels` fits into the `available` bytes; the error is needed and available memory in gigabytes.
    pub(super) fn fits(self, pixels: usize, available: u64) -> Result<(), [f64; 2]> {
        const GIGABYTE: f64 = 1e9;
        let needed = self.0 * pixels as f64;
        if needed <= available as f64 {
            Ok(())
        } else {
            Err([needed / GIGABYTE, available as f64 / GIGABYTE])
        }
    }
}

/// Resident memory of this process, in bytes.
pub(super) fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    kilobytes(&status, "VmRSS:")
}

/// Memory that this process may still use, in bytes: the smaller of the machine's free memory and its control group's rest.
pub(super) fn available() -> Option<u64> {
    let free = kilobytes(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")?;
    let number = |path: &str| -> Option<u64> {
        let text = fs::read_to_string(path).ok()?;
        text.trim().parse().ok()
    };
    let groups = [
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        (
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        ),
    ];
    let unused = groups.iter().filter_map(|(limit, used)| {
        let (limit, used) = (number(limit)?, number(used)?);
        Some(limit.saturating_sub(used))
    });
    Some(unused.fold(free, u64::min))
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

    #[test]
    fn growth_gives_the_cost() {
        assert_eq!(MemoryCost::of([5, 5]), None);
        assert_eq!(MemoryCost::of([7, 5]), None);
        // 800 bytes per pixel.
        let cost = MemoryCost::of([1_000, 1_000 + 800 * 3 * 128 * 128]).unwrap();
        assert_eq!(cost.fits(1_000_000, 800_000_001), Ok(()));
        let [needed, available] = cost.fits(1_000_000, 500_000_000).unwrap_err();
        assert!((needed - 0.8).abs() < 1e-9 && (available - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_system_is_read() {
        assert_eq!(
            kilobytes("A: 1 kB\nVmRSS:\t  12 kB\n", "VmRSS:"),
            Some(12_288)
        );
        assert_eq!(kilobytes("VmRSS: much", "VmRSS:"), None);
        if cfg!(target_os = "linux") {
            let resident = resident().unwrap();
            assert!(resident > 100_000 && available().unwrap() > 0);
        }
    }
}
