//! The measurement of one setting: [`SettingFit`].

use serde::Serialize;

use super::super::read_noise::PlotFit;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Measured {
    pub value: f64,
    /// Standard error by bootstrap over frame pairs; `None` with a single pair.
    pub error: Option<f64>,
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
    /// The same two by the probability plot, which takes rounding for noise.
    pub plot: PlotFit,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: Measured,
    /// Mean codes of the planes of bias frames, the black level included, in the order R, G1, G2, B.
    pub offsets: Vec<Measured>,
    /// Standard deviation of the noise within rows, in ADU.
    pub read_deviation: f64,
    pub hot_pixels: usize,
    /// K of each plane alone; `None` where all its light is out of range.
    pub gain_by_plane: Vec<Option<f64>>,
    /// How much variance / signal changes over the range of light, as a share of K.
    pub bend: f64,
    /// Variance at no light of a line that need not pass through 0, in ADU². Its error is that of the noise of the sites: a few pairs
    /// of flats tell too little of it.
    pub intercept: Measured,
    /// Points of the figures.
    #[serde(skip)]
    pub figure: FigurePoints,
}

/// Frames of a setting that were used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct FrameCounts {
    pub bias: usize,
    pub exposures: usize,
    pub flat_pairs: usize,
}

/// Points of a setting in figures.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct FigurePoints {
    /// Signal in ADU and variance in ADU² of each exposure and plane.
    pub transfer: Vec<[f64; 2]>,
    /// Quantile of the fitted distribution of scale 1, and the residual there over the fitted scale.
    pub plot: Vec<[f64; 2]>,
}
