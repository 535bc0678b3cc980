//! Limits of memory and time for enhancers.
//!
//! Memory that the Linux control groups (cgroups) of this process still allow: [`unused_memory`].
//!
//! Batch systems and containers limit memory by a control group, and the kernel kills processes that exceed the limit.
//! The limited group can be an ancestor of the process's own group, so all ancestors are checked.
//!
//! Estimate of the memory that a run needs: [`MemoryCost`].
//!
//! ONNX Runtime does not report how much memory a graph needs. So small images are enhanced first, and the growth of
//! the process's memory between them gives the bytes per pixel, and the bytes per squared pixel count if attention over
//! all pixels makes the growth quadratic. This needs Linux's `/proc`; on other systems, memory is not estimated.
//!
//! Limit of the process's memory while an enhancer runs: [`MemoryLimit`].
//!
//! Time limit for one image: [`TimeLimit`], [`ImageClock`].

mod memory_check;

use std::path::{Component, Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use std::{fmt, fs};

use darkqa_base::types::flags::seconds;

pub(super) use memory_check::{MemoryCheck, out_of_memory};

/// Names of folders and files in one version of control groups.
struct GroupFiles {
    /// Controller in the group's line in `/proc/self/cgroup`; empty in version 2.
    controller: &'static str,
    /// Folder of all groups, relative to the mount point.
    folder: &'static str,
    /// File with the limit in bytes.
    limit: &'static str,
    /// File with the used bytes, including cached files.
    used: &'static str,
    /// Key in `memory.stat` for the bytes of cached files that the kernel can reclaim.
    reclaimable: &'static str,
}

/// Layouts of version 2 and version 1.
const LAYOUTS: [GroupFiles; 2] = [
    GroupFiles {
        controller: "",
        folder: "",
        limit: "memory.max",
        used: "memory.current",
        reclaimable: "inactive_file",
    },
    GroupFiles {
        controller: "memory",
        folder: "memory",
        limit: "memory.limit_in_bytes",
        used: "memory.usage_in_bytes",
        reclaimable: "total_inactive_file",
    },
];

/// Bytes that this process may still use under the limits of its control groups; `None` without a limit.
fn unused_memory() -> Option<u64> {
    let own = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    unused_by_groups(&own, Path::new("/sys/fs/cgroup"))
}

/// Bytes that a process with this content of `/proc/self/cgroup` may still use, for groups mounted at `mount`.
fn unused_by_groups(own: &str, mount: &Path) -> Option<u64> {
    LAYOUTS
        .iter()
        .flat_map(|layout| {
            let folder = mount.join(layout.folder);
            // In a container, the path may name groups outside it, and its own group is mounted at the top.
            let path = own_group(own, layout.controller).unwrap_or("/");
            let relative: PathBuf =
                Path::new(path).components().filter(|part| matches!(part, Component::Normal(_))).collect();
            folder
                .join(relative)
                .ancestors()
                .take_while(|group| group.starts_with(&folder))
                .filter_map(|group| unused_in_group(group, layout))
                .collect::<Vec<_>>()
        })
        .min()
}

/// Path of the process's group in the tree of a controller. Version 2 has one tree, whose controller is empty.
fn own_group<'a>(own: &'a str, controller: &str) -> Option<&'a str> {
    own.lines().find_map(|line| {
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        controllers.split(',').any(|one| one == controller).then_some(path)
    })
}

/// Bytes that a group may still use; `None` without a limit.
fn unused_in_group(group: &Path, layout: &GroupFiles) -> Option<u64> {
    let limit = read_number(&group.join(layout.limit))?;
    let used = read_number(&group.join(layout.used))?;
    let statistics = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let reclaimable = statistics.lines().find_map(|line| {
        let (name, bytes) = line.split_once(' ')?;
        (name == layout.reclaimable).then(|| bytes.trim().parse::<u64>().ok())?
    });
    let used = used.saturating_sub(reclaimable.unwrap_or(0));
    Some(limit.saturating_sub(used))
}

/// Number in a file; `None` for `max` and for unreadable files.
fn read_number(file: &Path) -> Option<u64> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

