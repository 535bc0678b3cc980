//! The container image: its file system as a pod has it, only read, without a home, without a network; and the image
//! built.
//!
//! The file system is the one that `.ci/image-files` puts together, with the libraries of this machine. The program
//! runs in it as user 65532 in namespaces of its own, which needs no builder of images.
#![cfg(target_os = "linux")]
#![expect(clippy::print_stdout, reason = "the size of the image")]

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{MetadataExt as _, chown};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::run::Bench;
use crate::support::tools::{skip, succeeds};

/// User and group of the image.
const USER: u32 = 65532;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn ended_well(what: &str, output: &Output) {
    let said = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(output.status.success(), "{what}: {}: {said:?}", output.status);
}

/// Finds `chroot`, which is not on the PATH of every user.
const CHROOT: &str = "PATH=$PATH:/usr/sbin:/sbin; command -v chroot";

/// True if this process may have a mount namespace and a network of its own, and can change its root folder.
fn may_unshare() -> bool {
    succeeds("unshare", &["--mount", "--net", "sh", "-c", CHROOT]) && succeeds("ldd", &["--version"])
}

/// The libraries that a program or library is linked to, as paths of this machine, and the loader.
fn libraries(file: &Path) -> BTreeSet<PathBuf> {
    let output = Command::new("ldd").arg(file).output().unwrap();
    ended_well("ldd", &output);
    let text = String::from_utf8(output.stdout).unwrap();
    text.split_whitespace().filter(|word| word.starts_with('/')).map(PathBuf::from).collect()
}

/// The files of the image in `folder/files`, with what they are linked to.
fn file_system(folder: &Path) -> PathBuf {
    let program = env!("CARGO_BIN_EXE_darkqa-eval");
    let output = Command::new(root().join(".ci/image-files")).args([Path::new(program), folder]).output().unwrap();
    ended_well(".ci/image-files", &output);
    let files = folder.join("files");
    let own = fs::read_dir(files.join("opt/darkqa-eval")).unwrap();
    let own: Vec<PathBuf> = own.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(own.len(), 2, "a program and a library: {own:?}");
    for library in own.iter().flat_map(|file| libraries(file)) {
        let to = files.join(library.strip_prefix("/").unwrap());
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(&library, &to).unwrap();
    }
    for mount in ["runs", "proc", "dev"] {
        fs::create_dir_all(files.join(mount)).unwrap();
    }
    files
}

/// Mounts the file system `$1` to be only read, the folder `$2` at its `/runs`, and runs the rest there without a
/// variable.
const ENTER: &str = "set -eu
mount --make-rprivate /
mount --bind \"$1\" \"$1\"
mount --rbind /proc \"$1/proc\"
mount --rbind /dev \"$1/dev\"
mount --bind \"$2\" \"$1/runs\"
mount -o remount,bind,ro \"$1\"
if touch \"$1/models/new\" 2> /dev/null; then exit 9; fi
cd \"$1\"
root=$1
shift 2
exec env -i \"$(PATH=$PATH:/usr/sbin:/sbin; command -v chroot)\" --userspec=65532:65532 \"$root\" \"$@\"";

#[test]
fn read_only_container_needs_no_home() {
    if !may_unshare() {
        skip("it takes root, unshare, chroot and ldd");
        return;
    }
    let bench = Bench::new();
    let files = file_system(&bench.path("image"));
    let runs = bench.path("runs");
    fs::create_dir(&runs).unwrap();
    chown(&runs, Some(USER), Some(USER)).unwrap();
    let words = "--model observer --llie /models/lift.onnx --data rooms:frames=2,size=96x64 --levels L3 --offline --quiet \
                 --out /runs/a";
    let output = Command::new("unshare")
        .args(["--mount", "--net", "sh", "-c", ENTER, "sh"])
        .args([&files, &runs])
        .arg("/opt/darkqa-eval/darkqa-eval")
        .args(words.split(' '))
        .output()
        .unwrap();
    ended_well("the evaluation", &output);
    let summary = fs::read_to_string(runs.join("a/summary.csv")).unwrap();
    assert!(summary.contains(",lift,"), "{summary}");
    let manifest = fs::metadata(runs.join("a/manifest.json")).unwrap();
    assert_eq!((manifest.uid(), manifest.gid()), (USER, USER));
}

/// Builds the image on a base that mmdebstrap makes, and runs an evaluation in it.
#[test]
#[ignore = "takes minutes, root, buildah and mmdebstrap, and the mirror of the distribution"]
fn the_image_is_built_and_runs() {
    for (program, words) in [("buildah", "version"), ("mmdebstrap", "--version")] {
        if !succeeds(program, &[words]) || !may_unshare() {
            skip("it takes root, buildah and mmdebstrap");
            return;
        }
    }
    let bench = Bench::new();
    let policy = r#"{"default": [{"type": "insecureAcceptAnything"}]}"#;
    bench.file("policy.json", policy);
    bench.file("Base", "FROM scratch\nADD base.tar /\n");
    let buildah = "buildah --storage-driver vfs --root \"$PWD/store\" --runroot \"$PWD/run\"";
    let build = format!("{buildah} build --isolation chroot --signature-policy \"$PWD/policy.json\"");
    let script = format!(
        "set -eux
# The distribution of this machine, whose libraries the program is linked to.
. /etc/os-release
mmdebstrap --quiet --variant=minbase \"$VERSION_CODENAME\" base.tar
{build} --file Base --tag localhost/base .
BASE=localhost/base BUILDER=\"{}\" {}/.ci/image {} localhost/darkqa-eval
here=$({buildah} from --signature-policy policy.json localhost/darkqa-eval)
{buildah} run --isolation chroot --user {USER}:{USER} \"$here\" -- /opt/darkqa-eval/darkqa-eval --model observer \\
    --llie /models/lift.onnx --data rooms:frames=2,size=96x64 --levels L3 --offline --out /runs/a --quiet
test -s \"$({buildah} mount \"$here\")/runs/a/summary.csv\"
{buildah} images
{buildah} inspect --type image localhost/darkqa-eval > image.json
{buildah} rm \"$here\"",
        build.replace('"', ""),
        root().display(),
        env!("CARGO_BIN_EXE_darkqa-eval"),
    );
    let output = Command::new("bash").args(["-c", &script]).current_dir(bench.path("")).output().unwrap();
    ended_well("the build", &output);
    println!("{}", String::from_utf8_lossy(&output.stdout));
    let image = fs::read(bench.path("image.json")).unwrap();
    let image: serde_json::Value = serde_json::from_slice(&image).unwrap();
    let config = &image["OCIv1"]["config"];
    assert_eq!(config["User"], "65532:65532");
    assert_eq!(config["WorkingDir"], "/runs");
    let labels = config["Labels"].as_object().unwrap();
    for name in ["source", "version", "revision", "licenses"] {
        let label = &labels[&format!("org.opencontainers.image.{name}")];
        assert!(label.as_str().is_some_and(|text| text != "unknown"), "{name}: {label}");
    }
    assert_eq!(labels["org.opencontainers.image.version"], env!("CARGO_PKG_VERSION"));
}
