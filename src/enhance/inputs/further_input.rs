//! Input of a graph in addition to the image: [`FurtherInput`].
//!
//! Noise as an input of a model: [`normal_noise`].

use super::tensor::{FedImage, Tensor, TensorData};
use crate::conventions::sidecar::ADD;
use crate::conventions::{ElementType, ExtraValue, NoiseStatement, TensorLayout, preset};
use crate::graphs::{Dim, Port};
use darkqa_base::types::FrameId;
use darkqa_light::{Component, NoiseKey, Site};

/// An input in addition to the image, with its value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FurtherInput {
    /// Name, type and dimensions in the graph.
    pub(crate) port: Port,
    /// Value of the input.
    pub(crate) value: ExtraValue,
    /// Dimensions for channels, rows and columns; `None` for scalars and vectors.
    axes: Option<TensorAxes>,
}

/// Indices of a tensor's dimensions for channels, rows and columns.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TensorAxes {
    channels: Option<usize>,
    rows: usize,
    columns: usize,
}

impl TensorAxes {
    /// Axes of a tensor with the image's size; `None` for scalars, vectors and ranks that no layout has. A layout with
    /// one or three channels is preferred, then the layout of the image.
    fn for_port(port: &Port, image: TensorLayout) -> Option<Self> {
        if port.is_scalar() || vector_length(port).is_some() {
            return None;
        }
        if port.dims.len() == 2 {
            return Some(Self { channels: None, rows: 0, columns: 1 });
        }
        let layouts: Vec<TensorLayout> =
            std::iter::once(image).chain(TensorLayout::ALL).filter(|layout| layout.rank() == port.dims.len()).collect();
        let [channels, rows, columns] = layouts
            .iter()
            .find(|layout| matches!(port.dims[layout.axes()[0]].known(), Some(1 | 3)))
            .or(layouts.first())?
            .axes();
        Some(Self { channels: Some(channels), rows, columns })
    }

    /// Dimensions other than channels, rows and columns.
    fn others(self, port: &Port) -> impl Iterator<Item = &Dim> {
        let used = [self.channels, Some(self.rows), Some(self.columns)];
        port.dims.iter().enumerate().filter(move |(axis, _)| !used.contains(&Some(*axis))).map(|(_, dim)| dim)
    }

    /// True if the graph fixes both height and width.
    fn has_fixed_size(self, port: &Port) -> bool {
        [self.rows, self.columns].iter().all(|axis| port.dims[*axis].known().is_some())
    }

    /// Number of channels; `None` if the graph does not fix it.
    fn channels(self, port: &Port) -> Option<usize> {
        match self.channels {
            Some(axis) => port.dims[axis].known(),
            None => Some(1),
        }
    }
}

impl FurtherInput {
    /// Creates the input with its value from the sidecar or preset. `image` is the layout of the image input.
    ///
    /// # Errors
    /// If the value is missing or does not fit the port. The message is to be printed after the file's name.
    pub(crate) fn new(
        port: &Port,
        value: Option<&ExtraValue>,
        image: TensorLayout,
        image_takes_any_side: bool,
    ) -> Result<Self, String> {
        let axes = TensorAxes::for_port(port, image);
        if let Some(axes) = axes
            && axes.has_fixed_size(port)
            && image_takes_any_side
        {
            return Err(format!(
                "takes {port} in addition to the image, a tensor of a fixed size that is not the image's; export the model with its values as constants"
            ));
        }
        let value = value.ok_or_else(|| missing_value_message(port, axes))?;
        let input = Self { port: port.clone(), value: value.clone(), axes };
        input.check().map_err(|problem| {
            format!("takes {port}; MODEL.onnx.toml or the preset sets it to {value}, but {problem}")
        })?;
        Ok(input)
    }

