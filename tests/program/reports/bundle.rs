//! `bundle`: a run as one ZIP file, without what is private.

use std::collections::BTreeSet;
use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{Bench, called, files, records, words};
use crate::support::snapshot::redacted;
use base64::Engine as _;
use zip::ZipArchive;

const KEY: &str = "a-very-secret-word-of-mine";

/// Unpacks a bundle; returns the names in it.
fn unpack(zip: &Path, into: &Path) -> Vec<String> {
    let mut archive = ZipArchive::new(Cursor::new(fs::read(zip).unwrap())).unwrap();
    archive.extract(into).unwrap();
    archive.file_names().map(str::to_owned).collect()
}

/// Every text in a folder, with the data that the page has packed.
fn texts(folder: &Path) -> Vec<(String, String)> {
    let mut texts = Vec::new();
    for path in files(folder) {
        let name = path.display().to_string();
        let text = String::from_utf8_lossy(&fs::read(&path).unwrap()).into_owned();
        let packed = text.split(['"', '>', '<', '`']).filter(|part| part.starts_with("H4sI"));
        for part in packed {
            let bytes = base64::engine::general_purpose::STANDARD.decode(part).unwrap();
            let mut inside = String::new();
            flate2::read::GzDecoder::new(&*bytes).read_to_string(&mut inside).unwrap();
            texts.push((format!("{name}, packed"), inside));
        }
        texts.push((name, text));
    }
    texts
}

