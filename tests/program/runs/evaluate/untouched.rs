//! The untouched images, enhanced: what is asked, shown and compared at `L0+NAME`, and the calls in which no image
//! would be enhanced.

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Value, json};

use super::text;
use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::{lines_with, redacted};
use crate::support::table::check_rows;

/// A folder `photos` with three photographs whose codes reach up to `light`, and a question about each. The script
/// answers by light: raw L0 is right, all else as the word says.
fn photos(light: u32) -> Bench {
    let bench = Bench::new();
    let mut questions = Vec::new();
    for index in 0..3_u32 {
        let image = image::RgbImage::from_fn(96, 64, |x, y| {
            let code = |step: u32| ((x * step + y * 3 + index * 7) % 97 * light / 97) as u8;
            image::Rgb([code(2), code(3), code(1)])
        });
        let name = format!("{index}.png");
        fs::create_dir_all(bench.path("photos")).unwrap();
        image.save(bench.path("photos").join(&name)).unwrap();
        questions.push(
            json!({"id": format!("q{index}"), "frame": name, "family": "presence",
                "question": "Is there a sink?", "choices": ["yes", "no"], "answer": "yes"})
            .to_string(),
        );
    }
    bench.file("photos/questions.jsonl", questions.join("\n"));
    let answers: Vec<String> = (0..3)
        .map(|index| json!({"question": format!("q{index}"), "condition": "L0", "reply": "yes"}).to_string())
        .chain([json!({"default": "no"}).to_string()])
        .collect();
    bench.file("answers.jsonl", answers.join("\n"));
    bench
}

const ASK: &str = "--model script:answers.jsonl --data photos --llie lift --out run";

/// The words that follow the name of a row in the table on standard output.
fn row<'t>(table: &'t str, name: &str) -> Vec<&'t str> {
    let line = table.lines().map(str::trim_start).find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no row {name:?}: {table}")).split_whitespace().collect()
}

/// The number of records in each condition.
fn asked(bench: &Bench) -> BTreeSet<(String, usize)> {
    let records = records(&bench.path("run"));
    let conditions: Vec<&str> = records.iter().map(|r| text(r, "condition")).collect();
    let count = |name: &&str| conditions.iter().filter(|other| other == &name).count();
    conditions.iter().map(|name| ((*name).to_owned(), count(name))).collect()
}

fn mean(image: &image::RgbImage) -> f64 {
    let sum: u64 = image.as_raw().iter().map(|code| u64::from(*code)).sum();
    sum as f64 / image.as_raw().len() as f64
}