    /// Checks that the value fits the type and dimensions of the port.
    fn check(&self) -> Result<(), String> {
        let key = toml_key(&self.port.name);
        if let Some(axes) = self.axes
            && let Some(other) = axes.others(&self.port).find(|dim| !dim.can_be(1))
        {
            return Err(format!("its dimension of {other} is neither channels, height nor width"));
        }
        let takes_list = vector_length(&self.port).is_some_and(|length| length > 1);
        match (&self.value, self.axes) {
            (ExtraValue::Number(number), None) if !takes_list => {
                TensorData::repeated(&self.port.element, *number, 1).map(drop)
            }
            (ExtraValue::Map(number), Some(_)) => TensorData::repeated(&self.port.element, *number, 1).map(drop),
            (ExtraValue::List(numbers), None) => {
                let length = vector_length(&self.port).unwrap_or(1);
                if numbers.len() != length {
                    return Err(format!("it takes {length} numbers: {}", list_line(&key, length)));
                }
                TensorData::from_numbers(&self.port.element, numbers).map(drop)
            }
            (_, None) if takes_list => {
                let length = vector_length(&self.port).unwrap_or(1);
                Err(format!("it takes a list of {length} numbers: {}", list_line(&key, length)))
            }
            (ExtraValue::List(_), Some(_)) => {
                Err(format!("it has the image's size; `{key} = {{ map = NUMBER }}` gives every pixel one number"))
            }
            (ExtraValue::Number(number), Some(_)) => {
                Err(format!("it has the image's size; `{key} = {{ map = {number} }}` gives every pixel this number"))
            }
            (_, None) => Err(format!("it takes a single number: `{key} = NUMBER`")),
            (ExtraValue::Noise(_) | ExtraValue::From(_), Some(_))
                if TensorData::from_floats(&self.port.element, Vec::new()).is_none() =>
            {
                Err(format!("its type {} cannot hold such values; export it as float32", self.port.element))
            }
            (ExtraValue::Noise(_), Some(_)) => Ok(()),
            (ExtraValue::From(expression), Some(axes)) => {
                let result_channels = expression.channels(&vec![3; expression.names().len()]);
                match (axes.channels(&self.port), result_channels) {
                    (None | Some(3), _) | (Some(1), 1) => Ok(()),
                    (Some(1), _) => {
                        Err("this has three channels, and it takes one; wrap the expression in mean(…) or max(…)"
                            .to_owned())
                    }
                    (Some(other), _) => Err(format!("it takes {other} channels, and this has {result_channels}")),
                }
            }
        }
    }

    /// Checks that the input can be computed for the tile or whole image `fed`.
    ///
    /// # Errors
    /// If `fed` is a tile and the input is noise of a reduced size, which cannot be cut into tiles.
    pub(crate) fn check_tileable(&self, fed: &FedImage<'_>) -> Result<(), String> {
        match &self.value {
            ExtraValue::Noise(noise) if noise.divide != 1 && !fed.is_whole() => Err(format!(
                "takes noise of the image's size divided by {} ({:?}), which cannot be cut into tiles; leave out --llie-options tile, or enhance images of a size that the model takes",
                noise.divide, self.port.name
            )),
            _ => Ok(()),
        }
    }

    /// Value of the input for the tile or whole image `fed`; `None` if the sidecar's expression gives values that are
    /// not finite.
    pub(crate) fn tensor(&self, fed: &FedImage<'_>) -> Option<Tensor> {
        let Some(axes) = self.axes else {
            if let ExtraValue::List(numbers) = &self.value {
                return Some(Tensor {
                    dims: self.fixed_dims(),
                    data: TensorData::from_numbers(&self.port.element, numbers).ok()?,
                });
            }
            return self.constant_tensor(vec![1; self.port.dims.len()]);
        };
        let channels = axes.channels(&self.port);
        match &self.value {
            ExtraValue::Number(_) | ExtraValue::List(_) | ExtraValue::Map(_) => {
                self.constant_tensor(self.dims(axes, channels.unwrap_or(1), fed.size()))
            }
            ExtraValue::Noise(noise) => {
                let channels = channels.unwrap_or(1);
                let size = fed.size().map(|side| side.div_ceil(noise.divide));
                let planes = normal_noise(noise, &self.port.name, channels, fed);
                self.arrange_planes(axes, channels, size, planes)
            }
            ExtraValue::From(expression) => {
                let planes = fed.planes();
                let images = vec![&*planes; expression.names().len()];
                let mut image = expression.evaluate(&images, fed.size());
                if channels == Some(3) {
                    image = image.spread();
                }
                let [height, width] = fed.size();
                let channels = image.samples.len() / (height * width).max(1);
                if !image.samples.iter().all(|sample| sample.is_finite()) {
                    return None;
                }
                self.arrange_planes(axes, channels, fed.size(), image.samples)
            }
        }
    }

    /// Tensor of these dimensions filled with the value; `None` if the value is not a single number.
    fn constant_tensor(&self, dims: Vec<usize>) -> Option<Tensor> {
        let (ExtraValue::Number(number) | ExtraValue::Map(number)) = self.value else {
            return None;
        };
        let data = TensorData::repeated(&self.port.element, number, dims.iter().product()).ok()?;
        Some(Tensor { dims, data })
    }

