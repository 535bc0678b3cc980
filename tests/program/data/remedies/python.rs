//! Remedies that are commands of other programs, run as printed; skipped where a program or a package is missing.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::{Bench, call, one_line};
use crate::support::run::called;
use crate::support::tools::{skip, succeeds};

/// True if Python has these packages; else the test is skipped.
fn has_packages(packages: &str) -> bool {
    let has = ["python", "python3"].iter().all(|python| succeeds(python, &["-c", &format!("import {packages}")]));
    if !has {
        skip(&format!("no Python with {packages}"));
    }
    has
}

fn has_programs(programs: &[&str]) -> bool {
    let missing: Vec<&&str> = programs.iter().filter(|name| !super::is_installed(name)).collect();
    if !missing.is_empty() {
        skip(&format!("no {missing:?}"));
    }
    missing.is_empty()
}

/// Runs a program of Python in a folder.
fn python(folder: &Path, program: &str) {
    let run = called(Command::new("python").args(["-c", program]).current_dir(folder));
    run.ended(0);
}

/// Runs a line as a shell does, in a folder.
fn shell(folder: &Path, line: &str) {
    called(Command::new("sh").args(["-c", line]).current_dir(folder)).ended(0);
}

/// A message from a text on, as printed; without its breaks of lines.
fn from(message: &str, start: &str) -> String {
    let message = one_line(message);
    let at = message.find(start).unwrap_or_else(|| panic!("{start:?} in {message}"));
    message[at..].to_owned()
}

/// The part of a message from one text until another.
fn between(message: &str, start: &str, end: &str) -> String {
    let rest = from(message, start);
    let end = rest.find(end).unwrap_or_else(|| panic!("{end:?} in {rest}"));
    rest[..end].to_owned()
}

/// All that a command prints; `check` ends with 0 whatever it finds.
fn refusal(bench: &Bench, line: &str) -> String {
    let called = call(bench, line);
    called.stdout + &called.stderr
}

/// A data set of two questions about images, in Python: its variable is `d`.
const DATA_SET: &str = "
from PIL import Image
import datasets
f = datasets.Features({'image': datasets.Image(), 'question': datasets.Value('string'), 'options': datasets.Sequence(datasets.Value('string')), 'answer': datasets.Value('string')})
images = [Image.new('RGB', (48, 32), (c, 9, 9)) for c in (40, 90)]
d = datasets.Dataset.from_dict({'image': images, 'question': ['Is it red?', 'Is it blue?'], 'options': [['yes', 'no']] * 2, 'answer': ['yes', 'no']}, features=f)
";

#[test]
fn saved_folders_are_converted() {
    if !has_packages("datasets, PIL") {
        return;
    }
    let bench = Bench::new();
    let save = "d.save_to_disk('one'); datasets.DatasetDict({'train': d, 'test': d}).save_to_disk('splits')";
    python(&bench.path(""), &format!("{DATA_SET}{save}"));
    for (folder, more) in [("one", ""), ("splits", " --read split=train")] {
        let check = format!("check --model random --levels L0 --data {folder}");
        let message = refusal(&bench, &check);
        shell(&bench.path(folder), &between(&message, "python -c", " in it"));
        call(&bench, &format!("{check}{more}")).ended(0);
    }
    // A file alone.
    let bench = Bench::new();
    python(&bench.path(""), &format!("{DATA_SET}d.save_to_disk('one')"));
    let message = refusal(&bench, "check --model random --data one/data-00000-of-00001.arrow");
    shell(&bench.path("one"), &between(&message, "python -c", " in its folder"));
    call(&bench, "check --model random --levels L0 --data one/set.parquet").ended(0);
}

#[test]
fn parquet_is_compressed_again() {
    if !has_packages("datasets, PIL") {
        return;
    }
    let bench = Bench::new();
    let write = "d.to_parquet('b.parquet'); import pyarrow.parquet as p; p.write_table(p.read_table('b.parquet'), 'a.parquet', compression='brotli')";
    python(&bench.path(""), &format!("{DATA_SET}{write}"));
    let message = refusal(&bench, "check --model random --levels L0 --data a.parquet");
    shell(&bench.path(""), &from(&message, "python -c"));
    call(&bench, "check --model random --levels L0 --data again.parquet").ended(0);
}

/// Shards as `webdataset.ShardWriter` writes them: a TAR file of images and JSON with the same names.
#[test]
fn shards_are_unpacked() {
    if !has_packages("PIL") {
        return;
    }
    let write = "
import io, json, tarfile, PIL.Image as I
for shard in (0, 1):
    with tarfile.open(f'my set/{shard:06}.tar', 'w') as t:
        for number in (0, 1):
            image = io.BytesIO(); I.new('RGB', (48, 32), (9, 40 * number, 90 * shard)).save(image, 'png')
            row = {'question': f'Is it {shard} {number}?', 'choices': ['yes', 'no'], 'answer': 'no'}
            for ending, data in (('png', image.getvalue()), ('json', json.dumps(row).encode()), ('cls', b'3')):
                info = tarfile.TarInfo(f'{number:06}.{ending}'); info.size = len(data); t.addfile(info, io.BytesIO(data))
";
    for (data, questions) in [("my set", 4), ("my set/000001.tar", 2)] {
        let bench = Bench::new();
        fs::create_dir(bench.path("my set")).unwrap();
        python(&bench.path(""), write);
        let check = ["check", "--model", "random", "--levels", "L0", "--data"];
        let refused = bench.call(&[&check[..], &[data]].concat());
        let message = refused.stdout + &refused.stderr;
        shell(&bench.path(""), &between(&message, "python -c", "; then --data unpacked"));
        let called = bench.call(&[&check[..], &["unpacked"]].concat()).ended(0);
        assert!(called.stdout.contains(&format!("{questions} questions")), "{called:?}");
        let home = bench.call(&[&check[..], &["unpacked", "--ask", "home"]].concat());
        home.ended(0);
    }
}

