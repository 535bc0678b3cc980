//! `synthesize` from the outside: what it writes is what an evaluation sends.

use std::fs;
use std::path::Path;

use crate::support::run::{Bench, words};
use crate::support::table::check_rows;
use serde_json::{Value, json};

/// A folder with one image, and one question about it.
fn frames(bench: &Bench) {
    let image = image::RgbImage::from_fn(37, 21, |x, y| {
        image::Rgb([(x * 6) as u8, (y * 12) as u8, 90])
    });
    fs::create_dir_all(bench.path("frames")).unwrap();
    image.save(bench.path("frames/a.png")).unwrap();
    let question = json!({"id": "q", "frame": "a.png", "question": "Is it?", "choices": ["yes", "no"], "answer": "no"});
    bench.file("frames/questions.jsonl", question.to_string());
}

fn json_of(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn files_are_what_an_evaluation_sends() {
    let bench = Bench::new();
    frames(&bench);
    let light = ["--seed", "7", "--levels", "L1,L4", "--profile", "physical"];
    let made = bench.call(&[&["synthesize", "frames", "--out", "out"], &light[..]].concat());
    assert_eq!(made.code, Some(0), "{made:?}");
    assert_eq!(made.stdout, "out: 4 made of 1 frames\n");
    let run = ["--data", "frames", "--model", "random", "--out", "run"];
    let run = bench.call(&[&run[..], &light[..]].concat());
    assert_eq!(run.code, Some(0), "{run:?}");
    let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    let mut compared = 0;
    for record in records.lines() {
        let record: Value = serde_json::from_str(record).unwrap();
        let condition = record["condition"].as_str().unwrap();
        let file = fs::read(bench.path(&format!("out/a_{condition}.png"))).unwrap();
        let digest = blake3::hash(&file).to_hex().to_string();
        assert_eq!(record["image"]["digest"], digest, "{condition}");
        compared += 1;
    }
    assert_eq!(compared, 4);
    assert!(bench.path("out/a_L4-noise@physical.png").exists());
}

/// Free drops of light and two readings at once: exposure has no readings, and each noisy image has the name of its own.
#[test]
fn any_drop_and_several_readings_are_made() {
    let bench = Bench::new();
    frames(&bench);
    let light = ["--levels", "L0,3.3", "--profile", "paper,eld"];
    let made = bench.call(&[&["synthesize", "frames", "--out", "out"], &light[..]].concat());
    assert_eq!(made.code, Some(0), "{made:?}");
    let names = ["L0", "E3.3-ev", "E3.3-noise", "E3.3-noise@eld"];
    let files = names.map(|name| fs::read(bench.path(&format!("out/a_{name}.png"))).unwrap());
    assert_ne!(files[2], files[3]);
    assert_eq!(made.stdout, "out: 4 made of 1 frames\n");
    // Camera and noise are those of the frame, whatever the reading: common random numbers.
    let states = ["E3.3-noise", "E3.3-noise@eld"]
        .map(|name| json_of(&bench.path(&format!("out/a_{name}.json")))["sensor"]["state"].clone());
    assert_eq!(states[0], states[1]);
    let refused = bench.call(
        &[
            &["synthesize", "frames", "--out", "more", "--tone", "none"],
            &light[..],
        ]
        .concat(),
    );
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused
            .stderr
            .contains("--tone: cannot be combined with several profiles")
    );
}

#[test]
fn what_is_there_is_kept_unless_it_is_another() {
    let bench = Bench::new();
    frames(&bench);
    let call = |more: &[&str]| {
        let args = words("synthesize frames/a.png --out out --levels L2");
        bench.call(&[&args[..], more].concat())
    };
    assert_eq!(call(&[]).stdout, "out: 2 made of 1 frames\n");
    assert_eq!(
        call(&[]).stdout,
        "out: 0 made of 1 frames, 2 kept as they were (--force makes them again)\n"
    );
    let other = call(&["--seed", "1"]);
    assert_eq!(other.code, Some(1));
    assert_eq!(
        other.stdout,
        "out: 0 made of 1 frames, 1 kept as they were (--force makes them again), 1 failed\n"
    );
    assert!(other.stderr.contains("a_L2-noise.png") && other.stderr.contains("--force"));
    let before = fs::read(bench.path("out/a_L2-noise.png")).unwrap();
    assert_eq!(call(&["--seed", "1", "--force"]).code, Some(0));
    assert_ne!(before, fs::read(bench.path("out/a_L2-noise.png")).unwrap());
}

/// Writes the bytes of a JPEG with the pixels of an image: another encoder's file.
fn as_jpeg(path: &Path) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::open(path).unwrap();
    image
        .write_to(&mut bytes, image::ImageFormat::Jpeg)
        .unwrap();
    bytes.into_inner()
}

