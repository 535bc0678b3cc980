//! ONNX files made by hand: a writer of as much protobuf as a `ModelProto` needs, and the models of the tests.
//!
//! Field numbers are those of `onnx/onnx.proto`.

use std::path::{Path, PathBuf};

/// One protobuf message that is being written.
#[derive(Default, Clone)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value > 127 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn int(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    fn message(self, field: u64, value: &Self) -> Self {
        self.bytes(field, &value.0)
    }
}

/// A size in a shape.
#[derive(Clone, Copy)]
pub enum Size {
    Known(u64),
    Named(&'static str),
}

use Size::{Known, Named};

/// `TensorProto.DataType`
#[derive(Clone, Copy)]
pub enum Type {
    Float = 1,
    Byte = 2,
    Int = 6,
    Long = 7,
    Bool = 9,
    Half = 10,
    Double = 11,
}

/// The value of an attribute of an operator.
pub enum Attribute {
    Int(u64),
    Ints(&'static [u64]),
    Body(Graph),
}

/// 1 × channels × height × width of any size.
fn image(channels: u64) -> [Size; 4] {
    [Known(1), Known(channels), Named("height"), Named("width")]
}

/// A model that is being made.
#[derive(Clone)]
pub struct Graph {
    nodes: Vec<Message>,
    constants: Vec<Message>,
    inputs: Vec<Message>,
    outputs: Vec<Message>,
}

impl Graph {
    fn empty() -> Self {
        Self { nodes: Vec::new(), constants: Vec::new(), inputs: Vec::new(), outputs: Vec::new() }
    }

    /// A graph with the input `input`, an image of any size.
    pub fn new() -> Self {
        Self::empty().input("input", Type::Float, &image(3))
    }

    fn port(name: &str, element: Type, shape: &[Size]) -> Message {
        let dims = shape.iter().fold(Message::default(), |dims, size| match size {
            Known(size) => dims.message(1, &Message::default().int(1, *size)),
            Named(name) => dims.message(1, &Message::default().bytes(2, name.as_bytes())),
        });
        let tensor = Message::default().int(1, element as u64).message(2, &dims);
        Message::default().bytes(1, name.as_bytes()).message(2, &Message::default().message(1, &tensor))
    }

    pub fn input(mut self, name: &str, element: Type, shape: &[Size]) -> Self {
        self.inputs.push(Self::port(name, element, shape));
        self
    }

    pub fn output(mut self, name: &str, element: Type, shape: &[Size]) -> Self {
        self.outputs.push(Self::port(name, element, shape));
        self
    }

    /// A float initialiser.
    pub fn constant(mut self, name: &str, shape: &[u64], values: &[f32]) -> Self {
        let dims = shape.iter().fold(Message::default(), |tensor, size| tensor.int(1, *size));
        let raw: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let tensor = dims.int(2, 1).bytes(8, name.as_bytes()).bytes(9, &raw);
        self.constants.push(tensor);
        self
    }

    /// An initialiser of 64-bit integers.
    pub fn shape(mut self, name: &str, values: &[i64]) -> Self {
        let raw: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let tensor = Message::default().int(1, values.len() as u64).int(2, 7);
        self.constants.push(tensor.bytes(8, name.as_bytes()).bytes(9, &raw));
        self
    }

    /// A float initialiser whose values lie in another file.
    pub fn external(mut self, name: &str, shape: &[u64], file: &str) -> Self {
        let dims = shape.iter().fold(Message::default(), |tensor, size| tensor.int(1, *size));
        let entry = Message::default().bytes(1, b"location").bytes(2, file.as_bytes());
        let tensor = dims.int(2, 1).bytes(8, name.as_bytes()).message(13, &entry).int(14, 1);
        self.constants.push(tensor);
        self
    }

    /// An operator without attributes.
    pub fn node(self, operator: &str, inputs: &[&str], output: &str) -> Self {
        self.node_with(operator, inputs, output, &[])
    }

