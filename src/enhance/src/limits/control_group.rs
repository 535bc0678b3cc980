//! The memory that the control groups of this process leave it: [`unused_memory`].
//!
//! A batch system or a container limits memory by such a group, and the kernel ends a process that goes beyond it. The process
//! may be in a group within the limited one, so each group above its own counts, too.

use std::fs;
use std::path::{Component, Path};

/// How one version of control groups is laid out.
struct Layout {
    /// The controllers between the colons of the group's line in `/proc/self/cgroup`.
    controller: &'static str,
    /// The folder of all groups, below where the system mounts them.
    folder: &'static str,
    /// The file with the limit in bytes.
    limit: &'static str,
    /// The file with the bytes in use, cached files included.
    used: &'static str,
    /// The line of `memory.stat` with the bytes of cached files that the kernel takes back before it ends a process.
    reclaimable: &'static str,
}

/// Version 2, and version 1.
const LAYOUTS: [Layout; 2] = [
    Layout {
        controller: "",
        folder: "",
        limit: "memory.max",
        used: "memory.current",
        reclaimable: "inactive_file",
    },
    Layout {
        controller: "memory",
        folder: "memory",
        limit: "memory.limit_in_bytes",
        used: "memory.usage_in_bytes",
        reclaimable: "total_inactive_file",
    },
];

/// Bytes that this process may still use by the limits of its control groups; `None` if none has a limit.
pub(super) fn unused_memory() -> Option<u64> {
    let own = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    unused_by_groups(&own, Path::new("/sys/fs/cgroup"))
}

/// The same for a process with this `/proc/self/cgroup`, where the groups are mounted at `mount`.
fn unused_by_groups(own: &str, mount: &Path) -> Option<u64> {
    let of_layout = |layout: &Layout| {
        let folder = mount.join(layout.folder);
        // A container may not see the names of the groups above it: its own is mounted as the topmost.
        let path = own_group(own, layout.controller).unwrap_or("/");
        let below = Path::new(path).components();
        let below = below.filter(|part| matches!(part, Component::Normal(_)));
        let group = folder.join(below.collect::<std::path::PathBuf>());
        group
            .ancestors()
            .take_while(|at| at.starts_with(&folder))
            .filter_map(|at| unused_in_group(at, layout))
            .min()
    };
    LAYOUTS.iter().filter_map(of_layout).min()
}

/// The path of a process's group in the tree of a controller; version 2 has one tree, without a name.
fn own_group<'a>(own: &'a str, controller: &str) -> Option<&'a str> {
    own.lines().find_map(|line| {
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        controllers
            .split(',')
            .any(|one| one == controller)
            .then_some(path)
    })
}

/// The bytes that a group may still use; `None` without a limit.
fn unused_in_group(group: &Path, layout: &Layout) -> Option<u64> {
    let number = |file: &str| -> Option<u64> {
        let text = fs::read_to_string(group.join(file)).ok()?;
        text.trim().parse().ok()
    };
    let (limit, used) = (number(layout.limit)?, number(layout.used)?);
    let statistics = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let reclaimable = statistics.lines().find_map(|line| {
        let (name, bytes) = line.split_once(' ')?;
        (name == layout.reclaimable).then(|| bytes.trim().parse::<u64>().ok())?
    });
    let used = used.saturating_sub(reclaimable.unwrap_or(0));
    Some(limit.saturating_sub(used))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Groups in a new folder: paths of files, each with its text.
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
    fn the_limit_of_a_group_above_counts() {
        let made = groups(&[
            ("job_7/memory.max", "1000\n"),
            ("job_7/memory.current", "300\n"),
            ("job_7/step_0/memory.max", "max\n"),
            ("job_7/step_0/memory.current", "250\n"),
            ("job_8/memory.max", "10\n"),
            ("job_8/memory.current", "10\n"),
        ]);
        let own = |path: &str| unused_by_groups(path, made.path());
        assert_eq!(own("0::/job_7/step_0\n"), Some(700));
        assert_eq!(own("0::/job_7\n"), Some(700));
        assert_eq!(own("0::/job_9/step_0\n"), None);
        assert_eq!(own("0::/../job_7\n"), Some(700));
        assert_eq!(own(""), None);
    }

    #[test]
    fn the_smallest_rest_counts_and_files_in_the_cache_do_not() {
        let made = groups(&[
            ("memory.max", "5000"),
            ("memory.current", "4900"),
            ("memory.stat", "anon 900\nfile 4000\ninactive_file 3900\n"),
            ("task/memory.max", "2000"),
            ("task/memory.current", "100"),
        ]);
        assert_eq!(unused_by_groups("0::/task", made.path()), Some(1900));
        // As a container sees it, whose group is the topmost, whatever it is named outside.
        assert_eq!(unused_by_groups("0::/", made.path()), Some(4000));
        assert_eq!(unused_by_groups("0::/docker/4f", made.path()), Some(4000));
    }

    #[test]
    fn the_first_version_is_read_too() {
        let made = groups(&[
            ("memory/job/memory.limit_in_bytes", "800"),
            ("memory/job/memory.usage_in_bytes", "500"),
            (
                "memory/job/memory.stat",
                "inactive_file 1\ntotal_inactive_file 100\n",
            ),
            // Without a limit: the largest number of pages.
            ("memory/memory.limit_in_bytes", "9223372036854771712"),
            ("memory/memory.usage_in_bytes", "999"),
        ]);
        let own = "9:name=systemd:/\n4:cpu,memory:/job/step\n1:cpu:/other\n0::/\n";
        assert_eq!(unused_by_groups(own, made.path()), Some(400));
    }

    #[test]
    fn a_group_that_is_over_its_limit_has_nothing_left() {
        let made = groups(&[("memory.max", "5"), ("memory.current", "7")]);
        assert_eq!(unused_by_groups("0::/", made.path()), Some(0));
    }
}
