//! Photographs in the dark: beside their frames, sets that are dark from the start, pairs in two folders, and classes
//! by folder.

use std::collections::BTreeSet;
use std::fs;
use std::io::{Cursor, Write as _};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, assert_same_products, model_args, records, words};
use crate::support::snapshot::{lines_with, redacted};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

/// Number of scenes.
const SCENES: u32 = 12;

/// A scene with structure of its own.
fn scene(number: u32) -> RgbImage {
    RgbImage::from_fn(96, 72, |x, y| {
        let block = (x / 12 * 7 + y / 12 * 13 + number * 29).wrapping_mul(2_654_435_761) >> 24;
        let code = 70 + (block % 150) as u8;
        Rgb([code, code.saturating_sub((number * 3) as u8), 60 + code / 2])
    })
}

/// The image with `ev` EV less light, in linear sRGB.
fn darker(image: &RgbImage, ev: f64) -> RgbImage {
    let linear = |code: f64| {
        if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
    };
    let code = |light: f64| {
        if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
    };
    let mut dark = image.clone();
    for sample in dark.iter_mut() {
        let light = linear(f64::from(*sample) / 255.0) * (-ev).exp2();
        *sample = (255.0 * code(light).min(1.0)).round() as u8;
    }
    dark
}

/// Questions of all scenes about frames with these names.
fn questions(name: impl Fn(u32) -> String) -> String {
    let line = |number| {
        let question = json!({
            "id": format!("q{number}"), "frame": name(number), "family": "color", "question": "What color is it?",
            "choices": ["red", "blue", "brown"], "answer": "brown",
        });
        format!("{question}\n")
    };
    (0..SCENES).map(line).collect()
}

/// A folder `set` of frames whose photographs in the dark are these of `dark`, by scene; with extra keys in each line.
fn with_photographs(dark: impl Fn(u32) -> RgbImage, extra: &str) -> Bench {
    let bench = Bench::new();
    bench.file("set/questions.jsonl", questions(|number| format!("room{number}/0")));
    fs::create_dir_all(bench.path("set/low")).unwrap();
    let mut lines = String::new();
    for number in 0..SCENES {
        scene(number).save(bench.path(&format!("set/{number}.png"))).unwrap();
        dark(number).save(bench.path(&format!("set/low/{number}.png"))).unwrap();
        let extra = extra.replace("{}", &number.to_string());
        let line = format!("{{\"scene\":\"room{number}\",\"frame\":\"0\",\"rgb\":\"{number}.png\"{extra}}}\n");
        lines.push_str(&line);
    }
    bench.file("set/frames.jsonl", lines);
    bench
}

const DARK: &str = ",\"dark\":\"low/{}.png\"";

/// Right replies, except to the first questions in these conditions.
fn script(bench: &Bench, wrong: &[(&str, u32)]) {
    let mut lines = "{\"default\":\"brown\"}\n".to_owned();
    for (condition, count) in wrong {
        for number in 0..*count {
            let line = json!({"question": format!("q{number}"), "condition": condition, "reply": "red"});
            lines.push_str(&line.to_string());
            lines.push('\n');
        }
    }
    bench.file("script.jsonl", lines);
}

/// A row of a table of a run as a map from heads to cells.
fn rows(bench: &Bench, file: &str) -> Vec<Value> {
    let mut reader = csv::Reader::from_path(bench.path(file)).unwrap();
    let rows = reader.deserialize::<std::collections::BTreeMap<String, String>>();
    rows.map(|row| json!(row.unwrap())).collect()
}

fn run(bench: &Bench, more: &str) -> String {
    let args = format!("--data set --model script:script.jsonl --out run --full {more}");
    bench.complete(&words(&args))
}

/// Whether a cell is this number.
fn is(row: &Value, field: &str, expected: f64) -> bool {
    (number(row, field) - expected).abs() < 1e-9
}

fn number(row: &Value, field: &str) -> f64 {
    row[field].as_str().unwrap().parse().unwrap()
}