/// The same pixels in another file: no filter, no compression.
fn encoded_again(path: &Path) -> Vec<u8> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let image = image::open(path).unwrap();
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::NoFilter);
    image.write_with_encoder(encoder).unwrap();
    bytes
}

#[test]
fn a_json_file_vouches_for_the_bytes_of_its_image() {
    let bench = Bench::new();
    frames(&bench);
    let call = |more: &str| {
        let line = format!("synthesize frames/a.png --out out --levels L2 --variant ev {more}");
        bench.call(&words(&line))
    };
    let (image, json) = (
        bench.path("out/a_L2-ev.png"),
        bench.path("out/a_L2-ev.json"),
    );
    assert_eq!(call("").code, Some(0));
    let written = fs::read(&image).unwrap();
    let output = &json_of(&json)["output"];
    assert_eq!(output["file"], "a_L2-ev.png");
    assert_eq!(output["bytes"], written.len());
    assert_eq!(output["digest"], blake3::hash(&written).to_hex().as_str());
    let kept = "out: 0 made of 1 frames, 1 kept as they were (--force makes them again)\n";

    // Cut: made again, and said.
    fs::write(&image, &written[..written.len() / 2]).unwrap();
    let again = call("");
    assert_eq!(again.stdout, "out: 1 made of 1 frames\n");
    assert!(
        again
            .stderr
            .contains("a_L2-ev.png: cut or damaged; it is made again")
    );
    assert_eq!(fs::read(&image).unwrap(), written);

    // The same pixels from another encoder: kept, and the JSON file vouches for the new bytes.
    fs::write(&image, encoded_again(&image)).unwrap();
    assert_ne!(fs::read(&image).unwrap(), written);
    assert_eq!(bench.call(&words("synthesize --check out")).code, Some(1));
    assert_eq!(call("").stdout, kept);
    assert_eq!(bench.call(&words("synthesize --check out")).code, Some(0));

    // Edited: refused by name, and nothing is written.
    let edited = as_jpeg(&image);
    fs::write(&image, &edited).unwrap();
    let refused = call("");
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("a_L2-ev.png: has") && refused.stderr.contains("--force"),
        "{}",
        refused.stderr
    );
    assert_eq!(fs::read(&image).unwrap(), edited);
    assert_eq!(call("--force").stdout, "out: 1 made of 1 frames\n");
    assert_eq!(fs::read(&image).unwrap(), written);

    // Killed between the two files: the JSON file is written; beside a foreign image it is not.
    fs::remove_file(&json).unwrap();
    assert_eq!(call("").stdout, kept);
    assert!(json.exists());
    fs::remove_file(&json).unwrap();
    fs::write(&image, fs::read(bench.path("frames/a.png")).unwrap()).unwrap();
    let refused = call("");
    assert!(
        refused.stderr.contains("no JSON file vouches for it"),
        "{}",
        refused.stderr
    );
    assert!(!json.exists());

    // A JSON file without its image, and one of the first schema, which had no digest.
    assert_eq!(call("--force").code, Some(0));
    fs::remove_file(&image).unwrap();
    let missing = bench.call(&words("synthesize --check out"));
    assert_eq!(missing.code, Some(1));
    assert!(missing.stderr.contains("a_L2-ev.png"), "{}", missing.stderr);
    assert_eq!(call("").stdout, "out: 1 made of 1 frames\n");
    let mut old = json_of(&json);
    old["schema"] = "darkqa.image/1".into();
    old.as_object_mut().unwrap().remove("output");
    fs::write(&json, old.to_string()).unwrap();
    let unvouched = bench.call(&words("synthesize --check out"));
    assert!(
        unvouched.stderr.contains("has no digest"),
        "{}",
        unvouched.stderr
    );
    assert_eq!(call("").stdout, kept);
    assert_eq!(json_of(&json)["schema"], "darkqa.image/2");
    let checked = bench.call(&words("synthesize --check out"));
    assert_eq!(
        checked.stdout,
        "out: 1 images are as they were written, 0 are not\n"
    );
}