    /// An operator with attributes.
    pub fn node_with(
        mut self,
        operator: &str,
        inputs: &[&str],
        output: &str,
        attributes: &[(&str, Attribute)],
    ) -> Self {
        let node = inputs.iter().fold(Message::default(), |node, name| node.bytes(1, name.as_bytes()));
        let node = node.bytes(2, output.as_bytes()).bytes(4, operator.as_bytes());
        let node = attributes.iter().fold(node, |node, (name, value)| {
            let attribute = Message::default().bytes(1, name.as_bytes());
            let attribute = match value {
                Attribute::Int(value) => attribute.int(3, *value).int(20, 2),
                Attribute::Ints(values) => {
                    let listed = values.iter().fold(attribute, |a, value| a.int(8, *value));
                    listed.int(20, 7)
                }
                Attribute::Body(body) => attribute.message(6, &body.message()).int(20, 5),
            };
            node.message(5, &attribute)
        });
        self.nodes.push(node);
        self
    }

    fn message(&self) -> Message {
        let graph = Message::default();
        let graph = self.nodes.iter().fold(graph, |g, node| g.message(1, node));
        let graph = graph.bytes(2, b"graph");
        let graph = self.constants.iter().fold(graph, |g, c| g.message(5, c));
        let graph = self.inputs.iter().fold(graph, |g, port| g.message(11, port));
        self.outputs.iter().fold(graph, |g, port| g.message(12, port))
    }

    /// The bytes of an ONNX file: IR version 8, operator set 13.
    pub fn model(&self) -> Vec<u8> {
        self.model_of(8, 13)
    }

    /// The bytes of an ONNX file of an IR version and an operator set.
    pub fn model_of(&self, ir_version: u64, operators: u64) -> Vec<u8> {
        let opset = Message::default().bytes(1, b"").int(2, operators);
        let model = Message::default().int(1, ir_version).bytes(2, b"darkqa-eval");
        model.message(7, &self.message()).message(8, &opset).0
    }

    /// Writes the model into a folder.
    pub fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, self.model()).unwrap();
        path
    }

    /// The model with the output `output`, an image of any size.
    fn giving_image(self) -> Self {
        self.output("output", Type::Float, &image(3))
    }
}

/// The image as it is.
pub fn identity() -> Graph {
    Graph::new().node("Identity", &["input"], "output").giving_image()
}

/// Every sample times a number.
pub fn gain(factor: f32) -> Graph {
    Graph::new().constant("factor", &[], &[factor]).node("Mul", &["input", "factor"], "output").giving_image()
}

/// Every sample to a power.
pub fn gamma(exponent: f32) -> Graph {
    Graph::new().constant("exponent", &[], &[exponent]).node("Pow", &["input", "exponent"], "output").giving_image()
}

/// A model with the outputs of Zero-DCE: a wrong image (black), the image doubled, and 24 channels.
pub fn three_outputs(names: [&str; 3]) -> Graph {
    Graph::new()
        .constant("zero", &[], &[0.0])
        .node("Mul", &["input", "zero"], names[0])
        .node("Add", &["input", "input"], names[1])
        .node_with("Concat", &["input"; 8], names[2], &[("axis", Attribute::Int(1))])
        .output(names[0], Type::Float, &image(3))
        .output(names[1], Type::Float, &image(3))
        .output(names[2], Type::Float, &image(24))
}

/// Two images under names that say nothing: black, and the image doubled.
pub fn two_outputs() -> Graph {
    Graph::new()
        .constant("zero", &[], &[0.0])
        .node("Mul", &["input", "zero"], "17")
        .node("Add", &["input", "input"], "18")
        .output("17", Type::Float, &image(3))
        .output("18", Type::Float, &image(3))
}

/// The image as it is, of one size only.
pub fn fixed(height: u64, width: u64) -> Graph {
    let shape = [Known(1), Known(3), Known(height), Known(width)];
    Graph::empty().input("input", Type::Float, &shape).node("Identity", &["input"], "output").output(
        "output",
        Type::Float,
        &shape,
    )
}

/// The same graph for images of one size, which may be another batch.
pub fn of_size(graph: &Graph, batch: u64, [height, width]: [u64; 2]) -> Graph {
    let shape = [Known(batch), Known(3), Known(height), Known(width)];
    Graph {
        inputs: vec![Graph::port("input", Type::Float, &shape)],
        outputs: vec![Graph::port("output", Type::Float, &shape)],
        ..graph.clone()
    }
}

