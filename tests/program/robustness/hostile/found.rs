//! What damaged files have found, each with its bytes.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use crate::robustness::hostile::seeds::Seeds;
use crate::support::run::{Bench, called, words};

fn pipe(path: &Path) {
    fs::remove_file(path).unwrap();
    let made = Command::new("mkfifo").arg(path).status().unwrap();
    assert!(made.success());
}

/// A pipe that nobody writes to was waited for without end, and a device was read until the memory was full.
#[test]
fn pipes_and_devices_are_refused() {
    let rows = [
        ("asked/questions.jsonl", "export llava asked --levels L3 --out out"),
        (
            "walks/hm3d-v0/000-a/00000-rgb.png",
            "openeqa --questions questions.json --frames walks --num-frames 5 --image-size 32 --levels L0 --model script:script.jsonl --judge script:judge.jsonl --out out",
        ),
        ("run/records.jsonl", "show run q0 --out out"),
        ("run/records.jsonl", "bundle run --out out.zip"),
        ("run/manifest.json", "report run"),
        ("run/questions.jsonl", "--model random --data set.jsonl --levels L0,L3 --out run"),
        ("other/thumbnails.jsonl", "report run --baseline other"),
        ("recording/iso100/flat-3/0.png", "calibrate recording --white 16383 --out out.toml"),
        ("scannet/scannetv2-labels.combined.tsv", "import scannet --src scannet --out out"),
        ("models/two.onnx.toml", "enhance models/two.onnx a.png --offline --out out"),
        ("store/v1/.lock", "--data frames --model random --levels L0,L3 --llie lift --images-cache store --out stored"),
        (
            "prompts/blind.txt",
            "--model m --base-url http://127.0.0.1:9/v1 --prompts prompts --data set.jsonl --out out",
        ),
    ];
    let seeds = Seeds::make();
    let bench = seeds.bench();
    for (file, line) in rows {
        let path = bench.path(file);
        let before = fs::read(&path).unwrap();
        for is_device in [false, true] {
            pipe(&path);
            if is_device {
                fs::remove_file(&path).unwrap();
                symlink("/dev/zero", &path).unwrap();
            }
            let called = bench.call(&words(line));
            // One walk that cannot be shown costs its questions alone, and thumbnails are left out of a report.
            let expected = if file.ends_with("thumbnails.jsonl") { 0..=0 } else { 1..=2 };
            assert!(called.code.is_some_and(|code| expected.contains(&code)), "{file}, {line}: {called:?}");
            let name = path.file_name().unwrap().to_string_lossy();
            let is_link = called.stderr.contains("is a link") || called.stderr.contains("leads out of");
            assert!(
                called.stderr.contains(&*name) && (called.stderr.contains("a pipe or a device") || is_link),
                "{file}, {line}: {called:?}"
            );
        }
        fs::remove_file(&path).unwrap();
        fs::write(&path, before).unwrap();
    }
}

/// The shell's `<(command)` is a pipe, too.
#[test]
fn named_pipe_argument_is_read() {
    let bench = Bench::new();
    let mut command = bench.command(&words("completions bash --config /dev/stdin"));
    let (reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(b"color = \"never\"\n").unwrap();
    drop(writer);
    called(command.stdin(reader)).ended(0);
}

/// The header of a broken array went to standard error as it is.
#[test]
fn log_line_has_no_control_character() {
    let seeds = Seeds::make();
    let bench = seeds.bench();
    let array = b"\x93NUMPY\x01\x00\x10\x00{'d\x00\x01\x1b[31m\x07\x7f\xc2\x9b, }\n";
    bench.file("home/x/depth/a.npy", array);
    bench.file("subset.json", "[\"q1\", \"q\\u0000\\u001b[2J\"]");
    let rows = [
        "import folder --src home --labels nyu40 --out out",
        "openeqa --questions questions.json --subset subset.json --frames walks --num-frames 2 --image-size 32 --levels L0 --model script:script.jsonl --judge script:judge.jsonl --out opened",
    ];
    for line in rows {
        let called = bench.call(&words(line));
        let is_raw = |c: char| c.is_control() && c != '\n' && c != '\t';
        assert!(!called.stderr.contains(is_raw), "{line}: {called:?}");
        assert!(called.stderr.contains("⟨U+0000⟩"), "{line}: {called:?}");
    }
}