#[test]
fn photographs_are_a_separate_condition() {
    let bench = with_photographs(|number| darker(&scene(number), 3.6), DARK);
    script(&bench, &[("dark", 6), ("dark+lift", 2), ("L2-ev", 5), ("L2-noise", 7)]);
    let table = run(&bench, "--levels L0,L2 --llie lift --llie-on dark,noise");
    insta::assert_snapshot!(lines_with(&table, "(real"), @"
    script:script.jsonl   dark (real, 3.6 EV)                          50.0   12          0        0   −24.6
       +24.6
    script:script.jsonl   dark (real, 3.6 EV) + lift                   83.3   12          0        0   −28.1
       +12.0
    ");
    assert!(table.contains("Photographed in the dark"), "{table}");
    let all = records(&bench.path("run"));
    let of =
        |condition: &str| -> Vec<&Value> { all.iter().filter(|record| record["condition"] == condition).collect() };
    for condition in ["L0", "L2-ev", "L2-noise", "L2-noise+lift", "dark", "dark+lift"] {
        assert_eq!(of(condition).len(), SCENES as usize, "{condition}");
    }
    assert!(of("L0+lift").is_empty() && of("L2-ev+lift").is_empty());
    let dark = of("dark")[0];
    assert_eq!((&dark["level"], &dark["variant"], &dark["ev"]), (&json!("dark"), &json!("dark"), &Value::Null));
    let pair = &dark["image"]["pair"];
    assert!((pair["mean"].as_f64().unwrap() - 3.6).abs() < 0.05, "{pair}");
    let rows = rows(&bench, "run/comparisons.csv");
    let compared = |kind: &str| -> Vec<&Value> {
        rows.iter().filter(|row| row["kind"] == kind && row["family"] == "all" && row["mode"] == "strict").collect()
    };
    // The nearest level is compared where none is matched.
    let synthetic = compared("real-synthetic");
    let against: Vec<&str> = synthetic.iter().map(|row| row["against_condition"].as_str().unwrap()).collect();
    assert_eq!(against, ["L2-ev", "L2-noise", "L2-noise+lift"], "{synthetic:?}");
    assert!((number(synthetic[0], "difference") + 1.0 / 12.0).abs() < 1e-9);
    assert!((number(synthetic[1], "difference") - 1.0 / 12.0).abs() < 1e-9);
    let enhanced = compared("real-enhanced");
    assert_eq!(enhanced.len(), 1);
    assert!((number(enhanced[0], "difference") - 4.0 / 12.0).abs() < 1e-9);
    assert_eq!((number(enhanced[0], "only_first"), number(enhanced[0], "only_second")), (4.0, 0.0));
    assert!(compared("enhancer").iter().all(|row| row["condition"] == "L2-noise+lift"));
    let dark = compared("level");
    assert!(dark.iter().any(|row| row["condition"] == "dark" && is(row, "difference", -0.5)));
    let curves = fs::read_to_string(bench.path("run/thresholds.csv")).unwrap();
    let curves: Vec<&str> = curves.lines().skip(1).collect();
    assert!(!curves.is_empty() && curves.iter().all(|line| !line.contains("dark")), "{curves:?}");
    let figure = fs::read_to_string(bench.path("run/figures/accuracy.svg")).unwrap();
    assert!(figure.contains("dark (real)"), "no mark in the legend");
    let pairs = self::rows(&bench, "run/pairs.csv");
    assert!((number(&pairs[0], "ev") - 3.6).abs() < 0.05, "{pairs:?}");
    // The light, the photograph, what is as dark, and the photograph enhanced, each once.
    let figure = fs::read_to_string(bench.path("run/figures/real.svg")).unwrap();
    for name in ["L0", "dark", "dark+lift"] {
        let named = format!(">{name}</text>");
        assert!(figure.contains(&named), "{name}: {figure}");
    }
}

#[test]
fn photograph_bytes_are_sent_unchanged() {
    let bench = with_photographs(|number| darker(&scene(number), 3.0), DARK);
    let endpoint = MockEndpoint::start([Answer::text("C")]);
    let base = endpoint.base_url();
    let args = model_args(&base, "--data set --levels L0 --out run");
    bench.complete(&args);
    let records = records(&bench.path("run"));
    for record in records.iter().filter(|record| record["condition"] == "dark") {
        let number: u32 = record["question"].as_str().unwrap()[1..].parse().unwrap();
        let file = fs::read(bench.path(&format!("set/low/{number}.png"))).unwrap();
        let digest = blake3::hash(&file).to_hex().to_string();
        assert_eq!(record["image"]["digest"], digest, "{record}");
        assert_eq!(record["image"]["bytes"], file.len());
    }
    // A resumed run asks nothing again, and the images are made again byte by byte.
    let asked = endpoint.requests().len();
    bench.complete(&args);
    assert_eq!(endpoint.requests().len(), asked);
    let shown = bench.complete(&words("show run q3 --condition dark --out shown"));
    insta::assert_snapshot!(redacted(&shown), @r#"
    q3, about room3/0
    What color is it?
      A. red
      B. blue
      C. brown  (true)
    dark: shown/room3/0_dark.png
    dark: the same bytes as were sent ([DIGEST])
      m: ✓ right: "C"
    "#);
    // A photograph that was changed since is told.
    scene(5).save(bench.path("set/low/3.png")).unwrap();
    let changed = bench.call(&words("show run q3 --condition dark --out shown"));
    insta::assert_snapshot!(changed, @r#"
    exit code: 1
    stdout:
    q3, about room3/0
    What color is it?
      A. red
      B. blue
      C. brown  (true)
    dark: shown/room3/0_dark.png
    dark: NOT the bytes that were sent: [DIGEST] now
      m: ✓ right: "C"
    the data, an enhancement model or this program has changed since the run
    "#);
}

#[test]
fn shards_merge_into_the_same_products() {
    let bench = with_photographs(|number| darker(&scene(number), 4.0), DARK);
    script(&bench, &[("dark", 4), ("match-ev", 3)]);
    let flags = "--data set --model script:script.jsonl --levels L0,match";
    bench.complete(&words(&format!("{flags} --out whole")));
    for part in ["1/2", "2/2"] {
        bench.complete(&words(&format!("{flags} --out part-{} --shard {part}", &part[..1])));
    }
    bench.complete(&words("merge part-1 part-2 --out merged"));
    assert!(assert_same_products(&bench.path("whole"), &bench.path("merged")) > 3);
    bench.complete(&words("report whole merged"));
    bench.complete(&words("report whole --rescore"));
}

#[test]
fn match_uses_brightness_of_each_photograph() {
    let ev = |number| 2.0 + 0.25 * f64::from(number);
    let bench = with_photographs(|number| darker(&scene(number), ev(number)), DARK);
    script(&bench, &[("dark", 6), ("match-ev", 6), ("match-noise", 9)]);
    let table = run(&bench, "--levels L0,match");
    let all = records(&bench.path("run"));
    let of = |condition: &'static str| all.iter().filter(move |record| record["condition"] == condition);
    assert_eq!((of("match-ev").count(), of("match-noise").count()), (12, 12));
    for record in of("match-ev") {
        let number: u32 = record["question"].as_str().unwrap()[1..].parse().unwrap();
        let measured = record["image"]["pair"]["mean"].as_f64().unwrap();
        assert!((measured - ev(number)).abs() < 0.06, "{record}");
    }
    let rows = rows(&bench, "run/comparisons.csv");
    let real: Vec<&Value> = rows
        .iter()
        .filter(|row| row["kind"] == "real-synthetic" && row["family"] == "all" && row["mode"] == "strict")
        .collect();
    assert_eq!(real.len(), 2, "{real:?}");
    assert_eq!((number(real[0], "difference"), number(real[0], "n")), (0.0, 12.0));
    assert!((number(real[1], "difference") - 0.25).abs() < 1e-9);
    let agreement = self::rows(&bench, "run/light_agreement.csv");
    assert_eq!(agreement[0]["against_condition"], "match-ev");
    assert!(is(&agreement[0], "same_answer", 1.0), "{table}");
    assert!(is(&agreement[1], "same_answer", 0.75));
    // Synthesis at the same exposure gives the same pixels as a level of that number would.
    let shown = bench.complete(&words("show run q4 --condition match-noise --out shown"));
    insta::assert_snapshot!(redacted(&shown), @r#"
    q4, about room4/0
    What color is it?
      A. red
      B. blue
      C. brown  (true)
    match-noise: shown/room4/0_match-noise.png
    match-noise: the same bytes as were sent ([DIGEST])
      script:script.jsonl: ✗ wrong: "red"
    "#);
}

#[test]
fn same_image_shows_no_difference() {
    let bench = with_photographs(scene, DARK);
    script(&bench, &[]);
    let called = bench.call(&words("--data set --model script:script.jsonl --levels L0 --out run --full"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN 12 of 12 photographs dark are not darker than their frames.
    ");
    let rows = rows(&bench, "run/comparisons.csv");
    let level = rows.iter().find(|row| row["kind"] == "level" && row["condition"] == "dark").unwrap();
    assert!(is(level, "difference", 0.0));
    assert!(is(&self::rows(&bench, "run/pairs.csv")[0], "ev", 0.0));
    // There is nothing to match.
    let matched = bench.call(&words("--data set --model random --levels L0,match --out other"));
    insta::assert_snapshot!(matched.messages(), @r#"
    exit code: 2
    error: --levels: match makes each frame as dark as its photograph, and no frame has one that is darker than
        it; leave out match, or name photographs as "dark" in frames.jsonl or with --pairs
    "#);
}

#[test]
fn odd_pairs_are_told() {
    let told = |dark: &dyn Fn(u32) -> RgbImage, extra: &str| -> Called {
        let bench = with_photographs(dark, extra);
        bench.call(&words("--data set --model random --levels L0 --out run"))
    };
    let swapped = told(&|number| darker(&scene(number), -1.0), DARK);
    insta::assert_snapshot!(swapped.messages(), @"
    exit code: 0
     WARN The photographs dark are brighter than their frames (-1.0 EV): were normal and low light swapped?
    ");
    insta::assert_snapshot!(swapped.lines_with("swapped"), @"
    exit code: 0
    low light swapped?
    WARN The photographs dark are brighter than their frames (-1.0 EV): were normal and low light swapped?
    ");
    let elsewhere = told(&|number| darker(&scene(number + 50), 3.0), DARK);
    insta::assert_snapshot!(elsewhere.messages(), @"
    exit code: 0
     WARN 2 of 12 photographs dark seem to show another scene than their frame, first that of room2/0
     WARN The photographs dark are 4.47 EV darker than their frames by the mean and 3.79 EV by the median of
        pixels: they are not one exposure apart, as with another light, a tone curve or synthesis of another kind.
    ");
    let fair = told(&|number| darker(&scene(number), 3.0), DARK);
    assert_eq!(fair.code, Some(0));
    for word in ["another scene", "swapped", "one exposure"] {
        assert!(!fair.stderr.contains(word), "{word}: {fair:?}");
    }
    let missing = told(&|number| darker(&scene(number), 3.0), ",\"dark\":\"low/{}.jpg\"");
    insta::assert_snapshot!(missing.messages(), @"
    exit code: 2
    error: set/frames.jsonl, line 1: no such file: set/low/0.jpg
    ");
    let stated = told(
        &|number| darker(&scene(number), 3.0),
        ",\"dark\":[{\"path\":\"low/{}.png\",\"ev\":7.5,\"name\":\"lamp\"}]",
    );
    insta::assert_snapshot!(stated.lines_with("(real"), @"
    exit code: 0
    lamp (real, 7.5 EV)  16.7   16.7   −12.0 +28.1
    ");
}

#[test]
fn two_folders_pair_by_file_name() {
    let bench = Bench::new();
    for folder in ["normal", "low"] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    for number in 0..SCENES {
        scene(number).save(bench.path(&format!("normal/{number}.png"))).unwrap();
        darker(&scene(number), 3.0).save(bench.path(&format!("low/{number}.png"))).unwrap();
    }
    scene(3).save(bench.path("low/alone.png")).unwrap();
    bench.file("q.jsonl", questions(|number| format!("{number}.png")));
    script(&bench, &[("dark", 4)]);
    let flags = "--model script:script.jsonl --levels L0 --out run --full";
    let called = bench.call(&words(&format!("--pairs normal,low --questions q.jsonl {flags}")));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN --data: no effect: --pairs names the data
     WARN images without a partner in the other light, which are not asked: 1, first low/alone.png
    ");
    insta::assert_snapshot!(called.lines_with("(real"), @"
    exit code: 0
    script:script.jsonl   dark (real, 3.0 EV)           66.7   12          0        0   −27.6 +19.5
    ");
    let shown = bench.complete(&words("show run q2 --condition dark --out shown"));
    insta::assert_snapshot!(redacted(&shown), @r#"
    q2, about 2.png
    What color is it?
      A. red
      B. blue
      C. brown  (true)
    dark: shown/2_dark.png
    dark: the same bytes as were sent ([DIGEST])
      script:script.jsonl: ✗ wrong: "red"
    "#);
    let bare = bench.call(&words("--pairs normal,low --model random --out other"));
    insta::assert_snapshot!(bare.messages(), @"
    exit code: 2
     WARN --data: no effect: --pairs names the data
     WARN images without a partner in the other light, which are not asked: 1, first low/alone.png
    error: --pairs: pairs of photographs have no questions; --questions FILE names some about the files in normal
        light
    ");
}

#[test]
fn dark_set_is_asked_with_enhancement() {
    let bench = Bench::new();
    fs::create_dir_all(bench.path("set")).unwrap();
    for number in 0..SCENES {
        darker(&scene(number), 4.0).save(bench.path(&format!("set/{number}.png"))).unwrap();
    }
    bench.file("set/questions.jsonl", questions(|number| format!("{number}.png")));
    bench.file("set/dataset.json", "{\"schema\":\"darkqa.dataset/1\",\"light\":\"dark\"}");
    script(&bench, &[("L0", 6), ("L0+lift", 3)]);
    let table = run(&bench, "--llie lift");
    let conditions: std::collections::BTreeSet<String> =
        records(&bench.path("run")).iter().map(|record| record["condition"].as_str().unwrap().to_owned()).collect();
    assert_eq!(Vec::from_iter(conditions), ["L0", "L0+lift"]);
    insta::assert_snapshot!(lines_with(&table, "as photographed"), @"
    ! These photographs were taken in the dark (--light dark): L0 is each as photographed, there is no image in
        the light to compare with, and no darkness threshold. Their mean linear brightness is 0.0141 of 1
        (measured on 12); a mid-grey, code 128, is 0.22.
     model                 light                    as photographed    n   unparsed   failed   95 %
     script:script.jsonl   as photographed                     50.0   12          0        0   −24.6 +24.6
     script:script.jsonl   as photographed + lift              75.0   12          0        0   −28.2 +16.1
    ");
    insta::assert_snapshot!(lines_with(&table, "linear brightness"), @"
    ! These photographs were taken in the dark (--light dark): L0 is each as photographed, there is no image in
        the light to compare with, and no darkness threshold. Their mean linear brightness is 0.0141 of 1
        (measured on 12); a mid-grey, code 128, is 0.22.
    ");
    let svg = fs::read_to_string(bench.path("run/figures/photographed.svg")).unwrap();
    assert!(svg.contains("50.0") && svg.contains("75.0"), "bars");
    assert!(!bench.path("run/figures/accuracy.svg").exists());
    let agreement = rows(&bench, "run/light_agreement.csv");
    assert!(is(&agreement[0], "same_answer", 0.75));
    // Levels are darkened where they are named, and that is told.
    let called = bench.call(&words("--data set --model random --levels L0,L2 --out dark"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN the photographs were taken in the dark, and --levels darkens them further: their own noise is in them
        already, so a level is darker and noisier than its name says, and L0 is not an image in the light
    ");
    // The flag goes before the file.
    let lit = bench.call(&words("--data set --light lit --model random --out lit"));
    assert_eq!(records(&bench.path("lit")).len(), 12 * 11, "{lit:?}");
    bench.file("set/dataset.json", "{\"schema\":\"darkqa.dataset/1\",\"light\":\"dim\"}");
    let wrong = bench.call(&words("--data set --model random --out wrong"));
    insta::assert_snapshot!(wrong.messages(), @"
    exit code: 2
    error: set/dataset.json: unknown variant `dim`, expected `lit` or `dark` at line 1 column 42
    ");
}

#[test]
fn folders_of_classes_have_one_question() {
    let bench = Bench::new();
    for (place, class) in ["Bicycle", "Boat", "Cup", "Dog", "empty"].into_iter().enumerate() {
        fs::create_dir_all(bench.path(&format!("set/{class}"))).unwrap();
        for number in 0..3_u32 {
            if class != "empty" {
                let name = format!("set/{class}/{number}.png");
                scene(10 * place as u32 + number).save(bench.path(&name)).unwrap();
            }
        }
    }
    let asked = |more: &str, out: &str| {
        let mut args = words("--data set --light dark --model random --label-folders");
        args.push("Which of these is in the photograph?");
        args.extend(words(more));
        args.extend(["--out", out]);
        bench.call(&args)
    };
    let called = asked("", "all");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
     WARN set/empty: no images in it, so it is not a class
     WARN a photograph may show things of several of the 4 classes, and the folder names one of them: that name is
        the true choice; with boxes or tags, make questions instead
     WARN Folders suggest 4 scenes (Bicycle, Boat, …), but the data name none, so the 12 frames count as
        independent; a "scene" in each question (or --map scene=COLUMN) names them
    "#);

    let all = records(&bench.path("all"));
    assert_eq!(all.len(), 12);
    for record in &all {
        let frame = record["frame"].as_str().unwrap();
        let truth = &record["choices"][record["truth"].as_u64().unwrap() as usize];
        assert_eq!(record["choices"], json!(["Bicycle", "Boat", "Cup", "Dog"]));
        assert_eq!(truth, frame.split_once('/').unwrap().0);
    }
    asked("--choices 2", "two");
    for record in records(&bench.path("two")) {
        assert_eq!(record["choices"].as_array().unwrap().len(), 2, "{record}");
    }
    let many = asked("--choices 9", "nine");
    insta::assert_snapshot!(many.messages(), @"
    exit code: 2
     WARN set/empty: no images in it, so it is not a class
    error: --choices: set has only 4 classes; leave out --choices to offer them all
    ");
    let shown = bench.complete(&words("show all Cup/1.png --out shown"));
    insta::assert_snapshot!(redacted(&shown), @r#"
    Cup/1.png, about Cup/1.png
    Which of these is in the photograph?
      A. Bicycle
      B. Boat
      C. Cup  (true)
      D. Dog
    L0: shown/Cup/1_L0.png
    L0: the same bytes as were sent ([DIGEST])
      random: ✗ wrong: "B"
    "#);
}

#[test]
fn light_of_a_zip_file_is_read() {
    let bench = Bench::new();
    let mut image = Cursor::new(Vec::new());
    darker(&scene(1), 4.0).write_to(&mut image, image::ImageFormat::Png).unwrap();
    let question = json!({"question": "Is it red?", "choices": ["yes", "no"], "answer": 0, "image": "1.png"});
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [
        ("q.jsonl", question.to_string().as_bytes()),
        ("1.png", image.get_ref()),
        ("dataset.json", br#"{"schema": "darkqa.dataset/1", "light": "dark"}"#),
    ] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    bench.file("set.zip", zip.finish().unwrap().into_inner());
    for (flags, expected) in [("", 1), (" --light lit --levels L0,L3 --variant ev", 2)] {
        let line = format!("--data set.zip --model random --out run{expected}{flags}");
        bench.complete(&words(&line));
        let conditions: BTreeSet<String> = records(&bench.path(&format!("run{expected}")))
            .iter()
            .map(|record| record["condition"].to_string())
            .collect();
        assert_eq!(conditions.len(), expected, "{conditions:?}");
    }
}
