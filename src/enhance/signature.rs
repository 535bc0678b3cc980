//! Which tensors of a graph are the dark image and the enhanced one: [`Signature::of`].
//!
//! A graph says element types, ranks and the sizes it knows. What it cannot say (value range, colour order) is taken to be
//! the convention of the published models: RGB, 0..1. What it says otherwise is refused.

use std::fmt;

use super::sidecar::OutputChoice;

/// The names that exporters give the enhanced image where a model has other outputs beside it.
const IMAGE_NAMES: [&str; 8] = [
    "enhanced",
    "enhanced_image",
    "enhance_image",
    "enhance",
    "output",
    "output_image",
    "result",
    "image",
];

/// An input or output of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Port {
    /// Its name.
    pub(super) name: String,
    /// What its elements are.
    pub(super) element: Element,
    /// Its dimensions; empty where the graph does not say even their number.
    pub(super) dims: Vec<Dim>,
}

/// What the elements of a tensor are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Element {
    /// 32-bit floats.
    Float32,
    /// Anything else, by its name.
    Other(String),
}

/// One dimension of a tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Dim {
    /// A size that the graph fixes.
    Known(usize),
    /// Any size, with the graph's name for it, which may be empty.
    Free(String),
}

impl Dim {
    fn known(&self) -> Option<usize> {
        match self {
            Self::Known(size) => Some(*size),
            Self::Free(_) => None,
        }
    }

    /// Whether the dimension can have this size.
    fn can_be(&self, size: usize) -> bool {
        self.known().is_none_or(|known| known == size)
    }

    /// Whether two dimensions can have the same size.
    fn can_equal(&self, other: &Self) -> bool {
        other.known().is_none_or(|size| self.can_be(size))
    }
}

impl fmt::Display for Dim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(size) => write!(f, "{size}"),
            Self::Free(name) if name.is_empty() => write!(f, "?"),
            Self::Free(name) => write!(f, "{name}"),
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let element = match &self.element {
            Element::Float32 => "float32",
            Element::Other(name) => name,
        };
        write!(f, "{:?} ({element} [", self.name)?;
        for (i, dim) in self.dims.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{dim}")?;
        }
        write!(f, "])")
    }
}

/// How a graph is to be fed and read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Signature {
    /// The name of the output that is the enhanced image.
    pub(super) output: String,
    /// The height in pixels that the input has to have; `None` for any.
    pub(super) height: Option<usize>,
    /// The width in pixels that the input has to have; `None` for any.
    pub(super) width: Option<usize>,
}

impl Signature {
    /// Decides which output is the image, and checks that input and output are NCHW, RGB, float32.
    ///
    /// # Errors
    /// A sentence that says what was found and what mends it; it is to follow the file's name.
    pub(super) fn of(
        inputs: &[Port],
        outputs: &[Port],
        stated: Option<&OutputChoice>,
    ) -> Result<Self, String> {
        let (height, width) = image_input(inputs)?;
        let fits = |port: &Port| can_be_image(port, height, width);
        let output = match stated {
            Some(choice) => stated_output(outputs, choice, fits)?,
            None => choose_output(outputs, fits)?,
        };
        Ok(Self {
            output: output.clone(),
            height: height.known(),
            width: width.known(),
        })
    }
}

/// Checks the input and returns its height and width.
fn image_input(inputs: &[Port]) -> Result<(&Dim, &Dim), String> {
    const WANTED: &str = "one input, float32 [1, 3, height, width], RGB in 0..1";
    let [input] = inputs else {
        return Err(format!(
            "has {} inputs where {WANTED} is supported; it has {}",
            inputs.len(),
            list(inputs)
        ));
    };
    if input.element != Element::Float32 {
        return Err(format!(
            "takes {input}; only float32 is supported: export it with {WANTED}"
        ));
    }
    match input.dims.as_slice() {
        [batch, channels, height, width]
            if channels.known() == Some(3) && width.known() != Some(3) =>
        {
            if batch.can_be(1) {
                Ok((height, width))
            } else {
                Err(format!(
                    "takes {input}, several images at a time: export it with {WANTED}"
                ))
            }
        }
        [_, _, _, channels] if channels.known() == Some(3) => Err(format!(
            "takes {input}, channels last (NHWC): export it with {WANTED}"
        )),
        _ => Err(format!(
            "takes {input}, which is no NCHW image of three channels: export it with {WANTED}"
        )),
    }
}