/// The image as it is, frozen by tracing: it says any size, and takes 48 × 64 alone.
pub fn traced() -> Graph {
    Graph::new()
        .shape("windows", &[1, 3, 6, 8, 8, 8])
        .shape("whole", &[1, 3, 48, 64])
        .node("Reshape", &["input", "windows"], "cut")
        .node("Reshape", &["cut", "whole"], "output")
        .giving_image()
}

/// The image enlarged by two.
pub fn doubled() -> Graph {
    let shape = [Known(1), Known(3), Named("double_height"), Named("double_width")];
    let blocks = [("blocksize", Attribute::Int(2))];
    Graph::new()
        .node_with("Concat", &["input"; 4], "deep", &[("axis", Attribute::Int(1))])
        .node_with("DepthToSpace", &["deep"], "output", &blocks)
        .output("output", Type::Float, &shape)
}

/// The mean of the image and of 2³⁰ others like it.
pub fn of_much_memory() -> Graph {
    Graph::new()
        .shape("many", &[1 << 30, 3, 1, 1])
        .node("Expand", &["input", "many"], "large")
        .node_with("ReduceMean", &["large"], "output", &[("axes", Attribute::Ints(&[0]))])
        .giving_image()
}

/// The image, and a product of 400 constant matrices that is computed when the model is loaded: minutes.
pub fn slow_to_load() -> Graph {
    let names: Vec<String> = (0..=400).map(|at| format!("m{at}")).collect();
    let graph = Graph::new().shape("square", &[2048, 2048]).node("ConstantOfShape", &["square"], "m0");
    let products = names.windows(2).fold(graph, |graph, pair| graph.node("MatMul", &[&pair[0], &pair[0]], &pair[1]));
    products
        .node_with("ReduceMax", &["m400"], "most", &[("keepdims", Attribute::Int(0))])
        .node("Add", &["input", "most"], "output")
        .giving_image()
}

/// The image after 2⁴⁰ turns of a loop where it is brighter than a half, and after one where it is not.
pub fn endless_if_bright() -> Graph {
    endless_if_bright_from(&[1, 1])
}

/// The same, for images of at least this height and width; it fails on smaller ones.
pub fn endless_if_bright_from(size: &'static [u64]) -> Graph {
    let body = Graph::empty()
        .input("turn", Type::Long, &[])
        .input("goes_on", Type::Bool, &[])
        .input("before", Type::Float, &image(3))
        .node("Identity", &["is_bright"], "still")
        .node("Identity", &["before"], "after")
        .output("still", Type::Bool, &[])
        .output("after", Type::Float, &image(3));
    Graph::new()
        .shape("turns", &[1 << 40])
        .constant("half", &[], &[0.5])
        .node_with("MaxPool", &["input"], "pooled", &[("kernel_shape", Attribute::Ints(size))])
        .node_with("ReduceMax", &["pooled"], "most", &[("keepdims", Attribute::Int(0))])
        .node("Greater", &["most", "half"], "is_bright")
        .node_with("Loop", &["turns", "is_bright", "input"], "output", &[("body", Attribute::Body(body))])
        .giving_image()
}

/// The image as it is, of such a type and shape.
pub fn shaped(element: Type, shape: &[Size]) -> Graph {
    Graph::empty()
        .input("input", element, shape)
        .node("Identity", &["input"], "output")
        .output("output", element, shape)
}

/// Every pixel the mean of the 5 × 5 around it.
pub fn blurred() -> Graph {
    Graph::new()
        .node_with(
            "AveragePool",
            &["input"],
            "output",
            &[("kernel_shape", Attribute::Ints(&[5, 5])), ("pads", Attribute::Ints(&[2, 2, 2, 2]))],
        )
        .giving_image()
}

/// The image and its mean, added.
pub fn mean_added() -> Graph {
    Graph::new()
        .node_with("ReduceMean", &["input"], "mean", &[("axes", Attribute::Ints(&[2, 3]))])
        .node("Add", &["input", "mean"], "output")
        .giving_image()
}

/// The image as it is, where its sides are multiples of eight.
pub fn of_eights() -> Graph {
    of_multiples(8)
}

