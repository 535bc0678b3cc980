use super::*;
use crate::conventions::convention::ElementType;
use crate::graphs::Dim;

fn preset(name: &str) -> Preset {
    let (preset, _) = Preset::split(Path::new(&format!("{name}:no/such.onnx"))).unwrap();
    preset.unwrap()
}

/// Float images with these numbers of channels and any size; a single number if 0.
fn ports(all: &[(&str, usize)]) -> Vec<Port> {
    let any = || Dim::Free("n".into());
    all.iter()
        .map(|(name, channels)| Port {
            name: (*name).to_owned(),
            element: ElementType::Float32,
            dims: match channels {
                0 => vec![Dim::Known(1)],
                channels => vec![Dim::Known(1), Dim::Known(*channels), any(), any()],
            },
        })
        .collect()
}

/// A preset's statements for a graph with these outputs.
fn stated(name: &str, outputs: &[(&str, usize)]) -> std::result::Result<ModelSidecar, String> {
    let sidecar = ModelSidecar::default();
    preset(name).for_graph(&sidecar, &ports(&[("x", 3)]), &ports(outputs))
}

#[test]
fn presets_stand_before_a_colon() {
    for name in all().unwrap().into_keys().chain(["zero-dce-pp".to_owned()]) {
        let model = format!("{name}:a/b.onnx");
        let (preset, file) = Preset::split(Path::new(&model)).unwrap();
        assert_eq!(
            (preset.unwrap().name.as_str(), file),
            (name.as_str(), "a/b.onnx".into())
        );
    }
    for plain in ["a/b.onnx", "./x:y.onnx", "C:\\m.onnx"] {
        let (preset, file) = Preset::split(Path::new(plain)).unwrap();
        assert!(preset.is_none() && file == Path::new(plain), "{plain}");
    }
    let message = Preset::split(Path::new("zerodce:b.onnx"))
        .unwrap_err()
        .to_string();
    assert!(message.contains("zero-dce, "), "{message}");
}

#[test]
fn a_file_that_is_named_after_another_preset_is_found() {
    for (name, file, other) in [
        ("zero-dce", "a/ruas_upe_1out.onnx", Some("ruas-upe")),
        ("enlightengan", "Zero_DCE_epoch99.onnx", Some("zero-dce")),
        ("darkir", "hpc203_pairlie_HxW.onnx", Some("pairlie")),
        ("darkir", "sci3.onnx", Some("sci")),
        ("ruas-lol", "ruas_upe.onnx", None),
        ("zero-dce++", "zero_dce_epoch99.onnx", None),
        ("zero-dce-pp", "zero_dcepp.onnx", None),
        ("pairlie", "hpc203_pairlie_HxW.onnx", None),
        ("darkir", "dark-ir-kind.onnx", None),
        ("enlightengan", "zero_shot.onnx", None),
        ("enlightengan", "science_mankind.onnx", None),
        ("darkir", "model.onnx", None),
    ] {
        let found = preset(name).named_after(Path::new(file));
        assert_eq!(found.as_deref(), other, "{name}:{file}");
    }
}

#[test]
fn every_preset_is_described_and_stands_in_the_help() {
    let texts = [
        include_str!("../../../../docs/enhancers.md"),
        include_str!("../../settings.rs"),
        include_str!("../../../../run/enhance/mod.rs"),
    ];
    for (name, content) in all().unwrap() {
        for text in texts {
            let mut words = text.split(|c: char| !(c.is_alphanumeric() || "+-".contains(c)));
            assert!(words.any(|word| word == name), "{name} is not described");
        }
        let row = format!("{}, {}", content.repository, content.commit);
        let [readme, ..] = texts;
        let written = readme.contains(&format!("[{}]", content.repository))
            && readme.contains(&content.commit);
        assert!(written, "src/docs/enhancers.md lacks {row}");
    }
}