    /// Dimensions of the port, with 1 for dynamic ones.
    fn fixed_dims(&self) -> Vec<usize> {
        self.port.dims.iter().map(|dim| dim.known().unwrap_or(1)).collect()
    }

    /// Dimensions for an image of this size; other dynamic dimensions are 1.
    fn dims(&self, axes: TensorAxes, channels: usize, [height, width]: [usize; 2]) -> Vec<usize> {
        let mut dims = self.fixed_dims();
        if let Some(axis) = axes.channels {
            dims[axis] = channels;
        }
        dims[axes.rows] = height;
        dims[axes.columns] = width;
        dims
    }

    /// Converts planar samples to the order of the tensor's dimensions; `None` if the port's type is not a float type.
    fn arrange_planes(&self, axes: TensorAxes, channels: usize, size: [usize; 2], planes: Vec<f32>) -> Option<Tensor> {
        let plane = size[0] * size[1];
        let is_planar = axes.channels.is_none_or(|axis| axis < axes.rows);
        let values = if is_planar || channels == 1 {
            planes
        } else {
            (0..plane)
                .flat_map(|pixel| (0..channels).map(move |c| (c, pixel)))
                .map(|(c, pixel)| planes[c * plane + pixel])
                .collect()
        };
        Some(Tensor {
            dims: self.dims(axes, channels, size),
            data: TensorData::from_floats(&self.port.element, values)?,
        })
    }
}

/// Length of a vector; `None` if the port is not a vector. The dimensions of a vector are fixed, and exactly one is
/// above 1.
fn vector_length(port: &Port) -> Option<usize> {
    let sizes = port.dims.iter().map(Dim::known).collect::<Option<Vec<usize>>>()?;
    let long = sizes.iter().filter(|size| **size > 1).count();
    (long == 1).then(|| sizes.iter().product())
}

/// Sidecar line for a list of numbers.
fn list_line(key: &str, length: usize) -> String {
    let shown = vec!["NUMBER"; length.min(4)].join(", ");
    let rest = if length > 4 { ", …" } else { "" };
    format!("`{key} = [{shown}{rest}]`")
}

/// Message about an input without a value, with sidecar lines that would set it.
fn missing_value_message(port: &Port, axes: Option<TensorAxes>) -> String {
    let key = toml_key(&port.name);
    let add = format!("{ADD}, below `[extra]`:");
    let known =
        preset::known_number(&port.name).filter(|(number, _)| TensorData::repeated(&port.element, *number, 1).is_ok());
    let Some(axes) = axes else {
        if let ElementType::Other(_) = port.element {
            return format!(
                "takes {port} in addition to the image, an unsupported type; export the model with its value as a constant"
            );
        }
        let line = match (known, &port.element) {
            _ if vector_length(port).is_some_and(|length| length > 1) => {
                let length = vector_length(port).unwrap_or(1);
                format!(
                    "{} (as in the model's code); if it is computed from the image, as a histogram is, export the model with that computation",
                    list_line(&key, length)
                )
            }
            (Some((value, preset)), _) => format!("`{key} = {value}` (as in preset {preset})"),
            (None, ElementType::Bool) => format!("`{key} = true` or `{key} = false`"),
            (None, _) => format!("`{key} = NUMBER` (as in the model's code)"),
        };
        return format!("takes {port} in addition to the image, and its value is unknown; {add} {line}");
    };
    if is_attention_map(&port.name.to_lowercase()) {
        return format!(
            "takes {port} in addition to the image, probably computed from it; {add} its formula, such as `{key} = {{ from = \"1 - max(image)\" }}`; a blur or a maximum over all pixels must be part of the export"
        );
    }
    let number = known.map_or("NUMBER".to_owned(), |(value, _)| value.to_string());
    let extent = match axes.channels(port) {
        Some(1) => "one channel",
        Some(3) => "three channels",
        _ => "the image's size",
    };
    format!(
        "takes {port} in addition to the image, of {extent}; {add} `{key} = {{ map = {number} }}` (one number for all pixels), `{key} = {{ noise = \"normal\", std = NUMBER, seed = 0 }}` or `{key} = {{ from = \"EXPRESSION\" }}` (of `image`)"
    )
}

/// Substrings in the names of inputs that are usually computed from the image.
const ATTENTION: [&str; 4] = ["mask", "gray", "grey", "att"];

/// True if an input's name suggests noise or a map computed from the image, not the image itself.
pub(crate) fn is_map_or_noise(name: &str) -> bool {
    let name = name.to_lowercase();
    is_attention_map(&name) || name == "z" || name.contains("noise")
}