/// The image as it is, where its sides are multiples of a number.
pub fn of_multiples(multiple: u64) -> Graph {
    let blocks = [("blocksize", Attribute::Int(multiple))];
    Graph::new()
        .node_with("SpaceToDepth", &["input"], "deep", &blocks)
        .node_with("DepthToSpace", &["deep"], "output", &blocks)
        .giving_image()
}

/// The image, its codes from `low` to `high` where they go in from 0 to 1.
pub fn ranged(low: f32, high: f32) -> Graph {
    Graph::new()
        .constant("span", &[], &[high - low])
        .constant("low", &[], &[low])
        .node("Mul", &["input", "span"], "spread")
        .node("Add", &["spread", "low"], "output")
        .giving_image()
}

/// A model with a single output, of the eight-fold channels.
pub fn no_image() -> Graph {
    Graph::new().node_with("Concat", &["input"; 8], "curves", &[("axis", Attribute::Int(1))]).output(
        "curves",
        Type::Float,
        &image(24),
    )
}

/// A second input beside the image.
pub fn two_inputs() -> Graph {
    Graph::new()
        .input("exposure", Type::Float, &[Known(1)])
        .node("Mul", &["input", "exposure"], "output")
        .giving_image()
}

/// Half of the image, under a shape that does not say so.
pub fn halved() -> Graph {
    let shape = [Known(1), Known(3), Named("half_height"), Named("half_width")];
    Graph::new()
        .node_with(
            "MaxPool",
            &["input"],
            "output",
            &[("kernel_shape", Attribute::Ints(&[2, 2])), ("strides", Attribute::Ints(&[2, 2]))],
        )
        .output("output", Type::Float, &shape)
}

/// 0/0 wherever the image is black.
pub fn not_a_number() -> Graph {
    Graph::new().node("Div", &["input", "input"], "output").giving_image()
}

/// The image and a weight of the given value, added `1e38` times over: nothing, where the weight counts as zero.
pub fn weight(value: f32) -> Graph {
    Graph::new()
        .constant("weight", &[1, 3, 1, 1], &[value; 3])
        .constant("huge", &[], &[1e38])
        .node("Mul", &["weight", "huge"], "large")
        .node("Add", &["input", "large"], "output")
        .giving_image()
}

/// The same, with the number `1e38` in another file.
pub fn weight_times_external(value: f32, file: &str) -> Graph {
    Graph::new()
        .constant("weight", &[1, 3, 1, 1], &[value; 3])
        .external("huge", &[1, 1, 1, 1], file)
        .node("Mul", &["weight", "huge"], "large")
        .node("Add", &["input", "large"], "output")
        .giving_image()
}

/// The gain lies in another file: four bytes, a little-endian float.
pub fn external_gain(file: &str) -> Graph {
    Graph::new().external("factor", &[1, 1, 1, 1], file).node("Mul", &["input", "factor"], "output").giving_image()
}

/// Automatic exposure in linear light, the enhancer in `models/gray-gain.onnx`; `src/docs/enhancers.md` says what it
/// computes.
pub fn gray_gain() -> Graph {
    // IEC 61966-2-1, both ways
    let decode = Graph::new()
        .constant("slope", &[], &[12.92])
        .constant("offset", &[], &[0.055])
        .constant("scale", &[], &[1.055])
        .constant("power", &[], &[2.4])
        .constant("knee", &[], &[0.04045])
        .node("Div", &["input", "slope"], "toe")
        .node("Add", &["input", "offset"], "raised")
        .node("Div", &["raised", "scale"], "scaled")
        .node("Pow", &["scaled", "power"], "shoulder")
        .node("Less", &["input", "knee"], "in_toe")
        .node("Where", &["in_toe", "toe", "shoulder"], "light");
    let expose = decode
        .constant("gray", &[], &[0.18])
        .constant("black", &[], &[1e-6])
        .constant("one", &[], &[1.0])
        .constant("cap", &[], &[512.0])
        .node_with("ReduceMean", &["light"], "mean", &[("axes", Attribute::Ints(&[1, 2, 3]))])
        .node("Max", &["mean", "black"], "mean_above_black")
        .node("Div", &["gray", "mean_above_black"], "wanted")
        .node("Clip", &["wanted", "one", "cap"], "gain")
        .node("Mul", &["light", "gain"], "bright")
        .node("Min", &["bright", "one"], "exposed");
    expose
        .constant("root", &[], &[1.0 / 2.4])
        .constant("linear_knee", &[], &[0.0031308])
        .node("Mul", &["exposed", "slope"], "encoded_toe")
        .node("Pow", &["exposed", "root"], "rooted")
        .node("Mul", &["rooted", "scale"], "stretched")
        .node("Sub", &["stretched", "offset"], "encoded_shoulder")
        .node("Less", &["exposed", "linear_knee"], "in_encoded_toe")
        .node("Where", &["in_encoded_toe", "encoded_toe", "encoded_shoulder"], "enhanced")
        .output("enhanced", Type::Float, &image(3))
}