#[test]
fn every_preset_has_its_source() {
    for (name, content) in all().unwrap() {
        assert!(
            content.commit.len() == 7
                && content
                    .commit
                    .chars()
                    .all(|c: char| c.is_ascii_digit() || ('a'..='f').contains(&c)),
            "{name}"
        );
        assert_eq!(content.repository.split('/').count(), 2, "{name}");
        assert!(
            !content.file.is_empty() && !content.paper.is_empty(),
            "{name}"
        );
        assert!(!content.names.is_empty(), "{name}");
        for list in &content.signatures {
            assert!((1..=list.channels.len()).contains(&list.nth), "{name}");
            assert_eq!(list.channels[list.nth - 1], 3, "{name}");
        }
        // The output is identified next to the names, where it can be checked against a graph.
        assert!(content.sidecar.output.is_none() && content.sidecar.image.is_none());
        let source = content.to_string();
        assert!(source.contains(&content.repository) && source.contains(&content.commit));
    }
}

#[test]
fn the_image_is_found_among_the_channels_of_one_output() {
    let image = |name, outputs| {
        let stated = stated(name, outputs).unwrap();
        stated.image.unwrap().to_string()
    };
    assert_eq!(image("agllnet", &[("a/b:0", 7)]), "`a/b:0`[4:7]");
    let curves = image("zero-dce-tf", &[("y", 24)]);
    assert!(curves.starts_with("curves(input, `y`[0:3]"), "{curves}");
    for (name, outputs) in [
        ("agllnet", &[("y", 3)][..]),
        ("zero-dce-tf", &[("y", 3)]),
        ("agllnet", &[("y", 7), ("z", 7)]),
    ] {
        let problem = stated(name, outputs).unwrap_err();
        assert!(problem.contains("one output of "), "{problem}");
    }
}

#[test]
fn the_list_has_source_licence_and_export_of_each_preset() {
    let list = list_of_presets().unwrap();
    for (name, content) in all().unwrap() {
        assert!(list.contains(&content.repository), "{name}");
        assert!(!content.licence.is_empty(), "{name}");
        let script = include_str!("../../../../../models/export.py");
        let is_exported = script.contains(&format!("    \"{name}\": Published("));
        assert_eq!(is_exported, content.ready_made.is_none(), "{name}");
    }
    let command = "export: python models/export.py ruas-lol RUAS RUAS/ckpt/lol.pt ruas-lol.onnx\n";
    assert!(list.contains(command), "{list}");
    assert!(list.contains("pad = \"reflect\""), "{list}");
}

#[test]
fn the_output_is_known_by_name_then_by_channels() {
    for (name, outputs, expected) in [
        ("zero-dce", &[("a", 3), ("b", 3), ("c", 24)][..], "b"),
        ("zero-dce", &[("a", 3), ("c", 24)], "a"),
        ("zero-dce", &[("half", 3), ("enhanced", 3)], "enhanced"),
        (
            "zero-dce",
            &[("curves", 24), ("enhance_image", 3)],
            "enhance_image",
        ),
        // The name of a first output counts only if the others were named too.
        ("zero-dce", &[("output", 3), ("322", 3), ("300", 24)], "322"),
        ("zero-dce", &[("output", 3), ("half", 3)], "output"),
        ("zero-dce++", &[("1", 3), ("2", 3)], "1"),
        ("sci", &[("1", 3), ("2", 3)], "2"),
        ("iat", &[("1", 3), ("2", 3), ("3", 3)], "3"),
        ("darkir", &[("1", 3), ("2", 3)], "2"),
        ("darkir", &[("output", 3), ("side", 3)], "output"),
        ("enlightengan", &[("output", 3), ("255", 3)], "output"),
    ] {
        let found = stated(name, outputs).unwrap();
        let expected = OutputChoice::Name(expected.to_owned());
        assert_eq!(found.output, Some(expected), "{name} {outputs:?}");
    }
    let stages = ["t0", "t1", "t2", "3", "4", "5", "6"].map(|name| (name, 3));
    for (name, index) in [("ruas-lol", 3), ("ruas-upe", 2), ("ruas-dark", 2)] {
        let expected = OutputChoice::Name(stages[index].0.to_owned());
        assert_eq!(stated(name, &stages).unwrap().output, Some(expected));
    }
}

