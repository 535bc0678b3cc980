//! Sidecars and presets: what a graph does not say about its inputs and outputs.

use std::path::PathBuf;

use darkqa_base::types::Rgb;
use darkqa_enhance::ModelFile;

use super::{fault, image, loaded, map, open, stated};
use crate::support::onnx;
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

#[test]
fn sidecar_says_which_output_it_is() {
    let graph = onnx::two_outputs();
    insta::assert_snapshot!(redacted(&fault(&graph)), @r#"
    [TMP]/model.onnx: has several outputs that could be the image: "17" (float32 [1, 3, height, width]), "18"
        (float32 [1, 3, height, width]); add to model.onnx.toml next to it: `output = "NAME"` or `output = INDEX`
        (from 0); presets with such outputs: darkir, sci, zero-dce++ (--llie PRESET:FILE); `darkqa-eval enhance
        doctor` shows which are plausible
    "#);
    let folder = tempfile::tempdir().unwrap();
    let path = graph.write(folder.path(), "model.onnx");
    let sidecar = folder.path().join("model.onnx.toml");
    let image = image(8, 8);
    check_rows(["output = 1", "output = \"18\""], |text| {
        std::fs::write(&sidecar, text).unwrap();
        let enhanced = open(&path).unwrap().enhance(&image).unwrap();
        assert_eq!(enhanced, map(&image, |x| 2.0 * x));
    });
    std::fs::write(&sidecar, "output = 1\nlayout_in = \"nhwc\"").unwrap();
    let message = open(&path).err().unwrap().to_string();
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "input" (float32 [1, 3, height, width]), which does not fit `layout_in` in
        model.onnx.toml or the preset; correct or delete that line
    "#);
}

#[test]
fn sidecar_says_what_graph_cannot() {
    let image = image(12, 20);
    let rows = [
        (onnx::identity(), "range_in = \"0..255\"\nrange_out = \"0..255\""),
        (onnx::identity(), "range_in = \"-1..1\"\nrange_out = \"-1..1\"\ncolor = \"bgr\""),
        (onnx::ranged(0.0, 255.0), "range_out = \"0..255\""),
        (onnx::ranged(-1.0, 1.0), "range_out = \"-1..1\""),
        (onnx::ranged(0.5, 1.0), "mean = [0.5, 0.5, 0.5]\nstd = [0.5, 0.5, 0.5]"),
        (onnx::two_inputs(), "[extra]\nexposure = 1"),
    ];
    check_rows(rows, |(graph, sidecar)| {
        let (_folder, mut enhancer) = stated(&graph, sidecar);
        assert_eq!(enhancer.enhance(&image).unwrap(), image, "{sidecar}");
        assert!(enhancer.describe().contains("sidecar"), "{}", enhancer.describe());
    });
    let (_folder, mut truncated) = stated(&onnx::gain(0.5), "rounding = \"truncate\"");
    let half: Vec<u8> = image.samples().iter().map(|byte| byte / 2).collect();
    assert_eq!(truncated.enhance(&image).unwrap().samples(), half);
}

#[test]
fn range_that_nobody_stated_is_checked() {
    let rows = [(onnx::ranged(0.0, 255.0), "seems to be 0..255"), (onnx::ranged(-1.0, 1.0), "seems to be -1..1")];
    check_rows(rows, |(graph, likely)| {
        let (_folder, mut enhancer) = loaded(&graph);
        let message = enhancer.enhance(&image(12, 20)).unwrap_err().to_string();
        assert!(message.contains(likely), "{message}");
    });
}

#[test]
fn preset_says_what_its_authors_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = onnx::two_outputs().write(folder.path(), "model.onnx");
    let image = image(8, 8);
    let file = |preset: &str| PathBuf::from(format!("{preset}:{}", path.display()));
    // The second of two images is SCI's, the first Zero-DCE++'s; Zero-DCE has no such list.
    for (preset, factor) in [("sci", 2.0), ("zero-dce++", 0.0)] {
        let mut enhancer = open(&file(preset)).unwrap();
        let enhanced = enhancer.enhance(&Rgb::new(12, 12, vec![51; 432]).unwrap());
        let expected = Rgb::new(12, 12, vec![(51.0 * factor) as u8; 432]);
        assert_eq!(enhanced.unwrap(), expected.unwrap(), "{preset}");
    }
    let message = open(&file("zero-dce")).err().unwrap().to_string();
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: does not match preset zero-dce: expected an image named enhance_image or enhanced or output;
        or outputs of 3, 3, 24 channels; or outputs of 3, 24 channels, found "17" (float32 [1, 3, height, width]),
        "18" (float32 [1, 3, height, width]); add to model.onnx.toml next to it the one that is the image: `output
        = "NAME"`
    "#);
    for names in [["1", "2", "3"], ["output", "7", "8"], ["a", "enhanced", "c"]] {
        let three = onnx::three_outputs(names).write(folder.path(), "three.onnx");
        let model = PathBuf::from(format!("zero-dce:{}", three.display()));
        let enhanced = open(&model).unwrap().enhance(&image).unwrap();
        assert_eq!(enhanced, map(&image, |x| 2.0 * x), "{names:?}");
    }
    let described = open(&file("sci")).unwrap().describe();
    assert!(described.contains("preset sci") && described.contains("truncate"), "{described}");
    let digests = ["sci", "zero-dce"].map(|preset| ModelFile::read(&file(preset)).unwrap().digest());
    assert_ne!(digests[0], digests[1]);
    let message = open(&file("nonesuch")).err().unwrap().to_string();
    insta::assert_snapshot!(redacted(&message), @r#"
    --llie: "nonesuch" before the colon is not a preset; the presets are agllnet, cidnet, darkir, enlightengan,
        iat, kind, llformer, mirnet, pairlie, pairlie-lol, restormer, retinexformer, ruas-dark, ruas-lol,
        ruas-upe, sci, uretinex, zero-dce, zero-dce++, zero-dce-tf
    "#);
    for (typed, meant) in [("zerodce", "zero-dce"), ("ruas", "ruas-lol")] {
        let message = open(&file(typed)).err().unwrap().to_string();
        let question = format!("; did you mean {meant}?");
        assert!(message.contains(&question), "{message}");
    }
}