/// An enhancer, the power 0.4 of each sample, that takes values from `low_in` to `high_in` and gives them from
/// `low_out` to `high_out`.
pub fn enhancer_in_ranges([low_in, high_in]: [f32; 2], [low_out, high_out]: [f32; 2]) -> Graph {
    Graph::new()
        .constant("low in", &[], &[low_in])
        .constant("span in", &[], &[high_in - low_in])
        .constant("zero", &[], &[0.0])
        .constant("exponent", &[], &[0.4])
        .constant("span out", &[], &[high_out - low_out])
        .constant("low out", &[], &[low_out])
        .node("Sub", &["input", "low in"], "from black")
        .node("Div", &["from black", "span in"], "unit")
        .node("Max", &["unit", "zero"], "light")
        .node("Pow", &["light", "exponent"], "enhanced")
        .node("Mul", &["enhanced", "span out"], "spread")
        .node("Add", &["spread", "low out"], "output")
        .giving_image()
}

/// What follows the power 0.4 of each sample, which is `enhanced`.
fn after_enhancing(then: impl FnOnce(Graph) -> Graph) -> Graph {
    let enhanced = Graph::new().constant("exponent", &[], &[0.4]).node("Pow", &["input", "exponent"], "enhanced");
    then(enhanced).giving_image()
}

/// An enhancer that gives blue first.
pub fn blue_first() -> Graph {
    after_enhancing(|graph| {
        let axis = [("axis", Attribute::Int(1))];
        graph.shape("order", &[2, 1, 0]).node_with("Gather", &["enhanced", "order"], "output", &axis)
    })
}

/// An enhancer that gives a negative.
pub fn negative() -> Graph {
    after_enhancing(|graph| graph.constant("white", &[], &[1.0]).node("Sub", &["white", "enhanced"], "output"))
}

/// An enhancer that gives a plain colour.
pub fn flat() -> Graph {
    after_enhancing(|graph| {
        let axes = [("axes", Attribute::Ints(&[2, 3]))];
        graph
            .constant("zero", &[], &[0.0])
            .node_with("ReduceMean", &["enhanced"], "mean", &axes)
            .node("Mul", &["enhanced", "zero"], "black")
            .node("Add", &["black", "mean"], "output")
    })
}

/// An enhancer whose packed pixels are called planes.
pub fn mislabelled() -> Graph {
    after_enhancing(|graph| {
        let packed = [("perm", Attribute::Ints(&[0, 2, 3, 1]))];
        graph.node_with("Transpose", &["enhanced"], "packed", &packed).node("Shape", &["enhanced"], "shape").node(
            "Reshape",
            &["packed", "shape"],
            "output",
        )
    })
}

/// The image times a further input, `factor`.
pub fn times_input(element: Type, shape: &[Size]) -> Graph {
    Graph::new()
        .input("factor", element, shape)
        .node_with("Cast", &["factor"], "number", &[("to", Attribute::Int(Type::Float as u64))])
        .node("Mul", &["input", "number"], "output")
        .giving_image()
}

/// The image times a plane of its size, a further input.
pub fn times_plane(name: &str) -> Graph {
    Graph::new().input(name, Type::Float, &image(1)).node("Mul", &["input", name], "output").giving_image()
}

/// The image and noise, added: three channels of its size.
pub fn plus_noise() -> Graph {
    Graph::new().input("z", Type::Float, &image(3)).node("Add", &["input", "z"], "output").giving_image()
}