/// Sides of the probe images, in pixels; chosen: attention over 64² pixels takes 67 MB of 32-bit floats, over 256² it
/// would take 17 GB, and that probe is then skipped.
const PROBE_SIDES: [usize; 4] = [64, 128, 256, 512];

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
    fn for_tensors() -> Self {
        Self { linear: TENSOR_BYTES_PER_PIXEL, square: 0.0 }
    }

    /// Cost from the pixels of the last three probes and the resident bytes after each; `None` if the memory did not
    /// grow, or for fewer than two probes. With two probes, all growth counts as quadratic, because that is why a third
    /// one was skipped.
    fn from_probes(measured: &[(usize, u64)]) -> Option<Self> {
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
    fn worst_case_bytes(measured: &[(usize, u64)], pixels: usize) -> f64 {
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
    fn check_fit(self, pixels: usize, available: u64) -> Result<(), [f64; 2]> {
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

/// Maximum memory of this process, in bytes, while an enhancer runs (`--llie-options max-memory`). Without Linux's
/// `/proc`, memory is not limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MemoryLimit(Option<u64>);

/// Share of the memory free at the start that an enhancer may take by default; chosen, to leave the rest to other
/// programs.
const FREE_SHARE: f64 = 0.8;

/// Interval between checks of the memory; chosen. A process can allocate about 1 GB in that time; a check takes about
/// 20 µs.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
const GIGABYTE: f64 = 1e9;

impl MemoryLimit {
    /// No limit.
    pub const NONE: Self = Self(None);

    /// Present memory of the process plus 80 % of the free memory.
    #[must_use]
    pub fn automatic() -> Self {
        match (resident(), available()) {
            (Some(resident), Some(free)) => Self(Some(resident + (FREE_SHARE * free as f64) as u64)),
            _ => Self::NONE,
        }
    }

    /// Interval after which to check the memory again; `None` without a limit.
    pub(crate) fn poll_interval(self) -> Option<Duration> {
        self.0.map(|_| POLL_INTERVAL)
    }

    /// True if the process takes more memory than the limit.
    pub(crate) fn is_exceeded(self) -> bool {
        match (self.0, resident()) {
            (Some(limit), Some(resident)) => resident > limit,
            _ => false,
        }
    }
}

impl fmt::Display for MemoryLimit {
    /// The limit in GB; 0 is none.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gigabytes = self.0.unwrap_or_default() as f64 / GIGABYTE;
        write!(f, "{}", (100.0 * gigabytes).round() / 100.0)
    }
}

impl FromStr for MemoryLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            Ok(0.0) => Ok(Self::NONE),
            Ok(number) if number > 0.0 && number.is_finite() => Ok(Self(Some((number * GIGABYTE) as u64))),
            _ => Err("expected a number of GB (10⁹ bytes), or 0 for no limit".to_owned()),
        }
    }
}

/// Time limit for one image (`--llie-options timeout`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeLimit(Option<Duration>);

/// Number of images in a row that exceed a limit of time or memory after which the enhancer is not run any more;
/// chosen.
pub(super) const MAX_CONSECUTIVE_OVERRUNS: usize = 3;

/// Multiple of the time limit after which a stopped run counts as stuck; chosen. ONNX Runtime ends a run only between
/// two nodes of its graph.
pub(super) const PATIENCE: u32 = 10;

impl TimeLimit {
    /// No limit.
    pub const NONE: Self = Self(None);

    /// A limit; a duration of 0 means no limit.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self((!limit.is_zero()).then_some(limit))
    }

    /// The limit as a duration; `None` for no limit.
    pub(crate) fn get(self) -> Option<Duration> {
        self.0
    }
}

impl Default for TimeLimit {
    /// A limit of ten minutes; chosen.
    fn default() -> Self {
        Self(Some(Duration::from_mins(10)))
    }
}

impl fmt::Display for TimeLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.unwrap_or_default().as_secs_f64())
    }
}

impl FromStr for TimeLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            Ok(0.0) => Ok(Self::NONE),
            _ => seconds(text).map(Self::new),
        }
    }
}

/// Time used by the runs of one image, with its limit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ImageClock {
    limit: TimeLimit,
    used: Duration,
}

impl ImageClock {
    /// A clock at the start of an image.
    pub(crate) fn new(limit: TimeLimit) -> Self {
        Self { limit, used: Duration::ZERO }
    }

    /// Remaining time; `None` without a limit.
    pub(crate) fn remaining(self) -> Option<Duration> {
        Some(self.limit.get()?.saturating_sub(self.used))
    }

    /// Time limit for the whole image.
    pub(crate) fn time_limit(self) -> TimeLimit {
        self.limit
    }

    /// Time limit for the whole image as a duration; `None` for no limit.
    pub(crate) fn limit(self) -> Option<Duration> {
        self.limit.get()
    }

    /// Adds the time of one run.
    pub(crate) fn add(&mut self, time: Duration) {
        self.used += time;
    }

    /// Time used so far.
    pub(crate) fn used(self) -> Duration {
        self.used
    }

