//! Dependence of a noise deviation σ on the gain K: [`NoiseLine`], ln σ = slope · ln K + intercept.

use serde::Serialize;

use super::SettingFit;

use darkqa_light::Calibration;

/// Minimum number of settings to fit a slope.
const MIN_SETTINGS: usize = 3;

/// Line of a deviation σ over the settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct NoiseLine {
    pub slope: f64,
    /// ln σ at K = 1.
    pub intercept: f64,
    /// Standard deviation of ln σ around the line.
    pub deviation: f64,
    /// Number of fitted settings.
    pub settings: usize,
    pub slope_from: SlopeSource,
}

/// Source of a slope.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum SlopeSource {
    /// Fitted to the settings.
    Settings,
    /// The value of the preset `sony-a7s2`, because there are fewer than three settings.
    Preset,
    /// No slope: no setting has this kind of noise.
    NoNoise,
}

/// Kind of noise of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoiseKind {
    Read,
    Row,
}

impl NoiseLine {
    /// Fits the line of a kind of noise to settings.
    pub(super) fn for_settings(settings: &[SettingFit], kind: NoiseKind) -> Self {
        let points: Vec<[f64; 2]> = settings
            .iter()
            .map(|fit| {
                let deviation = match kind {
                    NoiseKind::Read => &fit.read_scale,
                    NoiseKind::Row => &fit.row_deviation,
                };
                [fit.gain.value, deviation.value]
            })
            .collect();
        Self::fit(&points, kind)
    }

    /// Fits a line through points (K, σ); points without noise are left out.
    pub(super) fn fit(points: &[[f64; 2]], kind: NoiseKind) -> Self {
        let logs: Vec<[f64; 2]> =
            points.iter().filter(|[_, sigma]| *sigma > 0.0).map(|point| point.map(libm::log)).collect();
        let n = logs.len() as f64;
        if logs.is_empty() {
            // e^−20 ADU: the minimum in a camera file.
            return Self {
                slope: 0.0,
                intercept: -20.0,
                deviation: 0.0,
                settings: 0,
                slope_from: SlopeSource::NoNoise,
            };
        }
        let [x, y] = [0, 1].map(|i| logs.iter().map(|log| log[i]).sum::<f64>() / n);
        let products: f64 = logs.iter().map(|log| (log[0] - x) * (log[1] - y)).sum();
        let squares: f64 = logs.iter().map(|log| (log[0] - x).powi(2)).sum();
        let fits_slope = logs.len() >= MIN_SETTINGS && squares > 0.0;
        let slope = if fits_slope { products / squares } else { preset_slope(kind) };
        let residual: f64 = logs.iter().map(|log| (log[1] - y - slope * (log[0] - x)).powi(2)).sum();
        // Degrees of freedom: the intercept is fitted, and possibly the slope.
        let free = n - if fits_slope { 2.0 } else { 1.0 };
        Self {
            slope,
            intercept: y - slope * x,
            deviation: if free > 0.0 { (residual / free).sqrt() } else { 0.0 },
            settings: logs.len(),
            slope_from: if fits_slope { SlopeSource::Settings } else { SlopeSource::Preset },
        }
    }

    /// Relative standard error of the deviation, 1 / √(2 · degrees of freedom); `None` without degrees of freedom.
    pub(crate) fn deviation_error(&self) -> Option<f64> {
        let fitted = match self.slope_from {
            SlopeSource::Settings => 2,
            SlopeSource::Preset => 1,
            SlopeSource::NoNoise => return None,
        };
        let free = self.settings.checked_sub(fitted).filter(|free| *free > 0)?;
        Some(1.0 / (2.0 * free as f64).sqrt())
    }

    /// Value of the line at a gain: σ in ADU.
    pub(crate) fn at(&self, gain: f64) -> f64 {
        libm::exp(self.slope * libm::log(gain) + self.intercept)
    }
}

/// Slope of the preset `sony-a7s2`.
fn preset_slope(kind: NoiseKind) -> f64 {
    let preset = Calibration::preset("sony-a7s2");
    preset.map_or(0.5, |preset| match kind {
        NoiseKind::Read => preset.read_scale.slope,
        NoiseKind::Row => preset.row_deviation.slope,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Point of the line σ = 2 K^0.4.
    fn on_line(k: f64) -> [f64; 2] {
        [k, 2.0 * k.powf(0.4)]
    }

    #[test]
    fn slopes_are_fitted_to_three_settings_or_more() {
        let three = NoiseLine::fit(&[0.1, 1.0, 5.0].map(on_line), NoiseKind::Read);
        assert!((three.slope - 0.4).abs() < 1e-12);
        assert!((three.intercept - 2.0_f64.ln()).abs() < 1e-12);
        assert!(three.deviation < 1e-12);
        assert_eq!(three.slope_from, SlopeSource::Settings);
        assert!((three.at(0.5) - on_line(0.5)[1]).abs() < 1e-12);
        let seven = NoiseLine { settings: 7, ..three };
        assert!((seven.deviation_error().unwrap() - 0.316).abs() < 1e-3);
        for gains in [&[2.0][..], &[0.5, 4.0]] {
            let points: Vec<[f64; 2]> = gains.iter().map(|k| on_line(*k)).collect();
            let line = NoiseLine::fit(&points, NoiseKind::Row);
            assert_eq!(line.slope_from, SlopeSource::Preset);
            assert!((line.slope - 0.5275360468633209).abs() < 1e-15);
            // It passes through the middle of the points.
            let middle: f64 = points.iter().map(|p| p[1].ln() - line.at(p[0]).ln()).sum();
            assert!(middle.abs() < 1e-12);
        }
    }

    #[test]
    fn a_setting_without_noise_is_left_out() {
        let line = NoiseLine::fit(&[[0.1, 0.0], [1.0, 2.0], [2.0, 3.0]], NoiseKind::Row);
        assert_eq!((line.settings, line.slope_from), (2, SlopeSource::Preset));
        let none = NoiseLine::fit(&[[0.1, 0.0]], NoiseKind::Row);
        assert!(none.at(3.0) < 1e-8 && none.slope_from == SlopeSource::NoNoise);
        assert_eq!(none.deviation_error(), None);
    }
}
