use super::*;
use crate::conventions::convention::ElementType;
use crate::graphs::Dim;

fn preset(name: &str) -> Preset {
    let (preset, _) = Preset::split(Path::new(&format!("{name}:no/such.onnx"))).unwrap();
    preset.unwrap()
}

/// Float ports, by name and number of channels: images of any size, or a single number for 0 channels.
fn ports(all: &[(&str, usize)]) -> Vec<Port> {
    all.iter()
        .map(|(name, channels)| Port {
            name: (*name).to_owned(),
            element: ElementType::Float32,
            dims: match channels {
                0 => vec![Dim::Known(1)],
                channels => vec![Dim::Known(1), Dim::Known(*channels), Dim::Free("n".into()), Dim::Free("n".into())],
            },
        })
        .collect()
}

/// A preset's convention for a graph with these outputs.
fn stated(name: &str, outputs: &[(&str, usize)]) -> std::result::Result<ModelSidecar, String> {
    let sidecar = ModelSidecar::default();
    preset(name).for_graph(&sidecar, &ports(&[("x", 3)]), &ports(outputs))
}

#[test]
fn preset_is_split_at_the_colon() {
    for name in all_presets().unwrap().into_keys().chain(["zero-dce-pp".to_owned()]) {
        let model = format!("{name}:a/b.onnx");
        let (preset, file) = Preset::split(Path::new(&model)).unwrap();
        assert_eq!((preset.unwrap().name.as_str(), file), (name.as_str(), "a/b.onnx".into()));
    }
    for plain in ["a/b.onnx", "./x:y.onnx", "C:\\m.onnx"] {
        let (preset, file) = Preset::split(Path::new(plain)).unwrap();
        assert!(preset.is_none() && file == Path::new(plain), "{plain}");
    }
    let message = Preset::split(Path::new("zerodce:b.onnx")).unwrap_err().to_string();
    assert!(message.contains("zero-dce, "), "{message}");
}

#[test]
fn file_named_like_another_preset_is_recognised() {
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
        let found = preset(name).other_preset_in_name(Path::new(file));
        assert_eq!(found.as_deref(), other, "{name}:{file}");
    }
}

#[test]
fn every_preset_is_documented() {
    let texts = [
        include_str!("../../../docs/enhancers.md"),
        include_str!("../../settings.rs"),
        include_str!("../../../commands/enhance.rs"),
    ];
    for (name, content) in all_presets().unwrap() {
        for text in texts {
            let mut words = text.split(|c: char| !(c.is_alphanumeric() || "+-".contains(c)));
            assert!(words.any(|word| word == name), "{name} is not described");
        }
        let row = format!("{}, {}", content.repository, content.commit);
        let [readme, ..] = texts;
        let written = readme.contains(&format!("[{}]", content.repository)) && readme.contains(&content.commit);
        assert!(written, "src/docs/enhancers.md lacks {row}");
    }
}

#[test]
fn every_preset_states_its_source() {
    for (name, content) in all_presets().unwrap() {
        assert!(
            content.commit.len() == 7
                && content.commit.chars().all(|c: char| c.is_ascii_digit() || ('a'..='f').contains(&c)),
            "{name}"
        );
        assert_eq!(content.repository.split('/').count(), 2, "{name}");
        assert!(!content.file.is_empty() && !content.paper.is_empty(), "{name}");
        assert!(!content.names.is_empty(), "{name}");
        for list in &content.signatures {
            assert!((1..=list.channels.len()).contains(&list.nth), "{name}");
            assert_eq!(list.channels[list.nth - 1], 3, "{name}");
        }
        // A preset identifies its output by `names`, which are checked against a graph, and not by keys of the sidecar.
        assert!(content.sidecar.output.is_none() && content.sidecar.image.is_none());
        let source = content.to_string();
        assert!(source.contains(&content.repository) && source.contains(&content.commit));
    }
}

#[test]
fn image_is_sliced_from_a_stacked_output() {
    for (name, outputs, start) in
        [("agllnet", [("a/b:0", 7)], "`a/b:0`[4:7]"), ("zero-dce-tf", [("y", 24)], "curves(input, `y`[0:3]")]
    {
        let image = stated(name, &outputs).unwrap().image.unwrap().to_string();
        assert!(image.starts_with(start), "{image}");
    }
    for (name, outputs) in
        [("agllnet", &[("y", 3)][..]), ("zero-dce-tf", &[("y", 3)]), ("agllnet", &[("y", 7), ("z", 7)])]
    {
        let problem = stated(name, outputs).unwrap_err();
        assert!(problem.contains("one output of "), "{problem}");
    }
}