#[test]
fn bundle_is_reproducible() {
    let bench = Bench::new();
    bench.rooms("frames", 4, "160x120");
    bench.complete(&words(
        "--model observer --model random --blind-model random --data frames --levels L0,L5 --out run",
    ));
    bench.file("run/notes.txt", "mine");
    let said = bench.complete(&words("bundle run --out one.zip"));
    insta::assert_snapshot!(redacted(&said), @"
    one.zip: written, 29 files, [BYTES]
    records.parquet is left out: report writes it again, from records.jsonl
    1 other file or folder of the run is left out: no report needs it
    left out: notes.txt
    ");
    bench.complete(&words("bundle run --out two.zip"));
    let one = fs::read(bench.path("one.zip")).unwrap();
    assert_eq!(one, fs::read(bench.path("two.zip")).unwrap());
    let names = unpack(&bench.path("one.zip"), &bench.path("unpacked"));
    let mut sorted = names.clone();
    sorted.sort();
    assert_eq!(names, sorted);
    for left_out in ["run/notes.txt", "run/records.parquet"] {
        assert!(!names.contains(&left_out.to_owned()), "{names:?}");
    }
    // The report of the unpacked run is that of the run, byte for byte.
    let mut report = bench.command(&["report", "run"]);
    let report = called(report.current_dir(bench.path("unpacked")));
    assert_eq!(report.code, Some(0), "{report:?}");
    let mut same = 0;
    for path in files(&bench.path("run")) {
        let name = path.strip_prefix(bench.path("run")).unwrap();
        if name != Path::new("notes.txt") {
            let unpacked = fs::read(bench.path("unpacked/run").join(name)).unwrap();
            assert!(fs::read(&path).unwrap() == unpacked, "{}", name.display());
            same += 1;
        }
    }
    assert!(same > 10, "{same}");
    // The digests are those of the files.
    let sums = fs::read_to_string(bench.path("unpacked/run/SHA256SUMS")).unwrap();
    assert_eq!(sums.lines().count(), names.len() - 1);
    let readme = fs::read_to_string(bench.path("unpacked/run/README.md")).unwrap();
    for part in ["darkqa-eval report run", "--data frames", "--blind-model random", "--levels L0,L5"] {
        assert!(readme.contains(part), "{part}: {readme}");
    }
    // The command asks the very same trials again.
    let command = readme.lines().find(|line| line.starts_with("darkqa-eval --"));
    let command = command.unwrap().trim_start_matches("darkqa-eval ");
    bench.complete(&words(&format!("{command} --out again")));
    let keys = |run: &str| -> BTreeSet<String> {
        records(&bench.path(run)).into_iter().map(|record| record["key"].to_string()).collect()
    };
    assert_eq!(keys("again"), keys("run"));
    let summary = fs::read_to_string(bench.path("run/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let plain = readme.replace('\\', "");
    for finding in summary["findings"].as_array().unwrap() {
        assert!(plain.contains(finding["text"].as_str().unwrap()), "{readme}");
    }
    // Without images it is smaller, and the page has none; with all it has the file of the run.
    bench.complete(&words("bundle run --out none.zip --thumbnails none"));
    let names = unpack(&bench.path("none.zip"), &bench.path("none"));
    assert!(!names.iter().any(|name| name.ends_with("thumbnails.jsonl")), "{names:?}");
    for (name, text) in texts(&bench.path("none")) {
        assert!(!text.contains("data:image/"), "{name}");
    }
    assert!(fs::metadata(bench.path("none.zip")).unwrap().len() < one.len() as u64);
    bench.complete(&words("bundle run --out all.zip --thumbnails all"));
    unpack(&bench.path("all.zip"), &bench.path("all"));
    let file = "run/thumbnails.jsonl";
    let all = fs::read(bench.path("all").join(file)).unwrap();
    assert!(all == fs::read(bench.path(file)).unwrap());
}

#[test]
fn readme_includes_models_file() {
    let [one, two] = [1, 2].map(|_| MockEndpoint::start([Answer::text("A")]));
    let bench = Bench::with_frames();
    let table = |name: &str, mock: &MockEndpoint, more: &str| {
        format!(
            "[[model]]\nname = \"{name}\"\nid = \"m\"\nendpoints = [\"{}\"]\nkey-env = \"none\"\n{more}\n",
            mock.base_url()
        )
    };
    let more = "view = \"both\"\nmax-tokens = 77\ntop-p = 0.5";
    bench.file("my.toml", table("One \\\"1\\\"", &one, more) + &table("Two", &two, ""));
    bench.complete(&words("--models my.toml --data frames --levels L0 --out run"));
    bench.complete(&words("bundle run --out run.zip"));
    unpack(&bench.path("run.zip"), &bench.path("all"));
    let readme = fs::read_to_string(bench.path("all/run/README.md")).unwrap();
    let (_, file) = readme.split_once("cat > models.toml <<'END'\n").unwrap();
    let (file, command) = file.split_once("END\n").unwrap();
    assert!(command.starts_with("darkqa-eval --models models.toml"), "{command}");
    bench.file("models.toml", file);
    let [before, again] = ["my.toml", "models.toml"].map(|file| {
        let shown = bench.complete(&["models", file]);
        let same = |line: &&str| !line.trim_start().starts_with("key ");
        shown.lines().filter(same).map(str::to_owned).collect::<Vec<_>>()
    });
    assert_eq!(again, before, "{file}");
}

#[test]
fn judge_keeps_address_without_file() {
    let house = House::new();
    let mock = MockEndpoint::start([Answer::text("5")]);
    let base = mock.base_url();
    let readme = |run: &str| {
        house.0.complete(&words(&format!("bundle {run} --out {run}.zip")));
        unpack(&house.0.path(&format!("{run}.zip")), &house.0.path("all"));
        fs::read_to_string(house.0.path(&format!("all/{run}/README.md"))).unwrap()
    };
    let line = format!("--judge j --base-url {base} --levels L0");
    house.call(&words(&format!("--model m {line} --out plain")));
    let plain = readme("plain");
    assert!(!plain.contains("models.toml"), "{plain}");
    for part in ["--model m", "--judge j", &format!("--base-url {base}")] {
        assert!(plain.contains(part), "{part}: {plain}");
    }
    let elsewhere = MockEndpoint::start([Answer::text("5")]);
    let address = format!("--judge-base-url {}", elsewhere.base_url());
    house.call(&words(&format!("--model m {line} {address} --out elsewhere")));
    let two_addresses = readme("elsewhere");
    for part in [&format!("--base-url {base}"), &address] {
        assert!(two_addresses.contains(part), "{part}: {two_addresses}");
    }
    let table = format!("[[model]]\nname = \"One\"\nid = \"m\"\nendpoints = [\"{base}\"]\n");
    house.0.file("models.toml", table);
    house.call(&words(&format!("--models models.toml {line} --out named")));
    let named = readme("named");
    for part in ["name = \"One\"", "--judge j", &format!("--judge-base-url {base}")] {
        assert!(named.contains(part), "{part}: {named}");
    }
    assert!(!named.contains("name = \"j\""), "{named}");
}

#[test]
fn only_a_bundle_is_replaced() {
    let bench = Bench::new();
    bench.complete(&words("--model random --levels L0 --out run"));
    let said = bench.complete(&words("bundle run --out run.zip"));
    insta::assert_snapshot!(redacted(&said), @"
    run.zip: written, 15 files, [BYTES]
    paths on the machine of the run are named by their last part, behind DIR/ (once)
    records.parquet is left out: report writes it again, from records.jsonl
    ");
    let said = bench.complete(&words("bundle run --out run.zip"));
    insta::assert_snapshot!(redacted(&said), @"
    run.zip: replaced, 15 files, [BYTES]
    paths on the machine of the run are named by their last part, behind DIR/ (once)
    records.parquet is left out: report writes it again, from records.jsonl
    ");
    for mine in ["PK, of mine", ""] {
        bench.file("mine.zip", mine);
        let refused = bench.call(&words("bundle run --out mine.zip"));
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("mine.zip") && refused.stderr.contains("not a bundle"), "{refused:?}");
        assert_eq!(fs::read_to_string(bench.path("mine.zip")).unwrap(), mine);
    }
    let refused = bench.call(&words("bundle nowhere --out none.zip"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: nowhere: no run in this folder: it has no manifest.json
    ");
    assert!(!bench.path("none.zip").exists());
    // A damaged line is named, and nothing is written.
    bench.file("run/records.jsonl", "{\"no\": \"record\"}\n");
    let refused = bench.call(&words("bundle run --out none.zip"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: run/records.jsonl, line 1: not a record: missing field `key` at line 1 column 16; the command that made
        the run, called again, sets single such lines aside and asks their trials again; or restore the file
    ");
    assert!(!bench.path("none.zip").exists());
}

#[test]
fn nothing_private_is_in_a_bundle() {
    let bench = Bench::with_questions(4);
    let home = bench.path("home/ann");
    fs::create_dir_all(home.join("data set")).unwrap();
    for name in ["set.jsonl", "a.png"] {
        fs::copy(bench.path(name), home.join("data set").join(name)).unwrap();
    }
    let place = home.display().to_string();
    let said = format!("I see {place}/photo.png with {KEY}");
    let endpoint = MockEndpoint::answering(move |_| Answer::text(&said));
    let address = endpoint.base_url().replace("http://", "http://ann:password@");
    let data = home.join("data set/set.jsonl").display().to_string();
    let mut run =
        bench.command(&["--model", "m", "--base-url", &address, "--data", &data, "--levels", "L0,L3", "--out", "run"]);
    let ran = called(run.env("HOME", &home));
    assert_ne!(ran.code, Some(2), "{ran:?}");
    let stored: String = texts(&bench.path("run")).into_iter().map(|(_, text)| text).collect();
    // Without the bundle they are there.
    assert!(stored.contains(&place) && stored.contains(KEY));
    let mut bundle = bench.command(&["bundle", "run", "--out", "run.zip"]);
    let bundled = called(bundle.env("HOME", &home).env("MY_API_KEY", KEY));
    insta::assert_snapshot!(bundled, @"
    exit code: 0
    stdout:
    run.zip: written, 24 files, [BYTES]
    paths on the machine of the run are named by their last part, behind DIR/ (13 times)
    what looks like a key is written [secret] (12 times)
    records.parquet is left out: report writes it again, from records.jsonl
    ");
    unpack(&bench.path("run.zip"), &bench.path("unpacked"));
    let texts = texts(&bench.path("unpacked"));
    assert!(texts.iter().any(|(name, _)| name.ends_with("packed")));
    let folder = bench.path("").display().to_string();
    for (name, text) in &texts {
        for private in [&*place, KEY, "ann:password", folder.trim_end_matches('/')] {
            assert!(!text.contains(private), "{private} in {name}");
        }
    }
    let all: String = texts.iter().map(|(_, text)| &**text).collect();
    assert!(all.contains("DIR/ann/photo.png with [secret]"));
    // What was changed is said, and the run is read again.
    assert!(all.contains("## Changed, or left out"));
    bench.complete(&words("report unpacked/run"));
}

#[test]
fn open_runs_can_be_bundled() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    let line = "--model script:a.jsonl --judge script:j.jsonl --levels L0,L3 --out run";
    assert_eq!(house.call(&words(line)).code, Some(0));
    house.0.complete(&words("bundle run --out run.zip"));
    unpack(&house.0.path("run.zip"), &house.0.path("unpacked"));
    // The page names the folder of the run as it was typed.
    let mut report = house.0.command(&["report", "run"]);
    let reported = called(report.current_dir(house.0.path("unpacked")));
    assert_eq!(reported.code, Some(0), "{reported:?}");
    for name in ["records.jsonl", "summary.csv", "report.html", "upstream"] {
        let unpacked = house.0.path("unpacked/run").join(name);
        assert!(unpacked.exists(), "{name}");
        if unpacked.is_file() {
            let own = fs::read(house.0.path("run").join(name)).unwrap();
            assert!(fs::read(&unpacked).unwrap() == own, "{name}");
        }
    }
    let readme = fs::read_to_string(house.0.path("unpacked/run/README.md")).unwrap();
    assert!(readme.contains("OpenEQA by LLM-Match"), "{readme}");
    assert!(
        readme.contains(
            "darkqa-eval openeqa --questions DIR/questions.json --model script:a.jsonl --judge script:j.jsonl"
        ),
        "{readme}"
    );
}

/// The zip of `bundle` is read as its unpacked run is; nothing is written beside it.
#[test]
fn bundles_are_read_without_unpacking() {
    let bench = Bench::new();
    bench.rooms("frames", 4, "96x72");
    bench.complete(&words("--model observer --data frames --levels L0,L3 --out run"));
    bench.complete(&words("bundle run --out sent.zip"));
    let said = bench.complete(&words("report sent.zip"));
    assert!(said.contains("report: not written; --out DIR writes one"), "{said}");
    bench.complete(&words("report sent.zip --out of-zip"));
    unpack(&bench.path("sent.zip"), &bench.path("unpacked"));
    std::fs::rename(bench.path("unpacked/run"), bench.path("sent")).unwrap();
    bench.complete(&words("report sent --out of-folder"));
    let all = files(&bench.path("of-folder"));
    assert!(all.len() > 10, "{all:?}");
    for path in all {
        let name = path.strip_prefix(bench.path("of-folder")).unwrap();
        let [folder, zip] = [&path, &bench.path("of-zip").join(name)].map(|path| fs::read_to_string(path).unwrap());
        // Only the file that the commands on the page read has another name.
        let folder = if name == Path::new("report.html") { zip.clone() } else { folder };
        assert_eq!(folder, zip.replace("sent.zip", "sent"), "{}", name.display());
    }
    let question = records(&bench.path("run"))[0]["question"].as_str().unwrap().to_owned();
    let refused = bench.call(&["show", "sent.zip", &question, "--data", "frames"]);
    assert!(refused.code == Some(2) && refused.stderr.contains("--out: missing: the run is a ZIP file"), "{refused:?}");
    let shown = bench.complete(&["show", "sent.zip", &question, "--data", "frames", "--out", "images"]);
    assert!(shown.contains("the same bytes as were sent"), "{shown}");
    bench.complete(&words("report run --baseline sent.zip"));
    bench.complete(&words("site sent.zip --out site"));
    assert!(bench.path("site/runs/sent.html").exists());
    let rescored = bench.call(&words("report sent.zip --rescore"));
    assert!(rescored.stderr.contains("is a ZIP file, which is not changed; unpack it"), "{rescored:?}");
    // Other commands change a run, so they need its folder. The message names the command that unpacks it.
    let refused = bench.call(&words("bundle sent.zip --out again.zip"));
    let command = refused.stderr.replace("\n   ", "").split("in it: ").nth(1).unwrap().trim().to_owned();
    assert_eq!((refused.code, &*command), (Some(2), "python3 -m zipfile -e sent.zip sent"), "{refused:?}");
}

#[test]
fn hostile_zip_files_are_no_runs() {
    let bench = Bench::new();
    bench.complete(&words("--model random --data rooms:frames=2,size=96x72 --levels L0,L3 --out run"));
    let run: Vec<(&str, Vec<u8>)> = ["manifest.json", "records.jsonl", "questions.jsonl"]
        .map(|name| (name, fs::read(bench.path(&format!("run/{name}"))).unwrap()))
        .to_vec();
    let zip = |name: &str, entries: &[(String, &[u8])]| {
        let mut writer = zip::ZipWriter::new(fs::File::create(bench.path(name)).unwrap());
        for (name, content) in entries {
            writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut writer, content).unwrap();
        }
        writer.finish().unwrap();
        bench.call(&words(&format!("report {name}")))
    };
    let under = |folder: &str| -> Vec<(String, &[u8])> {
        run.iter().map(|(name, content)| (format!("{folder}{name}"), &**content)).collect()
    };
    // At the top level, and in nested folders beside files of others, of which nothing is unpacked.
    for (file, folder) in [("top.zip", ""), ("nested.zip", "a/b/")] {
        let mut entries = under(folder);
        entries.push(("photos/large.bin".to_owned(), &[0; 4096]));
        assert_eq!(zip(file, &entries).code, Some(0));
    }
    let outside = [under(""), vec![("../records.jsonl".to_owned(), &b"x"[..])]].concat();
    for (file, entries, problem) in [
        ("outside.zip", outside, "leads out of the file, or is a link"),
        ("two.zip", [under("a/"), under("b/")].concat(), "2 runs are in this ZIP file; unpack it"),
        ("none.zip", under("")[1..].to_vec(), "no run in this ZIP file: it has no manifest.json"),
    ] {
        let refused = zip(file, &entries);
        let said = refused.stderr.replace("\n   ", "");
        assert!(refused.code == Some(2) && said.contains(problem), "{refused:?}");
    }
    let bomb = vec![b' '; (1 << 30) + 1];
    let refused = zip("bomb.zip", &[under(""), vec![("thumbnails.jsonl".to_owned(), &*bomb)]].concat());
    assert!(refused.code == Some(2) && refused.stderr.contains("longer than 10"), "{refused:?}");
    bench.file("text.zip", "no ZIP file");
    let refused = bench.call(&words("report text.zip"));
    assert!(refused.code == Some(2) && refused.stderr.contains("not a whole ZIP file"), "{refused:?}");
}