#[test]
fn an_unknown_list_of_outputs_is_an_error_that_lists_them() {
    for (name, outputs) in [
        ("zero-dce", &[("1", 3), ("2", 3)][..]),
        ("ruas-lol", &[("output", 3), ("2", 3), ("3", 3)]),
        ("retinexformer", &[("a", 3), ("b", 3)]),
        ("uretinex", &[("R", 3), ("L", 1)]),
    ] {
        let message = stated(name, outputs).unwrap_err();
        assert!(message.contains(&format!("preset {name}")), "{message}");
        assert!(message.contains("output = \"NAME\""), "{message}");
        for (output, _) in outputs {
            assert!(message.contains(&format!("{output:?}")), "{message}");
        }
    }
    // A single output, or a single image, is the image under any name.
    for outputs in [&[("1", 3)][..], &[("curves", 24), ("2", 3)]] {
        assert_eq!(stated("retinexformer", outputs).unwrap().output, None);
    }
}

#[test]
fn what_a_sidecar_says_of_the_image_goes_before_a_preset() {
    let sidecar = ModelSidecar {
        output: Some(OutputChoice::Index(0)),
        ..ModelSidecar::default()
    };
    let outputs = ports(&[("1", 3), ("2", 3)]);
    let found = preset("zero-dce").for_graph(&sidecar, &ports(&[("x", 3)]), &outputs);
    assert_eq!(
        sidecar.with_defaults(&found.unwrap()).output,
        Some(OutputChoice::Index(0))
    );
}

#[test]
fn pairlie_is_composed_or_exported_with_its_exponent() {
    let found = stated("pairlie", &[("L", 1), ("R", 3), ("X", 3)]).unwrap();
    assert_eq!(
        (found.image, found.output),
        ("L ^ 0.2 * R".parse().ok(), None)
    );
    // Only exports with the exponent as an input are given it.
    assert!(found.extra.is_empty());
    let inputs = ports(&[("x", 3), ("exposure", 0)]);
    let outputs = ports(&[("output", 3)]);
    let found = preset("pairlie-lol").for_graph(&ModelSidecar::default(), &inputs, &outputs);
    let exponent = ExtraValue::Number(Number::Float(0.14));
    assert_eq!(found.unwrap().extra["exposure"], exponent);
}

#[test]
fn uretinex_is_composed_of_reflectance_and_light() {
    let found = stated("uretinex", &[("R", 3), ("L", 1), ("High_L", 1)]).unwrap();
    assert_eq!(
        (found.image, found.output),
        ("R * High_L".parse().ok(), None)
    );
}

#[test]
fn a_number_is_a_map_where_the_graph_takes_one() {
    let outputs = ports(&[("output", 3)]);
    let value = |name: &str, channels: usize| {
        let inputs = ports(&[("x", 3), ("ratio", channels)]);
        let found = preset(name).for_graph(&ModelSidecar::default(), &inputs, &outputs);
        found.unwrap().extra["ratio"].to_string()
    };
    assert_eq!(
        [value("uretinex", 0), value("uretinex", 1)],
        ["5", "map of 5"]
    );
    assert_eq!([value("kind", 0), value("kind", 1)], ["5.0", "map of 5.0"]);
}

#[test]
fn a_graph_that_is_not_the_authors_is_told_apart() {
    let differing = |name: &str, inputs: &[(&str, usize)], outputs: &[(&str, usize)]| {
        preset(name).differing(&ports(inputs), &ports(outputs))
    };
    let image = [("x", 3)];
    let three = [("a", 3), ("b", 3), ("c", 24)];
    assert_eq!(differing("zero-dce", &image, &three), None);
    assert_eq!(differing("zero-dce", &image, &three[..1]), None);
    let found = differing("sci", &image, &three).unwrap();
    assert!(found.contains("outputs of 3, 3 channels"), "{found}");
    let found = differing("sci", &[("x", 3), ("ratio", 0)], &three[..1]).unwrap();
    assert!(found.contains("inputs differ"), "{found}");
    assert_eq!(
        differing("kind", &[("x", 3), ("ratio", 1)], &three[..1]),
        None
    );
}