/// The image and the mean of noise of another size, added.
pub fn plus_mean_of_noise() -> Graph {
    let shape = [Known(1), Known(4), Named("rows"), Named("columns")];
    let axes = [("axes", Attribute::Ints(&[1, 2, 3]))];
    Graph::new()
        .input("z", Type::Float, &shape)
        .node_with("ReduceMean", &["z"], "mean", &axes)
        .node("Add", &["input", "mean"], "output")
        .giving_image()
}

/// A plane times a number: a model of the luma.
pub fn luma_gain(factor: f32) -> Graph {
    Graph::empty()
        .input("input", Type::Float, &image(1))
        .constant("factor", &[], &[factor])
        .node("Mul", &["input", "factor"], "output")
        .output("output", Type::Float, &image(1))
}

/// An enhancer that adds a little noise of its own.
pub fn noisy() -> Graph {
    after_enhancing(|graph| {
        graph
            .constant("small", &[], &[0.01])
            .node("RandomNormalLike", &["enhanced"], "noise")
            .node("Mul", &["noise", "small"], "little")
            .node("Add", &["enhanced", "little"], "output")
    })
}

/// The map that an enhancer adds to the image.
pub fn residual() -> Graph {
    after_enhancing(|graph| graph.node("Sub", &["enhanced", "input"], "output"))
}

/// The map that an authors' script subtracts from the image.
pub fn subtracted() -> Graph {
    after_enhancing(|graph| graph.node("Sub", &["input", "enhanced"], "output"))
}

/// The factor in an authors' script.
pub fn gain_map() -> Graph {
    after_enhancing(|graph| {
        graph.constant("black", &[], &[1e-3]).node("Max", &["input", "black"], "lit").node(
            "Div",
            &["enhanced", "lit"],
            "output",
        )
    })
}

/// What an authors' script divides the image by, bright for black, too.
pub fn light_map() -> Graph {
    after_enhancing(|graph| {
        graph
            .constant("black", &[], &[1e-2])
            .node("Add", &["input", "black"], "above")
            .node("Add", &["enhanced", "black"], "below")
            .node("Div", &["above", "below"], "output")
    })
}

/// An enhancer that gives the brightest channel three times.
pub fn colourless() -> Graph {
    let axes = [("axes", Attribute::Ints(&[1]))];
    let axis = [("axis", Attribute::Int(1))];
    after_enhancing(|graph| {
        graph.node_with("ReduceMax", &["enhanced"], "luma", &axes).node_with(
            "Concat",
            &["luma", "luma", "luma"],
            "output",
            &axis,
        )
    })
}

/// An enhanced image, and a light map of its size.
pub fn light_beside() -> Graph {
    let axes = [("axes", Attribute::Ints(&[1]))];
    after_enhancing(|graph| {
        graph.node("Identity", &["enhanced"], "output").node_with("ReduceMax", &["input"], "L", &axes)
    })
    .output("L", Type::Float, &image(1))
}

/// An enhancer that takes values with a mean and a deviation for each channel.
pub fn normalised(mean: [f32; 3], std: [f32; 3]) -> Graph {
    brightened_from_normalised(mean, std, "output").giving_image()
}

/// An enhancer that takes and gives values with a mean and a deviation for each channel.
pub fn normalised_at_both_ends(mean: [f32; 3], std: [f32; 3]) -> Graph {
    brightened_from_normalised(mean, std, "enhanced")
        .node("Sub", &["enhanced", "mean"], "centred")
        .node("Div", &["centred", "std"], "output")
        .giving_image()
}

/// Nodes that take values with a mean and a deviation for each channel, and give the brightened values in [0, 1] under
/// a name.
fn brightened_from_normalised(mean: [f32; 3], std: [f32; 3], output: &str) -> Graph {
    Graph::new()
        .constant("mean", &[1, 3, 1, 1], &mean)
        .constant("std", &[1, 3, 1, 1], &std)
        .constant("zero", &[], &[0.0])
        .constant("exponent", &[], &[0.4])
        .node("Mul", &["input", "std"], "scaled")
        .node("Add", &["scaled", "mean"], "unit")
        .node("Max", &["unit", "zero"], "light")
        .node("Pow", &["light", "exponent"], output)
}

