//! One step of a sidecar's expression, and the values it works on: [`Term`], [`Sample`].

use crate::conventions::LUMA;

/// A step of an expression in postfix order: it takes its arguments from the end of a stack, and leaves one value there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Term {
    /// A number.
    Number(f32),
    /// The value of a name, by its index among the expression's names.
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
    /// The smallest of this many arguments; of a single one, the smallest of its channels.
    Min(usize),
    /// The largest of this many arguments; of a single one, the largest of its channels.
    Max(usize),
    /// The first argument, held between the second and the third.
    Clip,
    /// Mean over the channels.
    Mean,
    /// Zero-DCE's curves: x + a · (x² − x) for each further argument a, one after another.
    Curves(usize),
}

/// Value of an expression at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sample {
    /// One channel.
    One(f32),
    /// Red, green and blue.
    Three([f32; 3]),
}

impl Sample {
    /// The three channels; one channel is spread to all.
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

    /// A function of each channel.
    fn map(self, with: impl Fn(f32) -> f32) -> Self {
        match self {
            Self::One(value) => Self::One(with(value)),
            Self::Three(values) => Self::Three(values.map(with)),
        }
    }

    /// A function of each channel of two values; one channel is spread to three if the other value has three.
    fn with(self, other: Self, with: impl Fn(f32, f32) -> f32) -> Self {
        if let (Self::One(a), Self::One(b)) = (self, other) {
            return Self::One(with(a, b));
        }
        let (a, b) = (self.spread(), other.spread());
        Self::Three([0, 1, 2].map(|channel: usize| with(a[channel], b[channel])))
    }

    /// The channels, combined to one.
    fn folded(self, with: impl Fn(f32, f32) -> f32) -> Self {
        match self {
            Self::One(_) => self,
            Self::Three([red, green, blue]) => Self::One(with(with(red, green), blue)),
        }
    }
}

impl Term {
    /// Number of arguments that the step takes from the stack.
    pub(super) fn arguments(self) -> usize {
        match self {
            Self::Number(_) | Self::Name(_) => 0,
            Self::Negate | Self::Mean => 1,
            Self::Add | Self::Subtract | Self::Multiply | Self::Divide | Self::Power => 2,
            Self::Clip => 3,
            Self::Min(count) | Self::Max(count) | Self::Curves(count) => count,
        }
    }

    /// Value of the step. `names` holds the values of the names; `arguments` has [`Term::arguments`] elements.
    ///
    /// Powers are those of `libm`, so that every machine gives the same bytes.
    pub(super) fn value(self, names: &[Sample], arguments: &[Sample]) -> Sample {
        match (self, arguments) {
            (Self::Number(number), _) => Sample::One(number),
            (Self::Name(index), _) => names[index],
            (Self::Negate, [a]) => a.map(|a| -a),
            (Self::Add, [a, b]) => a.with(*b, |a, b| a + b),
            (Self::Subtract, [a, b]) => a.with(*b, |a, b| a - b),
            (Self::Multiply, [a, b]) => a.with(*b, |a, b| a * b),
            (Self::Divide, [a, b]) => a.with(*b, |a, b| a / b),
            (Self::Power, [a, b]) => a.with(*b, |a, b| libm::powf(larger(a, 0.0), b)),
            (Self::Min(1), [a]) => a.folded(smaller),
            (Self::Max(1), [a]) => a.folded(larger),
            (Self::Min(_), [a, rest @ ..]) => rest.iter().fold(*a, |a, b| a.with(*b, smaller)),
            (Self::Max(_), [a, rest @ ..]) => rest.iter().fold(*a, |a, b| a.with(*b, larger)),
            (Self::Clip, [a, low, high]) => a.with(*low, larger).with(*high, smaller),
            (Self::Curves(_), [x, curves @ ..]) => curves
                .iter()
                .fold(*x, |x, a| x.with(*a, |x, a| x + a * (x * x - x))),
            (Self::Mean, [a]) => match a.folded(|a, b| a + b) {
                Sample::One(sum) if matches!(a, Sample::Three(_)) => Sample::One(sum / 3.0),
                same => same,
            },
            // The parser gives each step its arguments.
            _ => Sample::One(f32::NAN),
        }
    }
}

/// The smaller of two numbers; NaN if one of them is.
fn smaller(a: f32, b: f32) -> f32 {
    if a.is_nan() || a < b { a } else { b }
}

/// The larger of two numbers; NaN if one of them is.
fn larger(a: f32, b: f32) -> f32 {
    if a.is_nan() || a > b { a } else { b }
}
