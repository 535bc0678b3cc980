use super::*;
use crate::conventions::convention::ElementType;
use crate::conventions::extra::{ExtraValue, SidecarNumber};

use crate::graphs::Dim;

/// A float32 port; 0 stands for a dimension of any size.
fn port(name: &str, dims: &[usize]) -> Port {
    Port {
        name: name.into(),
        element: ElementType::Float32,
        dims: dims
            .iter()
            .map(|size| match size {
                0 => Dim::Free("n".into()),
                known => Dim::Known(*known),
            })
            .collect(),
    }
}

fn image(name: &str) -> Port {
    port(name, &[1, 3, 0, 0])
}

fn curves(name: &str) -> Port {
    port(name, &[1, 24, 0, 0])
}

fn signature(inputs: &[Port], outputs: &[Port]) -> Result<Signature, String> {
    Signature::infer(inputs, outputs, &ModelSidecar::default())
}

fn infer_with(inputs: &[Port], outputs: &[Port], sidecar: &str) -> Result<Signature, String> {
    let sidecar = ModelSidecar::parse(std::path::Path::new("m.onnx"), sidecar).unwrap();
    Signature::infer(inputs, outputs, &sidecar)
}

/// Name of the output that is chosen as the image.
fn choose(outputs: &[Port]) -> Result<String, String> {
    signature(&[image("input")], outputs).map(|signature| signature.outputs[0].port.name.clone())
}

#[test]
fn only_image_is_chosen_whatever_its_name() {
    let cases = [
        vec![image("758")],
        vec![curves("a"), image("758")],
        vec![port("scalar", &[1]), image("758")],
        vec![port("758", &[0, 0, 0, 0])],
        vec![port("758", &[])],
    ];
    for outputs in cases {
        assert_eq!(choose(&outputs), Ok("758".into()), "{}", format_ports(&outputs));
    }
}

#[test]
fn name_decides_among_several_images() {
    for (names, expected) in [
        (&["illumination", "output"][..], "output"),
        (&["enhanced", "params"], "enhanced"),
        (&["mul", "add", "result"], "result"),
        (&["illumination", "r", "enhance_image"], "enhance_image"),
    ] {
        let outputs: Vec<Port> = names.iter().map(|name| image(name)).collect();
        assert_eq!(choose(&outputs), Ok(expected.into()), "{names:?}");
    }
}

#[test]
fn second_output_of_zero_dce_is_chosen_whatever_its_name() {
    for names in [
        ["enhance_image_1", "enhance_image", "r"],
        ["301", "322", "300"],
        ["output", "322", "300"],
        ["output_0", "output_1", "output_2"],
    ] {
        let outputs = [image(names[0]), image(names[1]), curves(names[2])];
        assert_eq!(choose(&outputs), Ok(names[1].into()), "{names:?}");
    }
}

#[test]
fn ambiguous_output_must_be_stated() {
    for names in [
        &["1", "2"][..],
        &["output", "322"],
        &["output", "add_5"],
        &["enhanced", "/net/Mul_output_0"],
        &["u0", "u1", "u2", "u_denoised"],
        &["enhanced", "output"],
    ] {
        let outputs: Vec<Port> = names.iter().map(|name| image(name)).collect();
        let message = choose(&outputs).unwrap_err();
        assert!(message.contains("output = INDEX"), "{message}");
        assert!(names.iter().all(|name| message.contains(name)), "{message}");
    }
    // The name suggests the first output, Zero-DCE's structure the second.
    let outputs = [image("enhanced"), image("half"), curves("r")];
    assert!(choose(&outputs).is_err());
}

