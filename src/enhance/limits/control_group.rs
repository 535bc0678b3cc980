//! Memory that the Linux control groups (cgroups) of this process still allow: [`unused_memory`].
//!
//! Batch systems and containers limit memory by a control group, and the kernel kills processes that exceed the limit.
//! The limited group can be an ancestor of the process's own group, so all ancestors are checked.

use std::fs;
use std::path::{Component, Path, PathBuf};

/// Names of folders and files in one version of control groups.
struct Layout {
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
const LAYOUTS: [Layout; 2] = [
    Layout { controller: "", folder: "", limit: "memory.max", used: "memory.current", reclaimable: "inactive_file" },
    Layout {
        controller: "memory",
        folder: "memory",
        limit: "memory.limit_in_bytes",
        used: "memory.usage_in_bytes",
        reclaimable: "total_inactive_file",
    },
];

/// Bytes that this process may still use under the limits of its control groups; `None` without a limit.
pub(super) fn unused_memory() -> Option<u64> {
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
fn unused_in_group(group: &Path, layout: &Layout) -> Option<u64> {
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
}