#[test]
fn list_has_source_licence_and_export_of_each_preset() {
    let list = list_of_presets().unwrap();
    for (name, content) in all_presets().unwrap() {
        assert!(list.contains(&content.repository), "{name}");
        assert!(!content.licence.is_empty(), "{name}");
        let script = include_str!("../../../../models/export.py");
        let is_exported = script.contains(&format!("    \"{name}\": Published("));
        assert_eq!(is_exported, content.ready_made.is_none(), "{name}");
    }
    let command = "export: python models/export.py ruas-lol RUAS RUAS/ckpt/lol.pt ruas-lol.onnx\n";
    assert!(list.contains(command), "{list}");
    assert!(list.contains("pad = \"reflect\""), "{list}");
}

#[test]
fn output_is_chosen_by_name_then_by_channels() {
    for (name, outputs, expected) in [
        ("zero-dce", &[("a", 3), ("b", 3), ("c", 24)][..], "b"),
        ("zero-dce", &[("a", 3), ("c", 24)], "a"),
        ("zero-dce", &[("half", 3), ("enhanced", 3)], "enhanced"),
        ("zero-dce", &[("curves", 24), ("enhance_image", 3)], "enhance_image"),
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
fn error_about_unknown_outputs_lists_them() {
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
    // A single output, or a single one with three channels, is the image whatever its name.
    for outputs in [&[("1", 3)][..], &[("curves", 24), ("2", 3)]] {
        assert_eq!(stated("retinexformer", outputs).unwrap().output, None);
    }
}

#[test]
fn output_of_the_sidecar_overrides_the_preset() {
    let sidecar = ModelSidecar { output: Some(OutputChoice::Index(0)), ..ModelSidecar::default() };
    let outputs = ports(&[("1", 3), ("2", 3)]);
    let found = preset("zero-dce").for_graph(&sidecar, &ports(&[("x", 3)]), &outputs);
    assert_eq!(sidecar.with_defaults(&found.unwrap()).output, Some(OutputChoice::Index(0)));
}

#[test]
fn pairlie_is_an_expression_or_takes_its_exponent_as_an_input() {
    let found = stated("pairlie", &[("L", 1), ("R", 3), ("X", 3)]).unwrap();
    assert_eq!((found.image, found.output), ("L ^ 0.2 * R".parse().ok(), None));
    // Only exports with the exponent as an input are given it.
    assert!(found.extra.is_empty());
    let inputs = ports(&[("x", 3), ("exposure", 0)]);
    let outputs = ports(&[("output", 3)]);
    let found = preset("pairlie-lol").for_graph(&ModelSidecar::default(), &inputs, &outputs);
    let exponent = ExtraValue::Number(SidecarNumber::Float(0.14));
    assert_eq!(found.unwrap().extra["exposure"], exponent);
}

#[test]
fn uretinex_is_the_product_of_reflectance_and_illumination() {
    let found = stated("uretinex", &[("R", 3), ("L", 1), ("High_L", 1)]).unwrap();
    assert_eq!((found.image, found.output), ("R * High_L".parse().ok(), None));
}

#[test]
fn number_becomes_a_map_where_the_graph_takes_one() {
    let outputs = ports(&[("output", 3)]);
    for (name, channels, expected) in
        [("uretinex", 0, "5"), ("uretinex", 1, "map of 5"), ("kind", 0, "5.0"), ("kind", 1, "map of 5.0")]
    {
        let inputs = ports(&[("x", 3), ("ratio", channels)]);
        let found = preset(name).for_graph(&ModelSidecar::default(), &inputs, &outputs);
        assert_eq!(found.unwrap().extra["ratio"].to_string(), expected);
    }
}

/// Differences between the authors' model and a graph with these inputs and outputs.
fn differences(name: &str, inputs: &[(&str, usize)], outputs: &[(&str, usize)]) -> Option<String> {
    preset(name).differences(&ports(inputs), &ports(outputs))
}

#[test]
fn differences_from_the_authors_model_are_reported() {
    let image = [("x", 3)];
    let three = [("a", 3), ("b", 3), ("c", 24)];
    assert_eq!(differences("zero-dce", &image, &three), None);
    assert_eq!(differences("zero-dce", &image, &three[..1]), None);
    let found = differences("sci", &image, &three).unwrap();
    assert!(found.contains("outputs of 3, 3 channels"), "{found}");
    let found = differences("sci", &[("x", 3), ("ratio", 0)], &three[..1]).unwrap();
    assert!(found.contains("inputs differ"), "{found}");
    assert_eq!(differences("kind", &[("x", 3), ("ratio", 1)], &three[..1]), None);
}
