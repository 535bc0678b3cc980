//! EXIF orientation: images are turned as their files state, unless maps lie beside them.

use std::fs;

use crate::support::image_files::{exif, jpeg, png, seen, turned_jpeg, turned_png};
use crate::support::run::{Bench, records, words};
use darkqa_pictures::DecodeRule;
use darkqa_pictures::ImageFile;
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

/// An image with another colour in every pixel.
fn image() -> RgbImage {
    RgbImage::from_fn(7, 4, |x, y| Rgb([(x * 30) as u8, (y * 60) as u8, 99]))
}

fn file(bytes: Vec<u8>) -> ImageFile {
    ImageFile::new(bytes, "a file".to_owned(), DecodeRule::default())
}

#[test]
fn all_orientations_match_turned_copy() {
    let stored = image();
    let coded = file(jpeg(&stored)).decode().unwrap();
    let coded = RgbImage::from_raw(7, 4, coded.samples().to_vec()).unwrap();
    for orientation in 1..=8 {
        let of_jpeg = turned_jpeg(&jpeg(&stored), orientation);
        for (bytes, pixels) in [(turned_png(&stored, orientation), &stored), (of_jpeg, &coded)] {
            let expected = seen(pixels, orientation);
            let (plain, turned) = (file(png(&expected)), file(bytes));
            let decoded = turned.decode().unwrap();
            assert_eq!(decoded, plain.decode().unwrap(), "{orientation}");
            assert_eq!(turned.check().unwrap(), expected.dimensions());
            let stated = (orientation > 1).then_some(orientation as u8);
            assert_eq!(turned.note().orientation, stated);
        }
    }
}

#[test]
fn orientation_changes_only_its_digest() {
    let stored = image();
    let plain = [png(&stored), jpeg(&stored), turned_png(&stored, 1)];
    for bytes in plain {
        let digest = blake3::hash(&bytes).to_hex().to_string();
        assert_eq!(file(bytes).digest().to_string(), digest);
    }
    let bytes = turned_png(&stored, 6);
    let digest = blake3::hash(&bytes).to_hex().to_string();
    assert_ne!(file(bytes).digest().to_string(), digest);
}

/// Values outside 1 to 8, and EXIF data that end too early, turn nothing and break nothing.
#[test]
fn orientations_that_mean_nothing_turn_nothing() {
    let stored = image();
    let expected = file(png(&stored)).decode().unwrap();
    for orientation in [0, 9, 300] {
        let file = file(turned_png(&stored, orientation));
        assert_eq!(file.decode().unwrap(), expected);
        assert_eq!(file.note().orientation, None);
    }
    let data = exif(6);
    for length in 0..data.len() {
        let chunk = crate::support::image_files::chunk(*b"eXIf", &data[..length]);
        let bytes = crate::support::image_files::with_chunks(&png(&stored), &[chunk]);
        let width = file(bytes).check().unwrap().0;
        assert!([7, 4].contains(&width), "{length}");
    }
}

/// A folder with two images of one scene; the first has an EXIF orientation.
fn folder(bench: &Bench, name: &str, first: &[u8]) {
    bench.file(&format!("{name}/a.png"), first);
    bench.file(&format!("{name}/b.png"), png(&image()));
    let question = |id: &str, frame: &str| json!({"id": id, "frame": frame, "question": "Is it?", "choices": ["yes", "no"], "answer": "no"});
    let questions = [question("1", "a.png"), question("2", "b.png")];
    let lines = questions.map(|question| question.to_string()).join("\n");
    bench.file(&format!("{name}/questions.jsonl"), lines);
}