#[test]
fn stated_output_is_chosen_if_it_can_be_an_image() {
    let inputs = [image("input")];
    let outputs = [image("1"), image("2"), curves("3")];
    for (outputs, line, name) in [
        (&outputs[..], "output = 0", "1"),
        (&outputs, "output = \"2\"", "2"),
        // The index may count the outputs of another export, so a single output is taken at any index.
        (&outputs[1..2], "output = 3", "2"),
    ] {
        let found = infer_with(&inputs, outputs, line).unwrap();
        assert_eq!(found.outputs[0].port.name, name, "{line}");
    }
    for (line, part) in
        [("output = 3", "does not exist"), ("output = \"x\"", "does not exist"), ("output = 2", "is not an image")]
    {
        let message = infer_with(&inputs, &outputs, line).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn fixed_sizes_of_input_and_output_must_agree() {
    let fixed = port("in", &[1, 3, 96, 128]);
    let found = signature(std::slice::from_ref(&fixed), &[port("out", &[1, 3, 0, 128])]).unwrap();
    assert_eq!((found.height, found.width), (Some(96), Some(128)));
    let half = signature(&[port("in", &[1, 3, 0, 128])], &[image("out")]).unwrap();
    assert_eq!((half.height, half.width), (None, Some(128)));
    for dims in [[1, 3, 96, 127], [1, 3, 128, 96], [2, 3, 96, 128]] {
        assert!(signature(std::slice::from_ref(&fixed), &[port("out", &dims)]).is_err());
    }
}

#[test]
fn layouts_are_inferred_for_each_element_type() {
    for (dims, layout) in [
        (&[1, 3, 0, 0][..], TensorLayout::Nchw),
        (&[0, 0, 0, 3], TensorLayout::Nhwc),
        (&[3, 0, 0], TensorLayout::Chw),
        (&[48, 64, 3], TensorLayout::Hwc),
    ] {
        for element in [ElementType::Float32, ElementType::Float16, ElementType::Uint8] {
            let input = Port { element, ..port("x", dims) };
            let found = signature(&[input], &[port("y", &[])]).unwrap();
            assert_eq!((found.input.layout, found.outputs[0].layout), (layout, None));
        }
    }
    let out = signature(&[image("x")], &[port("y", &[0, 0, 3])]).unwrap();
    assert_eq!(out.outputs[0].layout, Some(TensorLayout::Hwc));
}

#[test]
fn undeclared_layout_must_be_stated() {
    let open = [port("x", &[0, 0, 0, 0])];
    let message = signature(&open, &[image("y")]).unwrap_err();
    assert!(message.contains("layout_in = \"nchw\""), "{message}");
    let found = infer_with(&open, &[image("y")], "layout_in = \"nhwc\"").unwrap();
    assert_eq!(found.input.layout, TensorLayout::Nhwc);
    for wrong in ["layout_in = \"chw\"", "layout_in = \"nhwc\""] {
        assert!(infer_with(&[image("x")], &[image("y")], wrong).is_err());
    }
}

fn typed(element: ElementType, port: Port) -> Port {
    Port { element, ..port }
}

#[test]
fn further_inputs_need_values() {
    let inputs = [image("x"), port("strength", &[1])];
    let message = signature(&inputs, &[image("y")]).unwrap_err();
    assert!(message.contains("`strength = NUMBER`"), "{message}");
    // The message proposes a value if a preset states one for this name.
    let known = [image("x"), port("exposure", &[])];
    let message = signature(&known, &[image("y")]).unwrap_err();
    assert!(message.contains("`exposure = 0.2` (as in preset pairlie)"), "{message}");
    let switch = [image("x"), typed(ElementType::Bool, port("on", &[1]))];
    let message = signature(&switch, &[image("y")]).unwrap_err();
    assert!(message.contains("`on = true` or `on = false`"), "{message}");
    let found = infer_with(&inputs, &[image("y")], "[extra]\nstrength = 0.25").unwrap();
    assert_eq!(found.extras[0].value, ExtraValue::Number(SidecarNumber::Float(0.25)));
    for (text, part) in [
        ("[extra]\ngamma = 1", "its value is unknown"),
        ("[extra]\nstrength = 1\ngamma = 1", "\"gamma\" under [extra], which is not an input"),
        ("[extra]\nstrength = 1\nmean = [0, 0, 0]", "move that line above [extra] if it is another key"),
    ] {
        let message = infer_with(&inputs, &[image("y")], text).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn values_must_fit_further_inputs() {
    let plane = port("a", &[1, 1, 0, 0]);
    let plane_int32 = typed(ElementType::Int32, plane.clone());
    let noise = "{ noise = \"normal\" }";
    let rows = [
        (typed(ElementType::Int32, port("a", &[1])), "3", None),
        (typed(ElementType::Int32, port("a", &[])), "3", None),
        (typed(ElementType::Int32, port("a", &[0])), "3", None),
        (typed(ElementType::Int32, port("a", &[1])), "3.5", Some("3.5 does not fit its type int32")),
        (typed(ElementType::Bool, port("a", &[])), "1", Some("type bool")),
        (port("a", &[1]), "{ map = 1 }", Some("single number: `a = NUMBER`")),
        (plane.clone(), "0.5", Some("`a = { map = 0.5 }`")),
        (plane.clone(), "{ map = 0.5 }", None),
        (port("a", &[1, 7, 0, 0]), "{ map = 0.5 }", None),
        (port("a", &[0, 0]), "{ map = 0.5 }", None),
        (plane_int32.clone(), "{ map = 0.5 }", Some("type int32")),
        (port("a", &[1, 4, 0, 0]), noise, None),
        (plane_int32, noise, Some("export it as float32")),
        (plane.clone(), "{ from = \"max(image)\" }", None),
        (plane, "{ from = \"1 - image\" }", Some("mean(…) or max(…)")),
        (port("a", &[1, 3, 0, 0]), "{ from = \"1 - image\" }", None),
        (port("a", &[1, 4, 0, 0]), "{ from = \"image\" }", Some("4 channels")),
        (port("a", &[5, 1, 0, 0]), "{ map = 1 }", Some("dimension of 5")),
    ];
    for (further, value, problem) in rows {
        let inputs = [image("x"), further];
        let text = format!("[extra]\na = {value}");
        let found = infer_with(&inputs, &[image("y")], &text).err();
        let words = format!("{} {value}: {found:?}", inputs[1]);
        match problem {
            None => assert_eq!(found, None, "{words}"),
            Some(part) => assert!(found.is_some_and(|found| found.contains(part)), "{words}"),
        }
    }
}

#[test]
fn shape_and_name_decide_the_proposed_value_of_a_further_input() {
    for (further, part) in [
        (port("ratio", &[1, 1, 0, 0]), "`ratio = { map = 5.0 }`"),
        (port("z", &[1, 1, 0, 0]), "`z = { noise = \"normal\", std = NUMBER, seed = 0 }`"),
        (port("second", &[1, 3, 0, 0]), "of three channels"),
        (image("attention"), "`attention = { from = \"1 - max(image)\" }`"),
        (port("gray.1", &[1, 1, 0, 0]), "`\"gray.1\" = { from ="),
        (typed(ElementType::Other("string".into()), port("s", &[])), "an unsupported type"),
    ] {
        let name = further.to_string();
        let message = signature(&[image("x"), further], &[image("y")]).unwrap_err();
        assert!(message.contains(&name), "{message}");
        assert!(message.contains(part), "{message}");
    }
    // An input named like a mask is not the image, even if it is the first.
    let message = signature(&[image("mask"), image("x")], &[image("y")]).unwrap_err();
    assert!(message.starts_with("takes \"mask\""), "{message}");
}

#[test]
fn expression_of_the_image_names_outputs() {
    let inputs = [image("x")];
    let outputs = [port("L", &[1, 1, 0, 0]), image("R"), curves("c")];
    for (line, expected) in [("image = \"L ^ 0.2 * R\"", &["L", "R"][..]), ("image = \"R + 0 * input\"", &["R"])] {
        let found = infer_with(&inputs, &outputs, line).unwrap();
        let names: Vec<&str> = found.outputs.iter().map(|output| output.port.name.as_str()).collect();
        assert_eq!(names, expected, "{line}");
    }
    for (line, part) in [
        ("image = \"L * Q\"", "names `Q`, which is unknown"),
        ("image = \"c * R\"", "not an image of one or three channels"),
        ("image = \"input * 2\"", "names none of its outputs"),
    ] {
        let message = infer_with(&inputs, &outputs, line).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn single_channel_must_be_stated_to_be_the_luma() {
    let inputs = [port("a", &[1, 1, 0, 0])];
    let outputs = [port("b", &[1, 1, 0, 0])];
    let message = signature(&inputs, &outputs).unwrap_err();
    assert!(message.contains("`channels = \"y\"`"), "{message}");
    let found = infer_with(&inputs, &outputs, "channels = \"y\"").unwrap();
    assert_eq!(found.input.layout, TensorLayout::Nchw);
    let different = "channels = \"y\"\nmean = [0, 0, 1]";
    let message = infer_with(&inputs, &outputs, different).unwrap_err();
    assert!(message.contains("has different numbers"), "{message}");
    let colour = infer_with(&[image("a")], &outputs, "channels = \"y\"");
    assert!(colour.unwrap_err().contains("delete that line"));
}

#[test]
fn unsupported_inputs_are_named() {
    let double = typed(ElementType::Float64, image("double"));
    let cases = [
        (vec![], "no input that can be an image; export it with an input of [1, 3, height, width]; inputs: none"),
        (vec![image("a"), image("b")], "\"b\" (float32 [1, 3, n, n])"),
        (vec![double], "float64"),
        (vec![port("a", &[2, 3, 0, 0])], "several images"),
        (vec![port("a", &[])], "without a shape"),
        (vec![port("a", &[1, 4, 0, 0])], "4 channels, but an image has 3"),
        (vec![port("a", &[1, 2, 3, 64, 64])], "several frames"),
        (vec![port("a", &[1, 85])], "a vector"),
    ];
    for (inputs, part) in cases {
        let message = signature(&inputs, &[image("out")]).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn model_without_an_image_output_is_refused() {
    let outputs = [port("758", &[1, 85, 22, 22]), port("flat", &[1, 3])];
    let message = choose(&outputs).unwrap_err();
    assert!(message.contains("\"758\" (float32 [1, 85, 22, 22])"), "{message}");
    assert!(choose(&[]).unwrap_err().ends_with("outputs: none"));
}