/// Whether an output can be an image of the input's size: NCHW, float32, three channels. What the graph leaves open can.
fn can_be_image(port: &Port, input_height: &Dim, input_width: &Dim) -> bool {
    let shape = match port.dims.as_slice() {
        [] => true,
        [batch, channels, height, width] => {
            batch.can_be(1)
                && channels.can_be(3)
                && height.can_equal(input_height)
                && width.can_equal(input_width)
        }
        _ => false,
    };
    shape && port.element == Element::Float32
}

/// The output that the sidecar names, where it can be the image.
fn stated_output<'a>(
    outputs: &'a [Port],
    choice: &OutputChoice,
    fits: impl Fn(&Port) -> bool,
) -> Result<&'a String, String> {
    let found = match choice {
        OutputChoice::Index(index) => outputs.get(*index),
        OutputChoice::Name(name) => outputs.iter().find(|port| port.name == *name),
    };
    let problem = match found {
        Some(port) if fits(port) => return Ok(&port.name),
        Some(_) => "which is none of its image outputs",
        None => "which it does not have",
    };
    Err(format!(
        "its sidecar says {choice}, {problem}; it has {}",
        list(outputs)
    ))
}

/// The image among the outputs: the only one, else the one that names and structure agree on.
fn choose_output(outputs: &[Port], fits: impl Fn(&Port) -> bool) -> Result<&String, String> {
    let images: Vec<usize> = (0..outputs.len()).filter(|&i| fits(&outputs[i])).collect();
    let index = match images.as_slice() {
        [] => {
            return Err(format!(
                "has no output that is an image of the input's size, float32 [1, 3, height, width]; it has {}",
                list(outputs)
            ));
        }
        [only] => Some(*only),
        _ => match (by_name(outputs, &images), by_structure(outputs)) {
            (Some(name), Some(structure)) if name != structure => None,
            (name, structure) => name.or(structure),
        },
    };
    index.map(|i| &outputs[i].name).ok_or_else(|| {
        format!(
            "has several outputs that could be the image: {}; say which in MODEL.onnx.toml beside it: `output = \"NAME\"` or `output = INDEX`, counted from 0",
            list(outputs)
        )
    })
}

/// The one image output with a telling name.
///
/// An exporter that is given fewer names than there are outputs spends them from the first on and numbers the rest:
/// `output` is then the first output, whatever that is (of Zero-DCE, the wrong one). So a name at the first place tells
/// something only where the others have names too.
fn by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let named = |i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str());
    let mut telling = images.iter().copied().filter(named);
    let one = telling.next().filter(|_| telling.next().is_none())?;
    let named_by_hand = one > 0 || !outputs.iter().any(|port| is_numbered(&port.name));
    named_by_hand.then_some(one)
}

/// Whether an exporter made up this name: a number, a path of modules, or an operator's name.
fn is_numbered(name: &str) -> bool {
    const OPERATORS: [&str; 19] = [
        "add", "cat", "clamp", "clip", "concat", "conv", "conv2d", "div", "getitem", "identity",
        "max", "min", "mul", "pow", "relu", "sigmoid", "slice", "sub", "tanh",
    ];
    let word = name
        .trim_end_matches(|c: char| c.is_ascii_digit() || c == '_')
        .to_ascii_lowercase();
    word.is_empty() || name.contains(['/', ':', '.']) || OPERATORS.contains(&word.as_str())
}

/// The second of Zero-DCE's three outputs, which is the image whatever their names are.
///
/// `enhance_net_nopool.forward` of <https://github.com/Li-Chongyi/Zero-DCE> returns the image after four curves, the
/// image after all eight, and the 8 × 3 = 24 channels of the curves themselves. No other published model has this shape.
fn by_structure(outputs: &[Port]) -> Option<usize> {
    let channels: Vec<Option<usize>> = outputs
        .iter()
        .map(|port| port.dims.get(1).and_then(Dim::known))
        .collect();
    (channels == [Some(3), Some(3), Some(24)]).then_some(1)
}