/// Fresh draws and a camera of another make leave the level's own traces in the file: nothing else is needed.
#[test]
fn a_file_makes_its_image_again() {
    let bench = Bench::new();
    frames(&bench);
    let made = bench.call(&words(
        "synthesize frames/a.png --out out --levels L3 \
         --draws fresh --amplify all --camera nikon-d850 --seed 3",
    ));
    assert_eq!(made.code, Some(0), "{made:?}");
    let sidecar = json_of(&bench.path("out/a_L3-noise@custom.json"));
    assert_eq!(sidecar["sensor"]["reading"], "custom");
    assert_eq!(sidecar["sensor"]["model"]["name"], "nikon-d850");
    assert_eq!(sidecar["drop"], 6.0);
    check_rows(["L3-noise@custom", "L3-ev"], |condition| {
        let from = format!("out/a_{condition}.json");
        let again = bench.call(&words(&format!(
            "synthesize frames/a.png --out again --from {from}"
        )));
        assert_eq!(again.code, Some(0), "{again:?}");
        let [old, new] = ["out", "again"]
            .map(|folder| fs::read(bench.path(&format!("{folder}/a_{condition}.png"))).unwrap());
        assert_eq!(old, new);
    });
    image::RgbImage::new(2, 2)
        .save(bench.path("b.png"))
        .unwrap();
    let wrong = bench.call(&words(
        "synthesize b.png --out again --from out/a_L3-noise@custom.json",
    ));
    assert_eq!(wrong.code, Some(2));
    assert!(wrong.stderr.contains("another image"), "{}", wrong.stderr);
}

#[test]
fn one_broken_frame_does_not_stop_the_others() {
    let bench = Bench::new();
    frames(&bench);
    bench.file("frames/b.png", "no image");
    let made = bench.call(&words(
        "synthesize frames --out out --levels L0-L1 --variant noise",
    ));
    assert_eq!(made.code, Some(1));
    assert_eq!(made.stdout, "out: 2 made of 2 frames, 2 failed\n");
    assert_eq!(made.stderr.matches("b.png").count(), 1, "{}", made.stderr);
    assert!(bench.path("out/a_L1-noise.png").exists());
    assert!(!bench.path("out/b_L1-noise.json").exists());
}

#[test]
fn what_makes_no_sense_is_one_line() {
    let bench = Bench::new();
    frames(&bench);
    fs::copy(bench.path("frames/a.png"), bench.path("frames/a.PNG")).unwrap();
    bench.file("my.toml", "name = \"mine\"\nadu-range = nan\n");
    let cases: [(&[&str], &str); 6] = [
        (&["frames"], "would both be written as a;"),
        (&["none"], "none"),
        (&["frames/a.png", "--camera", "my.toml"], "my.toml"),
        (
            &["frames/a.png", "--sheet", "all"],
            "'--sheet <SHEET>' [possible values: levels, noise]",
        ),
        (&["frames/a.png", "--from", "my.toml"], "my.toml"),
        (
            &["frames/a.png", "--coupling", "photon", "--ratio", "4"],
            "--ratio",
        ),
    ];
    check_rows(cases, |(args, message)| {
        let refused = bench.call(&[&["synthesize", "--out", "out"], args].concat());
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert_eq!(
            refused.stderr.trim_end().lines().count(),
            1,
            "{}",
            refused.stderr
        );
        assert!(refused.stderr.contains(message), "{}", refused.stderr);
    });
    let small = bench.call(&words("synthesize frames/a.png --out out --max-pixels 100"));
    assert_eq!(small.code, Some(1));
    assert!(small.stderr.contains("--max-pixels"), "{}", small.stderr);
}

#[test]
fn sheets_are_drawn_for_each_frame() {
    let bench = Bench::new();
    frames(&bench);
    for kind in ["levels", "noise"] {
        let made = bench.call(&["synthesize", "frames", "--out", "out", "--sheet", kind]);
        assert_eq!(made.code, Some(0), "{made:?}");
        let sheet = image::open(bench.path(&format!("out/a_{kind}.png"))).unwrap();
        assert!(sheet.width() > 500);
        let recipe = json_of(&bench.path(&format!("out/a_{kind}.json")));
        assert_eq!(recipe["schema"], "darkqa.sheet/1");
    }
    let call = |more: &str| {
        let line = format!("synthesize frames --out out --sheet levels {more}");
        bench.call(&words(&line))
    };
    let kept = "out: 0 made of 1 frames, 1 kept as they were (--force makes them again)\n";
    assert_eq!(call("").stdout, kept);
    // Another recipe: an intact figure is made again, an edited one is not.
    let first = image::open(bench.path("out/a_levels.png")).unwrap();
    let other = call("--profile all");
    assert_eq!(other.stdout, "out: 1 made of 1 frames\n");
    assert!(
        other
            .stderr
            .contains("with other settings; it is made again"),
        "{}",
        other.stderr
    );
    let second = image::open(bench.path("out/a_levels.png")).unwrap();
    assert!(second.height() > first.height(), "no row for each reading");
    first.save(bench.path("out/a_levels.png")).unwrap();
    let refused = call("");
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("--force"), "{}", refused.stderr);
}
