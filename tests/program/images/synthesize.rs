//! `synthesize` from the outside: what it writes is what an evaluation sends.

use std::fs;
use std::path::Path;

use crate::support::run::{Bench, files, words};
use crate::support::snapshot::each;
use crate::support::table::check_rows;
use serde_json::{Value, json};

/// A folder with one image, and one question about it.
fn frames(bench: &Bench) {
    let image = image::RgbImage::from_fn(37, 21, |x, y| image::Rgb([(x * 6) as u8, (y * 12) as u8, 90]));
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
    assert_eq!(made.stdout, "out: 4 made of 1 frame\n");
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

/// Free drops of light and two readings at once: exposure has no readings, and each noisy image has the name of its
/// own.
#[test]
fn any_drop_and_profile_is_made() {
    let bench = Bench::new();
    frames(&bench);
    let light = ["--levels", "L0,3.3", "--profile", "paper,eld"];
    let made = bench.call(&[&["synthesize", "frames", "--out", "out"], &light[..]].concat());
    assert_eq!(made.code, Some(0), "{made:?}");
    let names = ["L0", "E3.3-ev", "E3.3-noise", "E3.3-noise@eld"];
    let files = names.map(|name| fs::read(bench.path(&format!("out/a_{name}.png"))).unwrap());
    assert_ne!(files[2], files[3]);
    assert_eq!(made.stdout, "out: 4 made of 1 frame\n");
    // Camera and noise are those of the frame, whatever the reading: common random numbers.
    let states = ["E3.3-noise", "E3.3-noise@eld"]
        .map(|name| json_of(&bench.path(&format!("out/a_{name}.json")))["sensor"]["state"].clone());
    assert_eq!(states[0], states[1]);
    let refused = bench.call(&[&["synthesize", "frames", "--out", "more", "--tone", "none"], &light[..]].concat());
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --noise tone: cannot be combined with several profiles; name one in --profile
    ");
}

#[test]
fn existing_images_stay_unless_different() {
    let bench = Bench::new();
    frames(&bench);
    let call = |more: &[&str]| {
        let args = words("synthesize frames/a.png --out out --levels L2");
        bench.call(&[&args[..], more].concat())
    };
    let at_two_levels = |more: &str| {
        let line = format!("synthesize frames/a.png --out out --levels L2,L3 {more}");
        bench.call(&words(&line))
    };
    assert_eq!(call(&[]).stdout, "out: 2 made of 1 frame\n");
    assert_eq!(call(&[]).stdout, "out: 0 made of 1 frame, 2 left as they were (--force makes them again)\n");
    let other = call(&["--seed", "1"]);
    assert_eq!(other.code, Some(1));
    assert_eq!(other.stdout, "out: 0 made of 1 frame, 1 left as they were (--force makes them again), 1 failed\n");
    insta::assert_snapshot!(other.messages(), @"
    exit code: 1
    ERROR out/a_L2-noise.png: made with --seed 0, now 1; --force overwrites it, another --out keeps both
    ");
    assert_eq!(at_two_levels("").code, Some(0));
    let other = at_two_levels("--noise gain=2");
    insta::assert_snapshot!(other.messages(), @"
    exit code: 1
    ERROR out/a_L2-noise.png and 1 more: made with another --noise camera, gain, ratio or fixed; --force
        overwrites it, another --out keeps both
    ");
    let other = at_two_levels("--seed 9");
    let lines: Vec<&str> = other.stderr.lines().collect();
    assert!(lines.len() == 1 && lines[0].contains("a_L2-noise.png and 1 more: made with --seed 0, now 9"), "{lines:?}");
    let before = fs::read(bench.path("out/a_L2-noise.png")).unwrap();
    assert_eq!(call(&["--seed", "1", "--force"]).code, Some(0));
    assert_ne!(before, fs::read(bench.path("out/a_L2-noise.png")).unwrap());
}

/// Writes the bytes of a JPEG with the pixels of an image: another encoder's file.
fn as_jpeg(path: &Path) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::open(path).unwrap();
    image.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

/// The same pixels in another file: no filter, no compression.
fn encoded_again(path: &Path) -> Vec<u8> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let image = image::open(path).unwrap();
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::NoFilter);
    image.write_with_encoder(encoder).unwrap();
    bytes
}

#[test]
fn json_file_verifies_image_bytes() {
    let bench = Bench::new();
    frames(&bench);
    let call = |more: &str| {
        let line = format!("synthesize frames/a.png --out out --levels L2 --variant ev {more}");
        bench.call(&words(&line))
    };
    let (image, json) = (bench.path("out/a_L2-ev.png"), bench.path("out/a_L2-ev.json"));
    assert_eq!(call("").code, Some(0));
    let written = fs::read(&image).unwrap();
    let output = &json_of(&json)["output"];
    assert_eq!(output["file"], "a_L2-ev.png");
    assert_eq!(output["bytes"], written.len());
    assert_eq!(output["digest"], blake3::hash(&written).to_hex().as_str());
    let kept = "out: 0 made of 1 frame, 1 left as they were (--force makes them again)\n";

    // Cut: made again, and said.
    fs::write(&image, &written[..written.len() / 2]).unwrap();
    let again = call("");
    assert_eq!(again.stdout, "out: 1 made of 1 frame\n");
    insta::assert_snapshot!(again.messages(), @"
    exit code: 0
     WARN out/a_L2-ev.png: cut or damaged; it is made again
    ");
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
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 1
    ERROR out/a_L2-ev.png: has 730 bytes, was written with 2420, and its pixels differ; --force overwrites it,
        another --out keeps both
    ");
    assert_eq!(fs::read(&image).unwrap(), edited);
    assert_eq!(call("--force").stdout, "out: 1 made of 1 frame\n");
    assert_eq!(fs::read(&image).unwrap(), written);

    // Killed between the two files: the JSON file is written; beside a foreign image it is not.
    fs::remove_file(&json).unwrap();
    assert_eq!(call("").stdout, kept);
    assert!(json.exists());
    fs::remove_file(&json).unwrap();
    fs::write(&image, fs::read(bench.path("frames/a.png")).unwrap()).unwrap();
    let refused = call("");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 1
    ERROR out/a_L2-ev.png: no JSON file describes it, and its pixels differ; --force overwrites it, another --out
        keeps both
    ");
    assert!(!json.exists());

    // A JSON file without its image, and one of the first schema, which had no digest.
    assert_eq!(call("--force").code, Some(0));
    fs::remove_file(&image).unwrap();
    let missing = bench.call(&words("synthesize --check out"));
    insta::assert_snapshot!(missing.messages(), @"
    exit code: 1
    ERROR out/a_L2-ev.png: cannot read: [OS ERROR]
    ");
    assert_eq!(call("").stdout, "out: 1 made of 1 frame\n");
    let mut old = json_of(&json);
    old["schema"] = "darkqa.image/1".into();
    old.as_object_mut().unwrap().remove("output");
    fs::write(&json, old.to_string()).unwrap();
    let unvouched = bench.call(&words("synthesize --check out"));
    insta::assert_snapshot!(unvouched.messages(), @"
    exit code: 1
    ERROR out/a_L2-ev.json: has no digest of its image: an older version wrote it; run `synthesize` again to add
        it
    ");
    // Its image has a JSON file, though one that cannot vouch for it.
    insta::assert_snapshot!(unvouched, @"
    exit code: 1
    stdout:
    out: images as they were written: 0; not as they were written: 1; without a JSON file: 0
    stderr:
    ERROR out/a_L2-ev.json: has no digest of its image: an older version wrote it; run `synthesize` again to add
        it
    ");
    fs::copy(&image, bench.path("out/foreign.png")).unwrap();
    let foreign = bench.call(&words("synthesize --check out"));
    insta::assert_snapshot!(foreign, @"
    exit code: 1
    stdout:
    out: images as they were written: 0; not as they were written: 1; without a JSON file: 1
    stderr:
    ERROR out/a_L2-ev.json: has no digest of its image: an older version wrote it; run `synthesize` again to add
        it
    ERROR out: no JSON file says how they were made: foreign.png
    ");
    fs::remove_file(bench.path("out/foreign.png")).unwrap();
    assert_eq!(call("").stdout, kept);
    assert_eq!(json_of(&json)["schema"], "darkqa.image/2");
    let checked = bench.call(&words("synthesize --check out"));
    assert_eq!(
        checked.stdout,
        "out: images as they were written: 1; not as they were written: 0; without a JSON file: 0\n"
    );
}

/// Frames of scenes have a folder for each scene.
#[test]
fn images_in_subfolders_are_checked() {
    let bench = Bench::new();
    bench.rooms("frames", 2, "96x72");
    bench.complete(&words("synthesize frames --levels L3 --out dark"));
    let checked = bench.complete(&words("synthesize --check dark"));
    assert_eq!(checked, "dark: images as they were written: 4; not as they were written: 0; without a JSON file: 0\n");
    let images = files(&bench.path("dark"));
    let image = images.iter().find(|path| path.extension().is_some_and(|end| end == "png")).unwrap();
    assert_ne!(image.parent().unwrap(), bench.path("dark"));
    fs::copy(image, image.with_file_name("foreign.png")).unwrap();
    let foreign = bench.call(&words("synthesize --check dark"));
    assert!(foreign.code == Some(1) && foreign.stderr.contains("/foreign.png"), "{foreign:?}");
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
        let again = bench.call(&words(&format!("synthesize frames/a.png --out again --from {from}")));
        assert_eq!(again.code, Some(0), "{again:?}");
        let [old, new] =
            ["out", "again"].map(|folder| fs::read(bench.path(&format!("{folder}/a_{condition}.png"))).unwrap());
        assert_eq!(old, new);
    });
    image::RgbImage::new(2, 2).save(bench.path("b.png")).unwrap();
    let wrong = bench.call(&words("synthesize b.png --out again --from out/a_L3-noise@custom.json"));
    insta::assert_snapshot!(wrong.messages(), @"
    exit code: 2
    error: out/a_L3-noise@custom.json: made from another image than INPUT (their contents differ, or the flags by
        which they are read)
    ");
}

#[test]
fn broken_frame_fails_alone() {
    let bench = Bench::new();
    frames(&bench);
    bench.file("frames/b.png", "no image");
    let made = bench.call(&words("synthesize frames --out out --levels L0-L1 --variant noise"));
    assert_eq!(made.code, Some(1));
    assert_eq!(made.stdout, "out: 2 made of 2 frames, 2 failed\n");
    assert_eq!(made.stderr.matches("b.png").count(), 1, "{}", made.stderr);
    assert!(bench.path("out/a_L1-noise.png").exists());
    assert!(!bench.path("out/b_L1-noise.json").exists());
}

#[test]
fn senseless_calls_get_one_line() {
    let bench = Bench::new();
    frames(&bench);
    fs::copy(bench.path("frames/a.png"), bench.path("frames/a.PNG")).unwrap();
    bench.file("my.toml", "name = \"mine\"\nadu-range = nan\n");
    let calls = [
        "frames",
        "none",
        "frames/a.png --camera my.toml",
        "frames/a.png --sheet all",
        "frames/a.png --from my.toml",
        "frames/a.png --coupling photon --ratio 4",
    ];
    let errors = each(calls, |call| {
        let refused = bench.call(&words(&format!("synthesize --out out {call}")));
        assert_eq!(refused.stderr.trim_end().lines().count(), 1, "{refused:?}");
        refused.messages()
    });
    insta::assert_snapshot!(errors, @r#"
    frames
      exit code: 2
      error: INPUT: "a.png" of frames and "a.PNG" of frames would both be written as a; rename one of them, or give
          each folder its own --out
    none
      exit code: 2
      error: none: cannot read: [OS ERROR]
    frames/a.png --camera my.toml
      exit code: 2
      error: my.toml, line 1: not a calibration: missing field `gain`
    frames/a.png --sheet all
      exit code: 2
      error: invalid value 'all' for '--sheet <SHEET>' [possible values: levels, noise]
    frames/a.png --from my.toml
      exit code: 2
      error: my.toml: not a JSON file of an image: expected ident at line 1 column 2
    frames/a.png --coupling photon --ratio 4
      exit code: 2
      error: --noise ratio: with --noise coupling=photon, or a profile that has it, the ratio is 2^EV; leave out
          --noise ratio
    "#);
    let small = bench.call(&words("synthesize frames/a.png --out out --max-pixels 100"));
    insta::assert_snapshot!(small.messages(), @"
    exit code: 1
    ERROR frames/a.png: 37 × 21 pixels are more than the 100 that are read; shrink it first, or raise --decode
        max-pixels
    ");
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
    let kept = "out: 0 made of 1 frame, 1 left as they were (--force makes them again)\n";
    assert_eq!(call("").stdout, kept);
    // Another recipe: an intact figure is made again, an edited one is not.
    let first = image::open(bench.path("out/a_levels.png")).unwrap();
    let other = call("--profile all");
    assert_eq!(other.stdout, "out: 1 made of 1 frame\n");
    insta::assert_snapshot!(other.messages(), @"
    exit code: 0
     WARN out/a_levels.png: made from another image or with other settings; it is made again
    ");
    let second = image::open(bench.path("out/a_levels.png")).unwrap();
    assert!(second.height() > first.height(), "no row for each reading");
    first.save(bench.path("out/a_levels.png")).unwrap();
    let refused = call("");
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 1
    ERROR out/a_levels.png: made from another image or with other settings (images, light: sensor: readings: eld
        and level and physical); --force overwrites it, another --out keeps both
    ");
}

/// The numbers of an exposure in a file or a record.
fn exposure(of: &Value) -> [Option<f64>; 7] {
    let fields = ["shutter", "gain", "dark", "time_ms", "system_gain", "blur_px", "blur_angle"];
    fields.map(|field| of["exposure"][field].as_f64())
}

/// Automatic exposure and motion blur: their files hold what the camera did, make the image again byte for byte, and
/// are what an evaluation sends.
#[test]
fn camera_that_meets_dark_and_moves() {
    let bench = Bench::new();
    frames(&bench);
    let light = words(
        "--variant auto,motion --levels L0,L3,L5,T66.67 --motion speed=200,angle=30 --auto shutter=1,gain=3 --seed 4",
    );
    let made = bench.call(&[&["synthesize", "frames", "--out", "out"], &light[..]].concat());
    assert_eq!(made.code, Some(0), "{made:?}");
    assert_eq!(made.stdout, "out: 4 made of 1 frame\n");
    let focal = 37.0 / 2.0 / (39.5_f64.to_radians()).tan();
    let blur = |seconds: f64| focal * 200_f64.to_radians() * seconds;
    let auto = |dark| {
        let all = [1.0, 3.0, dark, 1000.0 / 60.0, 3.0, blur(1.0 / 60.0), 30.0];
        all.map(Some)
    };
    let motion = [None, None, None, Some(66.67), None, Some(blur(0.06667)), Some(30.0)];
    check_rows(
        [("L3-auto", auto(2.0), 6.0), ("L5-auto", auto(5.0), 9.0), ("T66.67-motion", motion, 0.0)],
        |(condition, expected, drop)| {
            let file = json_of(&bench.path(&format!("out/a_{condition}.json")));
            for (found, expected) in exposure(&file).iter().zip(expected) {
                let off = found.zip(expected).map_or(0.0, |(a, b)| (a - b).abs());
                assert!(found.is_some() == expected.is_some() && off < 1e-9, "{file}");
            }
            assert_eq!(file["drop"], drop);
            let from = format!("out/a_{condition}.json");
            let again = bench.call(&words(&format!("synthesize frames/a.png --out again --from {from}")));
            assert_eq!(again.code, Some(0), "{again:?}");
            let [old, new] =
                ["out", "again"].map(|folder| fs::read(bench.path(&format!("{folder}/a_{condition}.png"))).unwrap());
            assert_eq!(old, new);
        },
    );
    let sensor = json_of(&bench.path("out/a_L5-auto.json"))["sensor"].clone();
    assert_eq!((&sensor["reading"], &sensor["state"]["system_gain"]), (&json!("physical"), &json!(3.0)));
    assert_eq!(sensor["state"]["ratio"], 32.0);
    let run = words("--data frames --model random --out run");
    let run = bench.call(&[&run[..], &light[..]].concat());
    assert_eq!(run.code, Some(0), "{run:?}");
    let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    for record in records.lines() {
        let record: Value = serde_json::from_str(record).unwrap();
        let condition = record["condition"].as_str().unwrap();
        // The frame is a PNG file, which a run sends as it is.
        let sent = if condition == "L0" { "frames/a.png".to_owned() } else { format!("out/a_{condition}.png") };
        let digest = blake3::hash(&fs::read(bench.path(&sent)).unwrap()).to_hex().to_string();
        assert_eq!(record["image"]["digest"], digest, "{condition}");
        let file = json_of(&bench.path(&format!("out/a_{condition}.json")));
        assert_eq!(exposure(&record["image"]), exposure(&file), "{condition}");
    }
    assert_eq!(records.lines().count(), 4);
}

/// A focal length that the data state counts, and the field of view of the flag does not.
#[test]
fn frames_with_known_camera_use_it() {
    let bench = Bench::new();
    let rooms = bench.call(&words("rooms --out rooms --frames 1 --size 96x64"));
    assert_eq!(rooms.code, Some(0), "{rooms:?}");
    let call = |input: &str, motion: &str, out: &str| {
        let light = format!("--variant motion --levels T33.33 --motion {motion}");
        let made = bench.call(&words(&format!("synthesize {input} --out {out} {light}")));
        assert_eq!(made.code, Some(0), "{made:?}");
        let found = walk(&bench.path(out), "_T33.33-motion.json");
        json_of(&found)["exposure"]["blur_px"].as_f64().unwrap()
    };
    let image = walk(&bench.path("rooms"), ".png");
    let image = image.to_str().unwrap();
    // The rooms' camera has a half width of 0.9 at the distance 1.
    let known = 48.0 / 0.9 * 30_f64.to_radians() * 0.03333;
    assert!((call("rooms", "speed=30", "a") - known).abs() < 1e-6);
    assert!((call("rooms", "hfov=20", "b") - known).abs() < 1e-6);
    assert!((call(image, "hfov=20", "c") - known).abs() > 1.0);
}

/// The only file below a folder whose name ends so; of several, the first.
fn walk(folder: &Path, end: &str) -> std::path::PathBuf {
    let mut found: Vec<std::path::PathBuf> = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_str().unwrap().ends_with(end) {
                found.push(path);
            }
        }
    }
    found.sort();
    found.swap_remove(0)
}

#[test]
fn what_camera_cannot_do_is_refused() {
    let bench = Bench::new();
    frames(&bench);
    let flags = [
        "--variant auto --auto gain=5",
        "--variant auto --auto gian=5",
        "--variant motion --motion sped=5",
        "--variant motion --levels L3",
        "--variant blur",
    ];
    let errors = each(flags, |flags| {
        let call = format!("synthesize frames --out out {flags}");
        bench.call(&words(&call)).messages()
    });
    insta::assert_snapshot!(errors, @r#"
    --variant auto --auto gain=5
      exit code: 2
      error: --auto: at 5 stops of gain, K is 12, but sony-a7s2 has K from 0.1 to 6; set another base-gain or fewer
          stops of gain
    --variant auto --auto gian=5
      exit code: 2
      error: invalid value 'gian=5' for '--auto <KEY=VALUE,…>': there is no setting "gian"; the settings are
          shutter, gain, base-gain, base-time; did you mean gain?
    --variant motion --motion sped=5
      exit code: 2
      error: invalid value 'sped=5' for '--motion <KEY=VALUE,…>': there is no setting "sped"; the settings are
          speed, hfov, angle; did you mean speed?
    --variant motion --levels L3
      exit code: 2
      error: --levels: L3 is a level of ev, noise, auto, but --variant motion selects none of them
    --variant blur
      exit code: 2
      error: invalid value 'blur' for '--variant <LIST>': "blur" is not one of ev, noise, auto, motion, both, all
    "#);
    // How far a picture moves depends on its size: the image fails, with its name.
    let far = "--variant motion --levels T33.33,T500 --motion speed=2000";
    let far = bench.call(&words(&format!("synthesize frames --out out {far}")));
    assert_eq!(far.code, Some(1), "{far:?}");
    assert_eq!(far.stdout, "out: 1 made of 1 frame, 1 failed\n");
    let message = "a.png at T500-motion: --motion: the picture would move by 39";
    insta::assert_snapshot!(far.messages(), @"
    exit code: 1
    ERROR a.png at T500-motion: --motion: the picture would move by 391.69 pixels during the exposure; at most 256
        are possible: ask for a shorter exposure, or set a lower speed with --motion speed=…
    ");
    // An evaluation is refused before anything is asked.
    let run = "--data frames --model random --out run --variant motion --levels T500 --motion speed=2000";
    let run = bench.call(&words(run));
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(run.stderr.contains(message) && !bench.path("run").exists());
}

/// A sheet has a row for each variant, and a block of its own for exposure times.
#[test]
fn sheets_show_variants_that_are_asked() {
    let bench = Bench::new();
    frames(&bench);
    let height = |variant: &str, out: &str| {
        let call = format!("synthesize frames --out {out} --sheet levels --variant {variant}");
        let made = bench.call(&words(&call));
        assert_eq!((made.code, &*made.stderr), (Some(0), ""), "{made:?}");
        let sheet = image::open(bench.path(&format!("{out}/a_levels.png")));
        sheet.unwrap().height()
    };
    // A row is 21 pixels and its space; a line at the foot says what made it.
    let (row, line) = (21 + 8, 20);
    let (one, two) = (height("ev", "a"), height("both", "b"));
    assert_eq!(two - one, row + line);
    let three = height("ev,noise,auto", "c");
    assert!(three >= two + row && three <= two + row + 2 * line);
    assert!(height("all", "d") > three + 29);
}