#[test]
fn dark_photographs_are_asked_and_enhanced() {
    let bench = photos(40);
    let called = bench.call(&words(&format!("{ASK} --levels L0 --llie-on l0")));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(!called.stderr.contains("dark already"), "{called:?}");
    assert_eq!(row(&called.stdout, "untouched")[0], "100.0");
    assert_eq!(row(&called.stdout, "untouched + lift")[0], "0.0");
    let expected = [("L0".to_owned(), 3), ("L0+lift".to_owned(), 3)];
    assert_eq!(asked(&bench), expected.into());
    let records = records(&bench.path("run"));
    let of = |condition: &str| -> &Value {
        let is = |r: &&Value| text(r, "condition") == condition && text(r, "question") == "q1";
        records.iter().find(is).unwrap()
    };
    let (raw, enhanced) = (of("L0"), of("L0+lift"));
    assert_ne!(raw["image"]["digest"], enhanced["image"]["digest"]);
    assert_eq!(
        (&enhanced["level"], &enhanced["variant"], &enhanced["ev"]),
        (&json!("L0"), &json!("none"), &json!(0.0))
    );
    assert_eq!((&raw["enhancer"], &enhanced["enhancer"]), (&Value::Null, &json!("lift")));

    // The first image was made for the probe too, and counts once.
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["enhancers"]["lift"]["judged"]["images"], 3);

    // The image is made again from what the run holds, and is another one than the file.
    let shown = bench.call(&words("show run q1 --condition L0+lift"));
    insta::assert_snapshot!(shown, @r#"
    exit code: 0
    stdout:
    q1, about 1.png
    Is there a sink?
      A. yes  (true)
      B. no
    L0+lift: run/shown/1_L0+lift.png
    L0+lift: the same bytes as were sent ([DIGEST])
      script:answers.jsonl: ✗ wrong: "no"
    "#);
    let open = |path: &str| image::open(bench.path(path)).unwrap().to_rgb8();
    let (photo, lifted) = (open("photos/1.png"), open("run/shown/1_L0+lift.png"));
    assert!(mean(&lifted) > 1.5 * mean(&photo), "{} {}", mean(&lifted), mean(&photo));

    // The set for other tools holds the same pixels.
    let flags = "--levels L0 --llie lift --llie-on l0 --out sets";
    let exported = bench.complete(&words(&format!("export imagefolder photos {flags}")));
    insta::assert_snapshot!(redacted(&exported), @"
    3 questions about 3 images in 2 conditions:
    sets/L0/metadata.jsonl
    sets/L0+lift/metadata.jsonl
    ");
    let sets = crate::support::run::files(&bench.path("sets"));
    let is_one = |path: &&std::path::PathBuf| {
        let path = path.to_string_lossy();
        path.contains("L0+lift") && path.ends_with("1.png")
    };
    let file = sets.iter().find(is_one).unwrap();
    assert_eq!(image::open(file).unwrap().to_rgb8(), lifted);
}

#[test]
fn a_row_holds_one_treatment() {
    let bench = photos(220);
    let before = bench.complete(&words(&format!("{ASK} --levels L0,L3")));
    // L3 alone, and how far its interval reaches: L0 was not enhanced.
    assert_eq!(row(&before, "with noise")[..2], ["100.0", "0.0"]);
    assert_eq!(row(&before, "with noise + lift")[0], "0.0");
    assert_eq!(row(&before, "with noise + lift").len(), 3, "{before}");
    let first = records(&bench.path("run"));
    let after = bench.complete(&words(&format!("{ASK} --levels L0,L3 --llie-on l0,noise")));
    assert_eq!(row(&after, "with noise")[..2], ["100.0", "0.0"]);
    assert_eq!(row(&after, "with noise + lift")[..2], ["0.0", "0.0"]);
    // Only what is new was asked, and the run as it was before asks nothing.
    let all = records(&bench.path("run"));
    assert_eq!((first.len(), all.len()), (12, 15));
    assert_eq!(all[..12], first[..]);
    bench.complete(&words(&format!("{ASK} --levels L0,L3 --llie-on noise")));
    assert_eq!(records(&bench.path("run")).len(), 15);
}

#[test]
fn report_has_untouched_images_enhanced() {
    let bench = photos(220);
    let full = format!("{ASK} --levels L0,L3 --llie-on all --full");
    let table = bench.complete(&words(&full));
    insta::assert_snapshot!(lines_with(&table, "untouched "), @"
    script:answers.jsonl   untouched              100.0         3          0        0   −56.1 0.0
    script:answers.jsonl   untouched + lift         0.0         3          0        0   0.0 +56.1
    ");
    let read = |name: &str| fs::read_to_string(bench.path("run").join(name)).unwrap();
    let lines = |name: &str, field: &str| {
        let text = read(name);
        let count = text.lines().filter(|line| line.contains(field)).count();
        assert!(count > 0, "{name}: {field}: {text}");
    };
    // Model, view, level, variant and enhancer.
    lines("summary.csv", ",image,L0,none,lift,");
    // The untouched frame may be dark itself: no picture can be compared with it.
    let fidelity = fs::read_to_string(bench.path("run/fidelity.csv")).unwrap();
    assert!(fidelity.contains("L3-noise+lift,") && !fidelity.contains("L0+lift,"));
    lines("pooled.csv", "enhancer,");
    let compared = "enhancer,script:answers.jsonl,L0+lift,script:answers.jsonl,L0,all,3,0,1,-1,";
    lines("comparisons.csv", compared);
    assert!(read("report.html").contains("untouched + lift"));
    assert!(read("tables.tex").contains("untouched + lift"));
    // The line of the enhancer starts at L0: two points in each of the two panels.
    let caption = "in the line of an enhancer enhanced with it";
    assert!(read("report.html").contains(caption));
    let other = photos(220);
    other.complete(&words(&format!("{ASK} --levels L0,L3 --llie-on both")));
    let figure = |bench: &Bench| fs::read_to_string(bench.path("run/figures/enhancers.svg")).unwrap();
    assert_ne!(figure(&bench), figure(&other));
    let report = fs::read_to_string(other.path("run/report.html")).unwrap();
    assert!(!report.contains("untouched + lift") && !report.contains(caption));
}

#[test]
fn enhancer_without_image_is_error() {
    let bench = photos(220);
    let only = "the enhancer would never be used: only L0 is asked; --llie-on l0 enhances the untouched images";
    let rows = [
        ("--levels L0", only),
        ("--levels L0 --dry-run", only),
        ("--levels L0 --llie-on both", only),
        ("--variant ev", "--llie-on noise is not among the images asked; --llie-on ev is"),
        ("--levels L3 --llie-on l0", "--llie-on both is"),
        ("--llie-on dark", "--llie-on dark is not among the images asked; the data have no photographs in the dark"),
        ("--llie-on dusk", "is not one of l0, ev, noise, auto, motion, both, dark, all"),
    ];
    check_rows(rows, |(flags, problem)| {
        let called = bench.call(&words(&format!("{ASK} {flags}")));
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains(problem), "{called:?}");
        assert!(!bench.path("run").exists());
    });
    let called = bench.call(&words("export llava photos --out sets --llie lift --levels L0"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --llie: the enhancer would never be used: only L0 is asked; --llie-on l0 enhances the untouched images
    ");
    // A model that is shown no image is told so, and asked.
    let blind = "--blind-model random --data photos --llie lift --levels L0 --out blind";
    let called = bench.call(&words(blind));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN --levels, --llie: no effect: no model is shown an image
    ");
}

#[test]
fn estimate_counts_untouched_images_enhanced() {
    let bench = photos(220);
    let rows = [("noise", 12), ("l0,noise", 15), ("all", 18)];
    // Three questions about three images in L0, L3-ev, L3-noise and the enhanced ones.
    check_rows(rows, |(on, expected)| {
        let line = format!("{ASK} --levels L0,L3 --dry-run --json --llie-on {on}");
        let forecast: Value = serde_json::from_str(&bench.complete(&words(&line))).unwrap();
        let found = ["trials", "images"].map(|field| forecast[field].as_u64());
        assert_eq!(found, [Some(expected); 2], "{forecast}");
    });
}

#[test]
fn dark_images_are_noticed_once() {
    let hint = "these images are dark already (median brightness ";
    let advice = "of 255); --levels L0 --llie-on l0 asks about them as they are and enhanced, and --light dark does so by default";
    let rows = [
        (40, "--levels L0,L3 --llie lift", 1),
        (40, "--levels L0,L3 --llie lift --llie-on all", 1),
        (40, "--levels L0", 1),
        (40, "--levels L0 --dry-run", 1),
        (40, "--levels L0 --llie lift --llie-on l0", 0),
        (220, "--levels L0,L3 --llie lift", 0),
        (220, "--levels L0", 0),
    ];
    check_rows(rows, |(light, flags, times)| {
        let bench = photos(light);
        let called = bench.call(&words(&format!("--model random --data photos {flags} --out run")));
        assert_eq!(called.code, Some(0), "{called:?}");
        assert_eq!(called.stderr.matches(hint).count(), times, "{called:?}");
        assert_eq!(called.stderr.matches(advice).count(), times, "{called:?}");
    });
    // The check says it in the same words.
    let bench = photos(40);
    let rows = [
        ("", 1),
        ("--light dark", 0),
        ("--levels L0 --llie lift --llie-on l0", 0),
        ("--levels L0,L3 --llie lift --llie-on all", 1),
        ("--levels L0", 1),
    ];
    for (flags, times) in rows {
        let checked = bench.complete(&words(&format!("check photos {flags}")));
        assert_eq!(checked.matches(hint).count(), times, "{checked}");
        assert_eq!(checked.matches(advice).count(), times, "{checked}");
        assert!(checked.contains("median brightness 19 of 255"), "{checked}");
    }
    // Built-in rooms are lit, and a model that sees no image needs no advice.
    let bench = photos(40);
    for flags in ["--model random --levels L0,L3 --out rooms", "--blind-model random --data photos --out blind"] {
        let called = bench.call(&words(flags));
        assert_eq!((called.code, called.stderr.contains(hint)), (Some(0), false), "{called:?}");
    }
}

#[test]
fn open_questions_cover_untouched_enhanced() {
    let house = House::new();
    onnx::gain(2.0).write(&house.0.path(""), "bright.onnx");
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    house.0.file("j.jsonl", "{\"default\": \"3\"}");
    let call = |on: &str| {
        let line = format!(
            "--model script:a.jsonl --judge script:j.jsonl --levels L0,L2 --llie bright.onnx --llie-anyway \
             --llie-on {on} --out run"
        );
        let called = house.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        called.stdout
    };
    // Each score but that of the untouched images as they are has its difference from it.
    let scores = |table: &str, light: &str| {
        let line = table.lines().find(|line| line.contains(light)).unwrap();
        (line.matches("50.0").count(), line.matches("(0.0)").count())
    };
    let before = call("noise");
    assert_eq!(scores(&before, "with noise + bright"), (1, 1), "{before}");
    let after = call("l0,noise");
    assert_eq!(scores(&after, "with noise + bright"), (2, 2), "{after}");
    assert_eq!(scores(&after, "with noise "), (2, 1), "{after}");
    assert!(!after.contains("untouched"), "{after}");
    let conditions: BTreeSet<String> =
        records(&house.0.path("run")).iter().map(|record| text(record, "condition").to_owned()).collect();
    assert!(conditions.contains("L0+bright"), "{conditions:?}");
}
