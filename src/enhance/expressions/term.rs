//! Elements of a sidecar's expression and their values: [`StackElement`], [`PixelValue`].

use crate::conventions::LUMA;

/// Element of an expression in postfix order: pops its arguments from a stack and pushes one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StackElement {
    /// A number.
    Number(f32),
    /// Value of the name with this index among the expression's names.
    Name(usize),
    /// −a
    Negate,
    /// a + b
    Add,
    /// a − b
    Subtract,
    /// a · b
    Multiply,
    /// a / b
    Divide,
    /// a to the power of b; a negative base counts as 0.
    Power,
    /// Minimum of this number of arguments; for one argument, the minimum over its channels.
    Min(usize),
    /// Maximum of this number of arguments; for one argument, the maximum over its channels.
    Max(usize),
    /// The first argument, clamped to the range from the second to the third.
    Clip,
    /// Mean over the channels.
    Mean,
    /// Zero-DCE's curves: x ← x + a · (x² − x), applied for each further argument a in turn.
    Curves(usize),
}

/// Value of an expression at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PixelValue {
    /// One channel.
    One(f32),
    /// Red, green and blue.
    Three([f32; 3]),
}

impl PixelValue {
    /// The three channels; one channel is repeated.
    pub(super) fn spread(self) -> [f32; 3] {
        match self {
            Self::One(value) => [value; 3],
            Self::Three(values) => values,
        }
    }

    /// The luma of three channels ([`LUMA`]); one channel is its own luma.
    pub(crate) fn luma(self) -> f32 {
        match self {
            Self::One(value) => value,
            Self::Three([red, green, blue]) => {
                let weights = LUMA.map(|weight| weight as f32);
                weights[0] * red + weights[1] * green + weights[2] * blue
            }
        }
    }

    /// Applies a function to each channel.
    fn map(self, function: impl Fn(f32) -> f32) -> Self {
        match self {
            Self::One(value) => Self::One(function(value)),
            Self::Three(values) => Self::Three(values.map(function)),
        }
    }

    /// Applies a function to each pair of channels; one channel is broadcast to three if the other value has three.
    fn zip_with(self, other: Self, function: impl Fn(f32, f32) -> f32) -> Self {
        if let (Self::One(a), Self::One(b)) = (self, other) {
            return Self::One(function(a, b));
        }
        let (a, b) = (self.spread(), other.spread());
        Self::Three([0, 1, 2].map(|channel: usize| function(a[channel], b[channel])))
    }

    /// Combines three channels into one; one channel stays as it is.
    fn fold_channels(self, function: impl Fn(f32, f32) -> f32) -> Self {
        match self {
            Self::One(_) => self,
            Self::Three([red, green, blue]) => Self::One(function(function(red, green), blue)),
        }
    }
}

impl StackElement {
    /// Number of arguments that the term pops from the stack.
    pub(super) fn arguments(self) -> usize {
        match self {
            Self::Number(_) | Self::Name(_) => 0,
            Self::Negate | Self::Mean => 1,
            Self::Add | Self::Subtract | Self::Multiply | Self::Divide | Self::Power => 2,
            Self::Clip => 3,
            Self::Min(count) | Self::Max(count) | Self::Curves(count) => count,
        }
    }

    /// Value of the term. `names` holds the values of the names; `arguments` has [`StackElement::arguments`] elements.
    ///
    /// Powers are computed by `libm`, so that every machine gives the same bytes.
    pub(super) fn value(self, names: &[PixelValue], arguments: &[PixelValue]) -> PixelValue {
        match (self, arguments) {
            (Self::Number(number), _) => PixelValue::One(number),
            (Self::Name(index), _) => names[index],
            (Self::Negate, [a]) => a.map(|a| -a),
            (Self::Add, [a, b]) => a.zip_with(*b, |a, b| a + b),
            (Self::Subtract, [a, b]) => a.zip_with(*b, |a, b| a - b),
            (Self::Multiply, [a, b]) => a.zip_with(*b, |a, b| a * b),
            (Self::Divide, [a, b]) => a.zip_with(*b, |a, b| a / b),
            (Self::Power, [a, b]) => a.zip_with(*b, |a, b| libm::powf(larger(a, 0.0), b)),
            (Self::Min(1), [a]) => a.fold_channels(smaller),
            (Self::Max(1), [a]) => a.fold_channels(larger),
            (Self::Min(_), [a, rest @ ..]) => rest.iter().fold(*a, |a, b| a.zip_with(*b, smaller)),
            (Self::Max(_), [a, rest @ ..]) => rest.iter().fold(*a, |a, b| a.zip_with(*b, larger)),
            (Self::Clip, [a, low, high]) => a.zip_with(*low, larger).zip_with(*high, smaller),
            (Self::Curves(_), [x, curves @ ..]) => {
                curves.iter().fold(*x, |x, a| x.zip_with(*a, |x, a| x + a * (x * x - x)))
            }
            (Self::Mean, [a]) => match a.fold_channels(|a, b| a + b) {
                PixelValue::One(sum) if matches!(a, PixelValue::Three(_)) => PixelValue::One(sum / 3.0),
                same => same,
            },
            // Unreachable: the parser gives each term the right number of arguments.
            _ => PixelValue::One(f32::NAN),
        }
    }
}

/// Minimum of two numbers; NaN if one of them is NaN.
fn smaller(a: f32, b: f32) -> f32 {
    if a.is_nan() || a < b { a } else { b }
}

/// Maximum of two numbers; NaN if one of them is NaN.
fn larger(a: f32, b: f32) -> f32 {
    if a.is_nan() || a > b { a } else { b }
}