/// An image whose brightness follows from the last bits of a product over all pixels: of the 3 channels with 24 copies
/// of them.
pub fn product_over_pixels() -> Graph {
    Graph::new()
        .shape("rows", &[3, -1])
        .constant("many", &[], &[1e5])
        .constant("half", &[], &[0.5])
        .node("Reshape", &["input", "rows"], "queries")
        .node_with("Concat", &["queries"; 8], "keys", &[("axis", Attribute::Int(0))])
        .node("Transpose", &["keys"], "columns")
        .node("MatMul", &["queries", "columns"], "product")
        .node("ReduceSum", &["product"], "sum")
        .node("Mul", &["sum", "many"], "large")
        .node("Sin", &["large"], "sine")
        .node("Mul", &["sine", "half"], "swing")
        .node("Add", &["swing", "half"], "factor")
        .node("Mul", &["input", "factor"], "output")
        .giving_image()
}

/// The image as elements of another type.
pub fn cast(to: Type) -> Graph {
    Graph::new()
        .constant("white", &[], &[255.0])
        .node("Mul", &["input", "white"], "codes")
        .node_with("Cast", &["codes"], "output", &[("to", Attribute::Int(to as u64))])
        .output("output", to, &image(3))
}

/// Black planes around the image: seven channels; 4, 5 and 6 are the image.
pub fn seven_channels() -> Graph {
    let axis = [("axis", Attribute::Int(1))];
    let axes = [("axes", Attribute::Ints(&[1]))];
    Graph::new()
        .node_with("ReduceMax", &["input"], "light", &axes)
        .node_with("Concat", &["input", "light", "input"], "x", &axis)
        .output("x", Type::Float, &image(7))
}

/// The image twice: six channels.
pub fn six_channels() -> Graph {
    let axis = [("axis", Attribute::Int(1))];
    Graph::new().node_with("Concat", &["input", "input"], "x", &axis).output("x", Type::Float, &image(6))
}

/// The image `img` and a number, its loss, which is named as images are.
pub fn loss_beside() -> Graph {
    let axes = [("axes", Attribute::Ints(&[0, 1, 2, 3])), ("keepdims", Attribute::Int(0))];
    Graph::new()
        .node_with("ReduceMean", &["input"], "output", &axes)
        .node("Identity", &["input"], "img")
        .output("output", Type::Float, &[])
        .output("img", Type::Float, &image(3))
}

/// The image and a text embedding, a further input whose size is not the image's.
pub fn with_embedding() -> Graph {
    Graph::new()
        .input("text", Type::Float, &[Known(1), Known(77), Known(512)])
        .node("ReduceMean", &["text"], "mean")
        .node("Mul", &["input", "mean"], "output")
        .giving_image()
}

/// The image times three numbers, a further input.
pub fn times_vector() -> Graph {
    Graph::new()
        .input("alpha", Type::Float, &[Known(3)])
        .shape("shape", &[1, 3, 1, 1])
        .node("Reshape", &["alpha", "shape"], "factors")
        .node("Mul", &["input", "factors"], "output")
        .giving_image()
}

/// A network of a fixed size that sees 2 × 2 blocks: each pixel the mean of its block, so that tiles must start at even
/// places.
pub fn pooled(height: u64, width: u64) -> Graph {
    let pool = [("kernel_shape", Attribute::Ints(&[2, 2])), ("strides", Attribute::Ints(&[2, 2]))];
    let blocks = [("blocksize", Attribute::Int(2))];
    let shape = [Known(1), Known(3), Known(height), Known(width)];
    Graph::empty()
        .input("input", Type::Float, &shape)
        .node_with("AveragePool", &["input"], "small", &pool)
        .node_with("Concat", &["small"; 4], "deep", &[("axis", Attribute::Int(1))])
        .node_with("DepthToSpace", &["deep"], "output", &blocks)
        .output("output", Type::Float, &shape)
}

/// Light, which is the largest of the three channels, and reflectance, which is the image divided by it.
pub fn light_and_reflectance() -> Graph {
    let axes = [("axes", Attribute::Ints(&[1]))];
    Graph::new()
        .constant("black", &[], &[1e-3])
        .node_with("ReduceMax", &["input"], "largest", &axes)
        .node("Max", &["largest", "black"], "L")
        .node("Div", &["input", "L"], "R")
        .output("L", Type::Float, &image(1))
        .output("R", Type::Float, &image(3))
}
