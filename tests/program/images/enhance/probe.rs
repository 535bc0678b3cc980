//! Models whose images are implausible: in an evaluation, and examined by `enhance doctor`.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::onnx::{self, Graph};
use crate::support::run::{Bench, Called, words};
use crate::support::snapshot::on_one_line;

/// An evaluation of the rooms with the enhancer `model.onnx`.
const ASK: &str = "--model random --data rooms --levels L3 --limit 9 --out run";

const UNIT: [f32; 2] = [0.0, 1.0];
const BYTES: [f32; 2] = [0.0, 255.0];
const SIGNED: [f32; 2] = [-1.0, 1.0];

/// A bench with three rooms and a model, and with a sidecar if it is not empty.
fn bench(graph: &Graph, sidecar: &str) -> Bench {
    let bench = Bench::new();
    bench.rooms("rooms", 3, "144x96");
    graph.write(&bench.path(""), "model.onnx");
    if !sidecar.is_empty() {
        bench.file("model.onnx.toml", sidecar);
    }
    bench
}

fn ask(bench: &Bench, flags: &str) -> Called {
    bench.call(&words(&format!("{ASK} --llie model.onnx {flags}")))
}

fn manifest(bench: &Bench) -> Value {
    let text = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The value and the source of a statement about the enhancer.
fn stated(manifest: &Value, key: &str) -> (String, String) {
    let lines = manifest["enhancers"]["model"]["convention"].as_array();
    let line = lines.unwrap().iter().find(|line| line["key"] == key);
    let text = |field: &str| line.unwrap()[field].as_str().unwrap().to_owned();
    (text("value"), text("source"))
}

#[test]
fn correct_model_confirms_its_ranges() {
    let bench = bench(&onnx::enhancer_in_ranges(UNIT, UNIT), "");
    let called = ask(&bench, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let manifest = manifest(&bench);
    assert_eq!(stated(&manifest, "range_in"), ("0..1".to_owned(), "assumed".to_owned()));
    let note = &manifest["enhancers"]["model"];
    assert_eq!(note["probe"]["outcome"], "plausible");
    assert!(note["judged"]["images"].as_u64().unwrap() > 0, "{note}");
    assert!(note["judged"]["flawed"].is_null(), "{note}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("fed 0..1 (assumed)"), "the page says how");
    assert!(page.contains("model: 0..1 assumed."), "the page warns");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
     WARN model: value ranges of 0..1 in and 0..1 out assumed, because nothing sets them; its images of dark
        frames are plausible. To confirm, add to model.onnx.toml next to it: `range_in = "0..1"` and `range_out =
        "0..1"`
    "#);
}

#[test]
fn wrong_ranges_name_the_fix() {
    for (input, output, lines) in [
        (SIGNED, SIGNED, ["-1..1", "-1..1"]),
        (BYTES, UNIT, ["0..255", "0..1"]),
        (UNIT, BYTES, ["0..1", "0..255"]),
        (BYTES, BYTES, ["0..255", "0..255"]),
        (UNIT, SIGNED, ["0..1", "-1..1"]),
    ] {
        let graph = onnx::enhancer_in_ranges(input, output);
        let unstated = bench(&graph, "");
        let called = ask(&unstated, "");
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(
            !unstated.path("run/records.jsonl").exists() || {
                let records = fs::read_to_string(unstated.path("run/records.jsonl")).unwrap();
                records.is_empty()
            }
        );
        let [range_in, range_out] = lines;
        let sidecar = format!("range_in = \"{range_in}\"\nrange_out = \"{range_out}\"\n");
        for line in sidecar.lines() {
            assert!(called.stderr.contains(line), "{line}: {called:?}");
        }
        // The proposed lines mend it.
        let stated = bench(&graph, &sidecar);
        let called = ask(&stated, "");
        assert_eq!(called.code, Some(0), "{called:?}");
    }
}

#[test]
fn impossible_enhancement_stops_the_run() {
    for (graph, seen) in [
        (onnx::blue_first(), "blue where the frames are red"),
        (onnx::negative(), "bright where the frames are dark"),
        (onnx::flat(), "are flat"),
        (onnx::mislabelled(), "edges that are not those of the frames"),
    ] {
        let bench = bench(&graph, "");
        let called = ask(&bench, "");
        assert_eq!(called.code, Some(2), "{seen}: {called:?}");
        assert!(called.stderr.contains(seen), "{seen}: {called:?}");
        assert!(called.stderr.contains("--allow bad-enhancer"), "{called:?}");
        // It is not asked about, but it can be.
        let called = ask(&bench, "--allow bad-enhancer");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(called.stdout.contains("because of --allow bad-enhancer"), "{called:?}");
        let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
        assert!(page.contains("because of --allow bad-enhancer"));
        assert_eq!(manifest(&bench)["enhancers"]["model"]["probe"]["outcome"], "overruled");
    }
}

#[test]
fn export_refuses_bad_enhancer() {
    let bench = bench(&onnx::negative(), "");
    let line = "export llava rooms --out sets --llie model.onnx --levels L3 --limit 3";
    let called = bench.call(&words(line));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: model.onnx: on 3 of 3 dark frames its images are bright where the frames are dark (rank correlation
        -1.00). Its output may not be the image itself; add to model.onnx.toml next to it the line that the
        model's code uses: `image = "1 - output"` (if it is the negative). `darkqa-eval enhance doctor model.onnx
        IMAGES… --out DIR` tries each value range and colour order; --allow bad-enhancer uses it anyway
    "#);
    bench.complete(&words(&format!("{line} --llie-anyway")));
}

#[test]
fn odd_outputs_are_named() {
    for (graph, part) in [
        (onnx::noisy(), "draws random numbers (RandomNormalLike)"),
        (onnx::residual(), "`image = \"input + output\"`"),
        (onnx::light_map(), "`image = \"clip(input / max(output, 0.001), 0, 1)\"`"),
        (onnx::light_beside(), "and \"L\" of the same size is not"),
    ] {
        let bench = bench(&graph, "");
        let called = ask(&bench, "");
        assert_eq!(called.code, Some(0), "{part}: {called:?}");
        assert!(called.stderr.contains(part), "{part}: {called:?}");
        assert_eq!(manifest(&bench)["enhancers"]["model"]["remarks"].as_array().map(Vec::len), Some(1));
    }
}

#[test]
fn a_normalised_input_is_found() {
    let graph = onnx::normalised([0.485, 0.456, 0.406], [0.229, 0.224, 0.225]);
    let bench = bench(&graph, "");
    let called = ask(&bench, "");
    assert_eq!(called.code, Some(2), "{called:?}");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: model.onnx: on 6 of 6 dark frames its images are flat (brightness varies by 0.6 of 255). With 0..1 with
        the mean and std of ImageNet in and 0..1 out (black becomes 0 of 255, white 255) they are plausible; if
        the model's code uses these, add to model.onnx.toml next to it: `mean = [0.485, 0.456, 0.406]` and `std =
        [0.229, 0.224, 0.225]` and `range_out = "0..1"`. `darkqa-eval enhance doctor model.onnx IMAGES… --out DIR`
        tries each value range and colour order; --allow bad-enhancer uses it anyway
    "#);
    let stated = self::bench(&graph, "mean = [0.485, 0.456, 0.406]\nstd = [0.229, 0.224, 0.225]\n");
    let called = ask(&stated, "");
    assert_eq!(called.code, Some(0), "{called:?}");
}

#[test]
fn an_output_normalised_like_the_stated_input_is_found() {
    for [mean, std] in [[[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]], [[0.4, 0.3, 0.3], [0.2, 0.25, 0.2]]] {
        let graph = onnx::normalised_at_both_ends(mean, std);
        let stated = format!("mean = {mean:?}\nstd = {std:?}\n");
        let called = ask(&bench(&graph, &stated), "");
        assert_eq!(called.code, Some(2), "{called:?}");
        let message = on_one_line(&called.stderr);
        let lines = format!("{stated}mean_out = {mean:?}\nstd_out = {std:?}\n");
        for line in lines.lines() {
            assert!(message.contains(&format!("`{line}`")), "{line}: {message}");
        }
        // The proposed lines mend it.
        let called = ask(&bench(&graph, &lines), "");
        assert_eq!(called.code, Some(0), "{called:?}");
    }
}

#[test]
fn black_and_white_reveal_mixed_ranges() {
    let centred = [-0.5, 0.5];
    let clip = [[0.481_454_66, 0.457_827_5, 0.408_210_73], [0.268_629_54, 0.261_302_6, 0.275_777_1]];
    for (graph, lines) in [
        (
            onnx::enhancer_in_ranges(UNIT, centred),
            "range_in = \"0..1\"\nmean_out = [0.5, 0.5, 0.5]\nstd_out = [1.0, 1.0, 1.0]",
        ),
        (
            onnx::enhancer_in_ranges(BYTES, centred),
            "range_in = \"0..255\"\nmean_out = [0.5, 0.5, 0.5]\nstd_out = [1.0, 1.0, 1.0]",
        ),
        (
            onnx::enhancer_in_ranges(centred, SIGNED),
            "mean = [0.5, 0.5, 0.5]\nstd = [1.0, 1.0, 1.0]\nrange_out = \"-1..1\"",
        ),
        (
            onnx::normalised(clip[0], clip[1]),
            "mean = [0.48145467, 0.4578275, 0.40821072]\nstd = [0.26862955, 0.2613026, 0.2757771]\nrange_out = \"0..1\"",
        ),
    ] {
        advised(&graph, lines);
    }
}

#[test]
fn expressions_of_the_input_are_advised() {
    for (graph, line) in [
        (onnx::negative(), "image = \"1 - output\""),
        (onnx::subtracted(), "image = \"input - output\""),
        (onnx::gain_map(), "image = \"input * output\""),
    ] {
        advised(&graph, line);
    }
}

/// Checks that a model is refused with these lines of a sidecar, and evaluated with them.
fn advised(graph: &Graph, lines: &str) {
    let unstated = bench(graph, "");
    let called = ask(&unstated, "");
    assert_eq!(called.code, Some(2), "{lines}: {called:?}");
    for line in lines.lines() {
        assert!(called.stderr.contains(&format!("`{line}`")), "{line}: {called:?}");
    }
    let stated = bench(graph, lines);
    let called = ask(&stated, "");
    assert_eq!(called.code, Some(0), "{lines}: {called:?}");
}

#[test]
fn images_without_colour_are_refused() {
    let bench = bench(&onnx::colourless(), "");
    let called = ask(&bench, "");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: model.onnx: on 6 of 6 dark frames its images have no colour, unlike the frames (channels differ by 0.0
        of 255). Its output may not be the image itself; add to model.onnx.toml next to it the line that the
        model's code uses: `image = "input / max(output, 0.001)"` (if it is a light map); if it is the enhanced
        luma, export it joined with the colours. `darkqa-eval enhance doctor model.onnx IMAGES… --out DIR` tries
        each value range and colour order; --allow bad-enhancer uses it anyway
    "#);
}

#[test]
fn a_wrong_statement_is_found_too() {
    let right =
        "model.onnx.toml next to it, replacing the present values: `range_in = \"0..1\"` and `range_out = \"0..1\"`";
    for wrong in [
        "range_in = \"-1..1\"\nrange_out = \"-1..1\"\n",
        "range_in = \"0..255\"\nrange_out = \"0..255\"\n",
        // One range alone: the other is looked for, and cannot explain the images.
        "range_out = \"0..255\"",
    ] {
        let bench = bench(&onnx::enhancer_in_ranges(UNIT, UNIT), wrong);
        let called = ask(&bench, "");
        assert_eq!(called.code, Some(2), "{wrong}: {called:?}");
        assert!(called.stderr.contains(right), "{wrong}: {called:?}");
        bench.call(&words("enhance --doctor model.onnx rooms --out doctor"));
        let page = fs::read_to_string(bench.path("doctor/doctor.html")).unwrap();
        assert!(page.contains(" out, as set"), "{wrong}");
    }
}

#[test]
fn idle_model_needs_stated_ranges() {
    let unstated = bench(&onnx::identity(), "");
    let called = ask(&unstated, "");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: model.onnx: on 6 of 6 dark frames its images are not brighter than the dark frames (mean brightness
        +0.0 of 255). If its images should be this dim, add to model.onnx.toml next to it: `range_in = "0..1"` and
        `range_out = "0..1"`. `darkqa-eval enhance doctor model.onnx IMAGES… --out DIR` tries each value range and
        colour order; --allow bad-enhancer uses it anyway
    "#);
    let stated = bench(&onnx::identity(), "range_in = \"0..1\"\nrange_out = \"0..1\"");
    let called = ask(&stated, "");
    insta::assert_snapshot!(called.lines_with("not brighter"), @"
    exit code: 0
    are not brighter than the dark frames (mean brightness +0.0 of 255).
    WARN model: on 6 of 6 dark frames its images are not brighter than the dark frames (mean brightness +0.0 of
        255)
    ");
}

/// With red and blue swapped, several ranges are plausible: the stated ones are kept.
#[test]
fn doctor_finds_wrong_colour_order() {
    let bench = Bench::new();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    fs::copy(models.join("lift.onnx"), bench.path("model.onnx")).unwrap();
    let right = fs::read_to_string(models.join("lift.onnx.toml")).unwrap();
    bench.file("model.onnx.toml", right + "\ncolor_out = \"bgr\"\n");
    bench.rooms("rooms", 6, "144x96");
    let called = bench.call(&words("enhance model.onnx rooms --out enhanced"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: model.onnx: on 4 of 6 dark frames its images are blue where the frames are red (cosine -0.97). With
        0..1 in and 0..1 out and RGB in the output its images are plausible; or with it in the input: `color =
        "rgb"` and the other order for `color_out`. If the model's code does that, add to model.onnx.toml next to
        it, replacing the present values: `color_out = "rgb"`. `darkqa-eval enhance doctor model.onnx IMAGES…
        --out DIR` tries each value range and colour order; --allow bad-enhancer uses it anyway
    "#);
    let called = bench.call(&words("enhance --doctor model.onnx rooms --out doctor"));
    assert_eq!(called.code, Some(0), "{called:?}");
    let page = fs::read_to_string(bench.path("doctor/doctor.html")).unwrap();
    assert!(page.contains("as set") && page.contains("RGB in the output"));
    assert!(called.stdout.contains("color_out = \"rgb\"") && !called.stdout.contains("range_in = "), "{called:?}");
}

#[test]
fn doctor_proposes_sidecar_that_mends_model() {
    for (graph, settled) in [
        (onnx::enhancer_in_ranges(SIGNED, SIGNED), true),
        (onnx::enhancer_in_ranges(BYTES, UNIT), true),
        (onnx::enhancer_in_ranges(UNIT, BYTES), true),
        (onnx::blue_first(), true),
        (onnx::negative(), false),
        (onnx::gain(4.0), false),
    ] {
        let bench = bench(&graph, "");
        let line = "enhance --doctor model.onnx rooms --out doctor --write";
        let called = bench.call(&words(line));
        assert_eq!(called.code, Some(i32::from(!settled)), "{called:?}");
        let page = fs::read_to_string(bench.path("doctor/doctor.html")).unwrap();
        assert!(page.contains("base64,") && page.contains(" in and "));
        assert!(bench.path("doctor/doctor.png").exists());
        assert_eq!(bench.path("model.onnx.toml").exists(), settled, "{called:?}");
        if settled && page.contains("range_out = ") {
            // What a run would use stays on the page, beside what is plausible.
            let wrong = "range_in = \"0..255\"\nrange_out = \"-1..1\"\n";
            let proposed = fs::read_to_string(bench.path("model.onnx.toml")).unwrap();
            bench.file("model.onnx.toml", wrong);
            bench.call(&words("enhance --doctor model.onnx rooms --out wrong"));
            let page = fs::read_to_string(bench.path("wrong/doctor.html")).unwrap();
            assert!(page.contains("0..255 in and -1..1 out, as set"));
            bench.file("model.onnx.toml", proposed);
        }
        if settled {
            let called = ask(&bench, "");
            assert_eq!(called.code, Some(0), "{called:?}");
            // What is stated needs no other line.
            let again = bench.call(&words(line));
            assert_eq!(again.code, Some(0), "{again:?}");
            assert!(again.stdout.contains("not written, because no line is proposed"), "{again:?}");
            // A sidecar is never replaced.
            bench.file("model.onnx.toml", "# mine");
            let again = bench.call(&words(line));
            assert_eq!(again.code, Some(2), "{again:?}");
            assert!(again.stderr.contains("never replaced"), "{again:?}");
        }
    }
}

#[test]
fn doctor_names_sizes_that_fail() {
    let bench = Bench::new();
    bench.rooms("rooms", 2, "64x48");
    onnx::halved().write(&bench.path(""), "halved.onnx");
    onnx::of_size(&onnx::mean_added(), 1, [32, 32]).write(&bench.path(""), "fixed.onnx");
    let called = bench.call(&words("enhance doctor halved.onnx rooms --out doctor"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: halved.onnx: gave an image of 32 × 24 for one of 64 × 48, but both must have the same size: it makes
        the image smaller; export it with the upsampling to the size of the input. The multiples 4, 8, 12, 14, 16,
        20, 24, 28, 32, 40, 48, 56, 64, 96, 112, 128 fail, too
    ");
    let called = bench.call(&words("enhance doctor fixed.onnx rooms --out doctor"));
    assert_eq!(called.code, Some(1));
    insta::assert_snapshot!(called.stdout, @r#"
    With 0..1 in and 0..1 out its images are plausible; a run assumes these usual ranges and warns. They are with 0..255 in and 0..255 out, too; compare the page with the model's own examples. But not all images can be enhanced: fixed.onnx: takes only images of 32 × 32, but the image has 64 × 48; padding or tiling would change it, because a pixel depends on others 16 pixels away, which is more than a quarter of the size. Export it for any size: `torch.onnx.export(..., input_names=["input"], output_names=["output"], dynamic_axes={"input": {2: "h", 3: "w"}, "output": {2: "h", 3: "w"}})`, or for images of 64 × 48; or resize each image and back with --llie-options resize, which blurs it and changes its brightness by some codes of 255
    page: doctor/doctor.html
    picture: doctor/doctor.png
    "#);
}

#[test]
fn enhance_prints_adapted_sizes() {
    let bench = Bench::new();
    bench.rooms("rooms", 2, "64x48");
    let graph = onnx::enhancer_in_ranges(UNIT, UNIT);
    onnx::of_size(&graph, 1, [32, 32]).write(&bench.path(""), "fixed.onnx");
    bench.file("fixed.onnx.toml", "range_in = \"0..1\"\nrange_out = \"0..1\"\n");
    // Times differ from call to call.
    let without_latency = |called: Called| {
        let (rest, latency) = called.stdout.split_once("latency: 64 × 48: ").unwrap();
        assert!(latency.contains(" ms per image (median of 1 image; 95 % within "), "{latency}");
        rest.to_owned()
    };
    let called = bench.call(&words("enhance fixed.onnx rooms --out tiles"));
    insta::assert_snapshot!(without_latency(called), @"
    tiles: 2 made by fixed
    2 images: in tiles of 32 × 32 with 8 px context (no difference at seams)
    ");
    let called = bench.call(&words("enhance fixed.onnx rooms --out resized --llie-options resize"));
    insta::assert_snapshot!(without_latency(called), @"
    resized: 2 made by fixed
    2 images: resized to 32 × 32 and back
    ");
}

/// A gain that suits L3 burns L1 out.
#[test]
fn burnt_out_images_are_named() {
    let sidecar = "range_in = \"0..1\"\nrange_out = \"0..1\"\n";
    let bench = bench(&onnx::gain(5.0), sidecar);
    let rooms: Vec<String> = ["L1", "L3"]
        .into_iter()
        .map(|level| {
            let line = format!("synthesize rooms --levels {level} --variant ev --out {level}");
            bench.complete(&words(&line));
            let folders = fs::read_dir(bench.path(level)).unwrap();
            let folders = folders.map(|folder| folder.unwrap().path().display().to_string());
            // The images of the rooms have the same name.
            folders.min().unwrap()
        })
        .collect();
    let enhance = |model: &str, images: &str, out: &str| {
        let called = bench.call(&words(&format!("enhance {model} {images} --out {out}")));
        called.ended(0).stderr
    };
    let said = enhance("model.onnx", &rooms[0], "bright");
    assert!(said.contains("model: 1 of 1 image is burnt out"), "{said}");
    assert_eq!(enhance("model.onnx", &rooms[1], "dark"), "");
    assert_eq!(enhance("lift", &rooms[0], "lifted"), "");
    let doctor = bench.call(&words("enhance doctor model.onnx rooms --out doctor"));
    let said =
        "Brighter images are burnt out, with codes of 254 or 255 where the dark ones have detail: 3 of 3 as they are";
    assert!(doctor.stdout.contains(said), "{doctor:?}");
    let doctor = bench.call(&words("enhance doctor lift rooms --out doctor"));
    assert!(!doctor.stdout.contains("burnt"), "{doctor:?}");

    let line = "--model random --data rooms --levels L1,L3 --variant ev --limit 9 --llie model.onnx --llie lift --llie-on ev --out run";
    let called = bench.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let manifest = manifest(&bench);
    let burnt = manifest["enhancers"]["model"]["burnt_out"].as_object().unwrap();
    assert_eq!(burnt.keys().collect::<Vec<_>>(), ["L1-ev+model"]);
    assert_eq!(manifest["enhancers"]["lift"].get("burnt_out"), None);
    let report = bench.call(&words("report run --full"));
    assert!(report.stdout.contains("! model: images are burnt out"), "{report:?}");
    assert!(!report.stdout.contains("! lift: images"), "{report:?}");
}