    /// Sets the time used so far; zero for another image or trial.
    pub(crate) fn set_used(&mut self, used: Duration) {
        self.used = used;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A new folder with files of control groups, given by path and content.
    fn groups(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    #[test]
    fn limits_of_ancestors_count() {
        let folder = groups(&[
            ("job_7/memory.max", "1000\n"),
            ("job_7/memory.current", "300\n"),
            ("job_7/step_0/memory.max", "max\n"),
            ("job_7/step_0/memory.current", "250\n"),
            ("job_8/memory.max", "10\n"),
            ("job_8/memory.current", "10\n"),
        ]);
        for (own, expected) in [
            ("0::/job_7/step_0\n", Some(700)),
            ("0::/job_7\n", Some(700)),
            ("0::/job_9/step_0\n", None),
            ("0::/../job_7\n", Some(700)),
            ("", None),
        ] {
            assert_eq!(unused_by_groups(own, folder.path()), expected, "{own}");
        }
    }

    #[test]
    fn smallest_remainder_counts_without_reclaimable_files() {
        let folder = groups(&[
            ("memory.max", "5000"),
            ("memory.current", "4900"),
            ("memory.stat", "anon 900\nfile 4000\ninactive_file 3900\n"),
            ("task/memory.max", "2000"),
            ("task/memory.current", "100"),
        ]);
        assert_eq!(unused_by_groups("0::/task", folder.path()), Some(1900));
        // In a container, whose group is mounted at the top, whatever its name outside.
        assert_eq!(unused_by_groups("0::/", folder.path()), Some(4000));
        assert_eq!(unused_by_groups("0::/docker/4f", folder.path()), Some(4000));
    }

    #[test]
    fn version_1_is_supported() {
        let folder = groups(&[
            ("memory/job/memory.limit_in_bytes", "800"),
            ("memory/job/memory.usage_in_bytes", "500"),
            ("memory/job/memory.stat", "inactive_file 1\ntotal_inactive_file 100\n"),
            // Version 1 writes a missing limit as the largest number of pages.
            ("memory/memory.limit_in_bytes", "9223372036854771712"),
            ("memory/memory.usage_in_bytes", "999"),
        ]);
        let own = "9:name=systemd:/\n4:cpu,memory:/job/step\n1:cpu:/other\n0::/\n";
        assert_eq!(unused_by_groups(own, folder.path()), Some(400));
    }

    #[test]
    fn group_above_its_limit_has_nothing_left() {
        let folder = groups(&[("memory.max", "5"), ("memory.current", "7")]);
        assert_eq!(unused_by_groups("0::/", folder.path()), Some(0));
    }

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

    #[test]
    fn limits_are_gigabytes_and_zero_is_none() {
        for (text, limit) in [("4", Some(4_000_000_000)), ("0.5", Some(500_000_000)), ("0", None)] {
            let read: MemoryLimit = text.parse().unwrap();
            assert_eq!(read.0, limit);
            assert_eq!(read.to_string(), text);
        }
        for wrong in ["-1", "much", "nan", "inf", ""] {
            assert!(wrong.parse::<MemoryLimit>().is_err(), "{wrong}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn limit_is_compared_with_the_process() {
        assert!("0.000001".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!"1000000".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!MemoryLimit::NONE.is_exceeded());
        assert!(MemoryLimit::automatic().0.is_some());
    }

    #[test]
    fn limits_are_seconds_and_zero_is_none() {
        for (text, limit) in [("600", Some(600.0)), ("0.5", Some(0.5)), ("0", None)] {
            let read: TimeLimit = text.parse().unwrap();
            assert_eq!(read.get(), limit.map(Duration::from_secs_f64));
            assert_eq!(read.to_string(), text);
        }
        for wrong in ["-1", "long", "nan", "inf", "1e99"] {
            assert!(wrong.parse::<TimeLimit>().is_err(), "{wrong}");
        }
        assert_eq!(TimeLimit::default().to_string(), "600");
    }

    #[test]
    fn runs_of_an_image_share_its_time() {
        let mut clock = ImageClock::new("2".parse().unwrap());
        clock.add(Duration::from_millis(1500));
        assert_eq!(clock.remaining(), Some(Duration::from_millis(500)));
        clock.add(Duration::from_secs(9));
        assert_eq!(clock.remaining(), Some(Duration::ZERO));
        clock.set_used(Duration::ZERO);
        assert_eq!(clock.remaining(), Some(Duration::from_secs(2)));
        assert_eq!(ImageClock::new(TimeLimit::NONE).remaining(), None);
    }
}
