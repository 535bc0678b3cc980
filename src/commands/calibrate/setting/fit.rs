//! Results of one setting: [`SettingFit`].

use serde::Serialize;

use super::super::read_noise::PlotFit;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Measured {
    pub value: f64,
    /// Standard error by bootstrap over frame pairs; `None` with a single pair.
    pub error: Option<f64>,
}

impl Measured {
    pub(super) fn new(value: f64, error: Option<f64>) -> Self {
        Self { value, error }
    }
}

/// Noise of a sensor at one setting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SettingFit {
    pub name: String,
    pub frames: FrameCounts,
    /// System gain K, in ADU per electron.
    pub gain: Measured,
    /// Scale σ_TL of the read noise, in ADU.
    pub read_scale: Measured,
    /// Shape λ of the read noise.
    pub read_shape: Measured,
    /// Read noise by the probability plot, which counts rounding as noise.
    pub plot: PlotFit,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: Measured,
    /// Mean codes of the planes of bias frames, including the black level, in the order R, G1, G2, B.
    pub offsets: Vec<Measured>,
    /// Standard deviation of the noise within rows, in ADU.
    pub read_deviation: f64,
    pub hot_pixels: usize,
    /// K of each plane alone; `None` if all its light is out of range.
    pub gain_by_plane: Vec<Option<f64>>,
    /// Change of variance / signal over the range of light, relative to K.
    pub bend: f64,
    /// Intercept of the photon transfer line: its variance without light, in ADU². Its error comes from the noise of
    /// the sites, because a few pairs of flats are too few for a bootstrap.
    pub intercept: Measured,
    /// Points for the figures.
    #[serde(skip)]
    pub figure: FigurePoints,
}

/// Numbers of used frames of a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct FrameCounts {
    pub bias: usize,
    pub exposures: usize,
    pub flat_pairs: usize,
}

/// Points of a setting for the figures.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct FigurePoints {
    /// Signal in ADU and variance in ADU² of each exposure and plane.
    pub transfer: Vec<[f64; 2]>,
    /// Quantiles of the fitted distribution with scale 1, and the residuals there relative to the fitted scale.
    pub plot: Vec<[f64; 2]>,
}