#[test]
fn bags_are_converted() {
    if !has_packages("rosbags, numpy") || !has_programs(&["rosbags-convert"]) {
        return;
    }
    let write = "
from rosbags.typesys import Stores, get_typestore
import numpy as np, sys
def fill(writer, store, at):
    I = store.types['sensor_msgs/msg/Image']; H = store.types['std_msgs/msg/Header']; T = store.types['builtin_interfaces/msg/Time']
    kind = 'sensor_msgs/msg/Image'
    c = writer.add_connection('/cam', kind, typestore=store)
    for i in range(3):
        head = H(stamp=T(sec=i, nanosec=0), frame_id='cam') if 'seq' not in H.__dataclass_fields__ else H(seq=i, stamp=T(sec=i, nanosec=0), frame_id='cam')
        m = I(header=head, height=2, width=3, encoding='rgb8', is_bigendian=0, step=9, data=np.arange(18, dtype=np.uint8))
        writer.write(c, i * 10**9, (store.serialize_cdr if at == 2 else store.serialize_ros1)(m, kind))
from rosbags.rosbag1 import Writer as One
from rosbags.rosbag2 import Writer as Two, StoragePlugin
with One('old.bag') as w: fill(w, get_typestore(Stores.ROS1_NOETIC), 1)
with Two('two', version=9, storage_plugin=StoragePlugin.SQLITE3) as w: fill(w, get_typestore(Stores.ROS2_HUMBLE), 2)
";
    let bench = Bench::new();
    python(&bench.path(""), write);
    for bag in ["old.bag", "two"] {
        let message = refusal(&bench, &format!("import rosbag {bag}"));
        shell(&bench.path(""), &between(&message, "rosbags-convert", " darkqa-eval"));
        let import = message.lines().last().unwrap().trim();
        let import = import.strip_prefix("darkqa-eval ").unwrap();
        let called = call(&bench, &format!("{import} --every 0 --out frames-{bag}")).ended(0);
        assert!(called.stdout.contains("3 frames"), "{called:?}");
    }
}

#[test]
fn video_of_a_topic_is_extracted() {
    use crate::support::recording::{Records, compressed};
    if !has_packages("mcap_ros2") || !has_programs(&["ffmpeg"]) {
        return;
    }
    let bench = Bench::new();
    // H.264 in access units, each a message as the drivers of cameras write it.
    let encode = "ffmpeg -v error -f lavfi -i testsrc2=size=96x64:rate=5:duration=2 -c:v libx264 -bsf:v h264_metadata=aud=insert -f h264 all.h264";
    shell(&bench.path(""), encode);
    let stream = fs::read(bench.path("all.h264")).unwrap();
    let delimiter = [0, 0, 0, 1, 9];
    let starts = (0..stream.len()).filter(|at| stream[*at..].starts_with(&delimiter));
    let starts: Vec<usize> = starts.chain([stream.len()]).collect();
    let definition = "std_msgs/Header header\nstring format\nuint8[] data\n================================================================================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n================================================================================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
    let mut records = Records::default();
    records.topic(1, "/cam", "sensor_msgs/msg/CompressedImage", "cdr", definition);
    for (number, unit) in starts.windows(2).enumerate() {
        let at = number as f64 / 5.0;
        records.message(1, at, &compressed(at, "h264", &stream[unit[0]..unit[1]]));
    }
    bench.file("drive.mcap", records.file());
    let message = refusal(&bench, "import mcap drive.mcap");
    let lines: Vec<&str> = message.lines().map(str::trim).skip_while(|line| !line.starts_with("pip install")).collect();
    let [_, decode, encode, import] = lines[..] else {
        panic!("{message}");
    };
    shell(&bench.path(""), decode);
    shell(&bench.path(""), encode);
    let called = call(&bench, import.strip_prefix("darkqa-eval ").unwrap()).ended(0);
    assert!(called.stdout.contains("1 frame"), "{called:?}");
}

#[test]
fn colours_of_videos_are_converted() {
    if !has_programs(&["ffmpeg"]) || !succeeds("ffmpeg", &["-v", "error", "-h", "filter=zscale"]) {
        return;
    }
    for colours in ["colorspace=ycgco", "color_trc=linear", "color_primaries=bt2020"] {
        let bench = Bench::new();
        let make = format!(
            "ffmpeg -v error -f lavfi -i testsrc2=size=96x64:rate=5:duration=1 -vf format=yuv444p,setparams={colours} -c:v ffv1 video.mkv"
        );
        shell(&bench.path(""), &make);
        let message = refusal(&bench, "import video video.mkv --every 0 --out out");
        let convert = between(&message, "ffmpeg -i video.mkv", "converted.mkv");
        let convert = convert.replace("arib-std-b67", "bt709");
        shell(&bench.path(""), &format!("{convert}converted.mkv"));
        let called = call(&bench, "import video converted.mkv --every 0 --out converted").ended(0);
        assert!(called.stdout.contains("5 frames"), "{colours}: {called:?}");
    }
}

#[test]
fn video_without_duration_needs_every() {
    if !has_programs(&["ffmpeg"]) {
        return;
    }
    let bench = Bench::new();
    let make = "ffmpeg -v error -f lavfi -i testsrc2=size=96x64:rate=5:duration=1 -c:v mjpeg -f mjpeg video.mjpeg";
    shell(&bench.path(""), make);
    let message = refusal(&bench, "import video video.mjpeg --max-frames 2 --out out");
    assert!(message.contains("use --every"), "{message}");
    call(&bench, "import video video.mjpeg --every 0 --out out").ended(0);
}
