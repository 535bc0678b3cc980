//! Plausibility checks of a fitted camera setting.

use super::fit::SettingFit;

/// Range of the gain K in a camera file, in ADU per electron.
const GAIN_RANGE: [f64; 2] = [0.01, 100.0];
/// Relative bend of the photon transfer line: warn above the first, reject above the second (chosen).
const BEND_LIMITS: [f64; 2] = [0.05, 0.15];
/// Largest distance of the intercept of photon transfer from 0, in standard errors.
const MAX_INTERCEPT: f64 = 3.0;
/// Largest difference of K between colour planes, relative to K (chosen).
const MAX_PLANE_DIFFERENCE: f64 = 0.03;
/// Smallest standard deviation of the noise of bias frames, in ADU. Chosen: below it, the rounding error depends on the
/// noise and on the fractional part of the offset.
const MIN_READ_DEVIATION: f64 = 0.35;

/// Checks a fitted setting and returns warnings. `width` is the number of sites in a row.
///
/// # Errors
/// If K is out of range, or if the photon transfer line bends too much.
pub(super) fn setting_doubts(fit: &SettingFit, has_dark: bool, width: usize) -> Result<Vec<String>, String> {
    let gain = fit.gain.value;
    if !(GAIN_RANGE[0]..=GAIN_RANGE[1]).contains(&gain) {
        return Err(format!(
            "K is {gain:.4} ADU per electron, and {} to {} are possible: do flats and bias frames belong together?",
            GAIN_RANGE[0], GAIN_RANGE[1]
        ));
    }
    let bend = 100.0 * fit.bend;
    if fit.bend.abs() > BEND_LIMITS[1] {
        return Err(format!(
            "photon transfer bends by {bend:+.0} % over the range of light (limit {:.0} %): the codes are not linear in light, the frames were processed, or the light of pairs changed in parts of the frame alone",
            100.0 * BEND_LIMITS[1]
        ));
    }
    let mut doubts = Vec::new();
    if fit.bend.abs() > BEND_LIMITS[0] {
        doubts.push(format!(
            "photon transfer bends by {bend:+.1} % over the range of light: the codes are not quite linear; K is off by some percent"
        ));
    }
    doubts.extend(intercept_doubt(fit, has_dark));
    doubts.extend(plane_doubt(fit));
    if fit.row_deviation.value <= 0.0 {
        doubts.push(format!(
            "row noise cannot be seen below about {:.3} ADU: this setting does not count in the line of σ_row, which --noise camera takes for it, too",
            fit.read_deviation / (width as f64).sqrt()
        ));
    }
    if fit.read_deviation < MIN_READ_DEVIATION {
        doubts.push(format!(
            "the noise of bias frames has a deviation of {:.2} ADU, less than the codes can show: σ_TL and λ are uncertain",
            fit.read_deviation
        ));
    }
    Ok(doubts)
}

/// Warning if the photon transfer line misses 0 by more than [`MAX_INTERCEPT`] standard errors.
fn intercept_doubt(fit: &SettingFit, has_dark: bool) -> Option<String> {
    let error = fit.intercept.error.unwrap_or(f64::INFINITY);
    if fit.intercept.value.abs() > MAX_INTERCEPT * error {
        let advice = if has_dark { "" } else { "; record dark frames of the exposures of the flats (dark-NAME/)" };
        return Some(format!(
            "photon transfer does not pass through 0: {:+.1} ± {error:.1} ADU² at no light, as if the offset of the flats were {:+.1} ADU from that of the bias frames (dark current, or a black level that moves){advice}",
            fit.intercept.value,
            -fit.intercept.value / fit.gain.value,
        ));
    }
    None
}

/// Warning if K differs between planes by more than [`MAX_PLANE_DIFFERENCE`].
fn plane_doubt(fit: &SettingFit) -> Option<String> {
    let gains = fit.gain_by_plane.iter().flatten().copied();
    let low = gains.clone().fold(f64::INFINITY, f64::min);
    let high = gains.fold(0.0, f64::max);
    if (high - low) / fit.gain.value > MAX_PLANE_DIFFERENCE {
        let list: Vec<String> =
            fit.gain_by_plane.iter().map(|k| k.map_or("–".to_owned(), |k| format!("{k:.4}"))).collect();
        return Some(format!(
            "the planes differ in K by more than {:.0} % ({}), and the model has one K for all",
            100.0 * MAX_PLANE_DIFFERENCE,
            list.join(", ")
        ));
    }
    None
}