fn list(ports: &[Port]) -> String {
    if ports.is_empty() {
        return "none".to_owned();
    }
    let ports: Vec<String> = ports.iter().map(Port::to_string).collect();
    ports.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A float32 port; a dimension of 0 is a free one.
    fn port(name: &str, dims: &[usize]) -> Port {
        let dim = |size: &usize| match size {
            0 => Dim::Free("n".into()),
            known => Dim::Known(*known),
        };
        Port {
            name: name.into(),
            element: Element::Float32,
            dims: dims.iter().map(dim).collect(),
        }
    }

    fn image(name: &str) -> Port {
        port(name, &[1, 3, 0, 0])
    }

    fn curves(name: &str) -> Port {
        port(name, &[1, 24, 0, 0])
    }

    fn choose(outputs: &[Port]) -> Result<String, String> {
        Signature::of(&[image("input")], outputs, None).map(|signature| signature.output)
    }

    #[test]
    fn the_only_image_is_taken_whatever_its_name() {
        let cases = [
            vec![image("758")],
            vec![curves("a"), image("758")],
            vec![port("scalar", &[1]), image("758")],
            vec![port("758", &[0, 0, 0, 0])],
            vec![port("758", &[])],
        ];
        for outputs in cases {
            assert_eq!(choose(&outputs), Ok("758".into()), "{}", list(&outputs));
        }
    }

    #[test]
    fn among_several_a_telling_name_decides() {
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
    fn zero_dce_gives_its_second_output_under_any_name() {
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
    fn what_could_ruin_pixels_is_left_to_the_user() {
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
        // Names and structure that contradict each other.
        let outputs = [image("enhanced"), image("half"), curves("r")];
        assert!(choose(&outputs).is_err());
    }

    #[test]
    fn a_stated_output_is_taken_where_it_can_be_an_image() {
        let outputs = [image("1"), image("2"), curves("3")];
        let stated =
            |choice: OutputChoice| Signature::of(&[image("input")], &outputs, Some(&choice));
        assert_eq!(stated(OutputChoice::Index(0)).unwrap().output, "1");
        assert_eq!(stated(OutputChoice::Name("2".into())).unwrap().output, "2");
        for (choice, part) in [
            (OutputChoice::Index(3), "does not have"),
            (OutputChoice::Name("x".into()), "does not have"),
            (OutputChoice::Index(2), "none of its image outputs"),
        ] {
            let message = stated(choice).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn fixed_sizes_are_read_and_have_to_agree() {
        let fixed = port("in", &[1, 3, 96, 128]);
        let signature = Signature::of(
            std::slice::from_ref(&fixed),
            &[port("out", &[0, 0, 96, 0])],
            None,
        )
        .unwrap();
        assert_eq!((signature.height, signature.width), (Some(96), Some(128)));
        for dims in [[1, 3, 48, 64], [1, 3, 0, 64]] {
            assert!(
                Signature::of(std::slice::from_ref(&fixed), &[port("out", &dims)], None).is_err()
            );
        }
    }

    #[test]
    fn other_conventions_are_refused_by_name() {
        let half = Port {
            element: Element::Other("float16".into()),
            ..image("half")
        };
        let cases = [
            (vec![], "0 inputs"),
            (vec![image("a"), port("exposure", &[1])], "2 inputs"),
            (vec![half], "float16"),
            (vec![port("a", &[1, 0, 0, 3])], "NHWC"),
            (vec![port("a", &[3, 0, 0])], "no NCHW image"),
            (vec![port("a", &[1, 1, 0, 0])], "no NCHW image"),
            (vec![port("a", &[0, 0, 0, 0])], "no NCHW image"),
            (vec![port("a", &[2, 3, 0, 0])], "several images"),
            (vec![port("a", &[])], "no NCHW image"),
        ];
        for (inputs, part) in cases {
            let message = Signature::of(&inputs, &[image("out")], None).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn a_model_without_an_image_is_refused() {
        let outputs = [port("758", &[1, 85, 22, 22]), port("flat", &[1, 3])];
        let message = choose(&outputs).unwrap_err();
        assert!(
            message.contains("\"758\" (float32 [1, 85, 22, 22])"),
            "{message}"
        );
        assert!(choose(&[]).unwrap_err().ends_with("it has none"));
    }
}