fn is_attention_map(lower_case_name: &str) -> bool {
    ATTENTION.iter().any(|word| lower_case_name.contains(word))
}

/// A name as a TOML key, in quotes if needed.
fn toml_key(name: &str) -> String {
    if !name.is_empty() && name.chars().all(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        name.to_owned()
    } else {
        format!("{name:?}")
    }
}

/// Normally distributed noise for the input `name`, in planar order, of the image's size divided by `divide`.
///
/// Each number is a function of the seed, the whole degraded image, the input's name, and its channel, row and column
/// in the noise field of the whole image. So the noise does not depend on threads, and a tile gets the corresponding
/// part of the field.
fn normal_noise(statement: &NoiseStatement, name: &str, channels: usize, fed: &FedImage<'_>) -> Vec<f32> {
    let frame = FrameId(format!("{} {name}", fed.digest()));
    let stream = NoiseKey::new(statement.seed, &frame).stream(Component::ModelInput);
    let [height, width] = fed.size().map(|side| side.div_ceil(statement.divide));
    let [top, left] = fed.origin();
    let mut samples = vec![0.0; channels * height * width];
    for row in 0..height {
        for column in 0..width {
            let mut words = stream.at(Site::new(top + row, left + column));
            for channel in 0..channels {
                let value = statement.std * words.normal();
                samples[(channel * height + row) * width + column] = value as f32;
            }
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::Padding;
    use crate::inputs::tensor::DegradedImage;
    use crate::sizing::TileWindow;
    use darkqa_base::types::Rgb;

    const NOISE: NoiseStatement = NoiseStatement { std: 0.5, seed: 3, divide: 1 };

    fn draw(statement: &NoiseStatement, name: &str, rgb: &Rgb, window: TileWindow) -> Vec<f32> {
        let dark = DegradedImage::new(rgb);
        let fed = FedImage::Window { dark: &dark, window, pad: Padding::Reflect };
        normal_noise(statement, name, 2, &fed)
    }

    fn window(left: usize, right: usize) -> TileWindow {
        TileWindow { left, top: 0, right, bottom: 40 }
    }

    #[test]
    fn noise_of_a_tile_is_part_of_the_whole_field() {
        let rgb = Rgb::black(40, 60);
        let whole = draw(&NOISE, "z", &rgb, window(0, 60));
        let part = draw(&NOISE, "z", &rgb, window(10, 30));
        for (line, whole) in part.chunks_exact(20).zip(whole.chunks_exact(60)) {
            assert_eq!(line, &whole[10..30]);
        }
    }

    #[test]
    fn noise_depends_on_seed_name_and_image() {
        let rgb = Rgb::black(40, 60);
        let first = draw(&NOISE, "z", &rgb, window(0, 60));
        assert_eq!(first, draw(&NOISE, "z", &rgb, window(0, 60)));
        let seeded = NoiseStatement { seed: 4, ..NOISE };
        let mut other = Rgb::black(40, 60);
        other.samples_mut()[7] = 1;
        for different in [
            draw(&seeded, "z", &rgb, window(0, 60)),
            draw(&NOISE, "y", &rgb, window(0, 60)),
            draw(&NOISE, "z", &other, window(0, 60)),
        ] {
            let equal = first.iter().zip(&different).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
            assert!(equal < 10);
        }
        assert_ne!(first[..2400], first[2400..]);
    }

    #[test]
    fn noise_has_the_stated_size_and_deviation() {
        let rgb = Rgb::black(40, 60);
        let divided = NoiseStatement { divide: 8, ..NOISE };
        assert_eq!(draw(&divided, "z", &rgb, window(0, 60)).len(), 2 * 5 * 8);
        let none = NoiseStatement { std: 0.0, ..NOISE };
        let none = draw(&none, "z", &rgb, window(0, 60));
        assert!(none.iter().all(|x| x.abs() == 0.0));
        let numbers = draw(&NOISE, "z", &rgb, window(0, 60));
        let n = numbers.len() as f32;
        let mean = numbers.iter().sum::<f32>() / n;
        let variance = numbers.iter().map(|x| x * x).sum::<f32>() / n;
        // Bounds are five standard errors for 4800 numbers.
        assert!(mean.abs() < 5.0 * 0.5 / n.sqrt(), "{mean}");
        assert!((variance - 0.25).abs() < 5.0 * 0.25 * (2.0 / n).sqrt(), "{variance}");
    }
}