#[test]
fn dark_images_match_turned_copy() {
    let bench = Bench::new();
    folder(&bench, "stated", &turned_png(&image(), 6));
    folder(&bench, "by-hand", &png(&seen(&image(), 6)));
    let light = "--levels L0,L3 --profile paper,physical";
    for set in ["stated", "by-hand"] {
        let line = format!("synthesize {set} --out dark-{set} {light}");
        let made = bench.call(&words(&line));
        assert_eq!(made.code, Some(0), "{made:?}");
        let expected = usize::from(set == "stated");
        assert_eq!(made.stderr.matches("turned").count(), expected, "{made:?}");
    }
    let again = bench.call(&words("synthesize stated --out dark-stated --levels L0,L3 --profile paper,physical"));
    insta::assert_snapshot!(again, @"
    exit code: 0
    stdout:
    dark-stated: 0 made of 2 frames, 8 left as they were (--force makes them again)
    stderr:
     WARN 1 image is turned as the EXIF orientation of the file states (orientation 6: 1; for example a.png)
    ");
    for condition in ["L0", "L3-ev", "L3-noise", "L3-noise@physical"] {
        let read = |set: &str, end: &str| {
            let path = format!("dark-{set}/a_{condition}.{end}");
            fs::read(bench.path(&path)).unwrap()
        };
        assert_eq!(read("stated", "png"), read("by-hand", "png"), "{condition}");
        let sidecar = |set| serde_json::from_slice::<Value>(&read(set, "json")).unwrap();
        assert_eq!(sidecar("stated")["orientation"], 6);
        assert_eq!(sidecar("by-hand").get("orientation"), None);
    }
    let from = "synthesize stated/a.png --from dark-stated/a_L3-noise.json --out again";
    assert_eq!(bench.call(&words(from)).code, Some(0));
    assert_eq!(
        fs::read(bench.path("again/a_L3-noise.png")).unwrap(),
        fs::read(bench.path("dark-stated/a_L3-noise.png")).unwrap()
    );
}

#[test]
fn a_run_says_what_was_turned() {
    let bench = Bench::new();
    folder(&bench, "stated", &turned_png(&image(), 8));
    folder(&bench, "by-hand", &png(&seen(&image(), 8)));
    let run = |set: &str| {
        let line = format!("--data {set} --model random --levels L0,L2 --out run-{set}");
        let called = bench.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        let manifest = fs::read(bench.path(&format!("run-{set}/manifest.json"))).unwrap();
        let manifest: Value = serde_json::from_slice(&manifest).unwrap();
        let page = fs::read_to_string(bench.path(&format!("run-{set}/report.html"))).unwrap();
        let mut records = records(&bench.path(&format!("run-{set}")));
        records.sort_by_key(|record| format!("{} {}", record["frame"], record["condition"]));
        (called, manifest, page, records)
    };
    let (called, manifest, page, stated) = run("stated");
    let said = "1 image is turned as the EXIF orientation of the file states (orientation 8: 1; for example a.png)";
    assert_eq!(called.stderr.matches(said).count(), 1, "{called:?}");
    let shown: Vec<&str> = called.stdout.split_whitespace().collect();
    assert!(shown.join(" ").contains(said), "{called:?}");
    assert!(page.contains(said));
    assert_eq!(manifest["inputs"], json!({"turned": {"images": {"orientation 8": 1}, "example": "a.png"}}));
    let (called, manifest, page, by_hand) = run("by-hand");
    assert!(!called.stderr.contains("turned") && !page.contains("EXIF"));
    assert_eq!(manifest.get("inputs"), None);
    assert_eq!(stated.len(), by_hand.len());
    for (one, other) in stated.iter().zip(&by_hand) {
        let is_turned = one["frame"] == "a.png";
        // The file that was turned by hand is sent as it is, in the bytes of another writer.
        let is_rewritten = is_turned && one["condition"] == "L0";
        assert_eq!(one["image"]["digest"] != other["image"]["digest"], is_rewritten, "{one}");
        // The same pixels, but results of a program that turned nothing must not stand in for these.
        assert_eq!(one["key"] != other["key"], is_turned, "{one}");
        let orientation = one["image"].get("orientation");
        assert_eq!(orientation, is_turned.then(|| json!(8)).as_ref());
        assert_eq!(other["image"].get("orientation"), None);
    }
}

/// A folder of one frame with a map of its classes in this size.
fn with_map(bench: &Bench, name: &str, size: [u32; 2]) {
    bench.file(&format!("{name}/a.jpg"), turned_jpeg(&jpeg(&image()), 6));
    let map = image::GrayImage::new(size[0], size[1]);
    map.save(bench.path(&format!("{name}/sem.png"))).unwrap();
    bench.file(&format!("{name}/frames.jsonl"), r#"{"scene":"s","frame":"0","rgb":"a.jpg","sem":"sem.png"}"#);
}

#[test]
fn image_with_maps_is_not_turned() {
    let bench = Bench::new();
    with_map(&bench, "fits", [7, 4]);
    let made = bench.call(&words("synthesize fits --out dark --levels L0"));
    insta::assert_snapshot!(made.messages(), @"
    exit code: 0
     WARN 1 image is not turned as the EXIF orientation of the file states, because the maps beside the image are
        not turned (orientation 6: 1; for example s/0)
    ");
    let pixels = image::open(bench.path("dark/s/0_L0.png")).unwrap();
    assert_eq!((pixels.width(), pixels.height()), (7, 4));
    let sidecar = fs::read(bench.path("dark/s/0_L0.json")).unwrap();
    let sidecar: Value = serde_json::from_slice(&sidecar).unwrap();
    assert_eq!(sidecar["orientation_ignored"], 6);
    assert_eq!(sidecar.get("orientation"), None);
    let file = blake3::hash(&fs::read(bench.path("fits/a.jpg")).unwrap());
    assert_eq!(sidecar["source"], file.to_hex().to_string());
    for size in [[4, 7], [7, 7]] {
        let name = format!("other-{}", size[0]);
        with_map(&bench, &name, size);
        let refused = bench.call(&words(&format!("synthesize {name} --out no --levels L0")));
        assert_eq!(refused.code, Some(1), "{refused:?}");
        for part in ["sem.png", "a.jpg", "EXIF orientation 6", "as stored"] {
            assert!(refused.stderr.contains(part), "{part}: {refused:?}");
        }
    }
}
