//! Doubts about the numbers of a setting.

use super::fit::SettingFit;

/// Range of K that a camera file may have, in ADU per electron.
const GAINS: [f64; 2] = [0.01, 100.0];
/// Bends of photon transfer: above the first a note, above the second refused (chosen).
const BEND: [f64; 2] = [0.05, 0.15];
/// Standard errors that the intercept of photon transfer may be from 0.
const INTERCEPT: f64 = 3.0;
/// Largest difference of K between planes, as a share (chosen).
const PLANES: f64 = 0.03;
/// Smallest deviation of the noise of bias frames, in ADU (chosen: below it the error of rounding depends on the noise and on the
/// fraction of the offset).
const COARSE: f64 = 0.35;

/// Doubts about a setting whose rows have so many sites.
///
/// # Errors
/// If K cannot be, or photon transfer is far from a straight line.
pub(super) fn setting_doubts(
    fit: &SettingFit,
    has_dark: bool,
    width: usize,
) -> Result<Vec<String>, String> {
    let gain = fit.gain.value;
    if !(GAINS[0]..=GAINS[1]).contains(&gain) {
        return Err(format!(
            "K is {gain:.4} ADU per electron, and {} to {} are possible: do flats and bias frames belong together?",
            GAINS[0], GAINS[1]
        ));
    }
    let bend = 100.0 * fit.bend;
    if fit.bend.abs() > BEND[1] {
        return Err(format!(
            "photon transfer bends by {bend:+.0} % over the range of light (limit {:.0} %): the codes are not linear in light, the frames were processed, or the light of pairs changed in parts of the frame alone",
            100.0 * BEND[1]
        ));
    }
    let mut doubts = Vec::new();
    if fit.bend.abs() > BEND[0] {
        doubts.push(format!(
            "photon transfer bends by {bend:+.1} % over the range of light: the codes are not quite linear; K is off by some percent"
        ));
    }
    doubts.extend(intercept(fit, has_dark));
    doubts.extend(planes(fit));
    if fit.row_deviation.value <= 0.0 {
        doubts.push(format!(
            "row noise cannot be seen below about {:.3} ADU: this setting does not count in the line of σ_row, which --noise camera takes for it, too",
            fit.read_deviation / (width as f64).sqrt()
        ));
    }
    if fit.read_deviation < COARSE {
        doubts.push(format!(
            "the noise of bias frames has a deviation of {:.2} ADU, less than the codes can show: σ_TL and λ are uncertain",
            fit.read_deviation
        ));
    }
    Ok(doubts)
}

/// A line of photon transfer that does not pass through 0.
fn intercept(fit: &SettingFit, has_dark: bool) -> Option<String> {
    let error = fit.intercept.error.unwrap_or(f64::INFINITY);
    if fit.intercept.value.abs() > INTERCEPT * error {
        let advice = if has_dark {
            ""
        } else {
            "; record dark frames of the exposures of the flats (dark-NAME/)"
        };
        return Some(format!(
            "photon transfer does not pass through 0: {:+.1} ± {error:.1} ADU² at no light, as if the offset of the flats were {:+.1} ADU from that of the bias frames (dark current, or a black level that moves){advice}",
            fit.intercept.value,
            -fit.intercept.value / fit.gain.value,
        ));
    }
    None
}

/// Planes whose K differ.
fn planes(fit: &SettingFit) -> Option<String> {
    let known = || fit.gain_by_plane.iter().flatten().copied();
    let [low, high] = [
        known().fold(f64::INFINITY, f64::min),
        known().fold(0.0, f64::max),
    ];
    if (high - low) / fit.gain.value > PLANES {
        let list: Vec<String> = fit
            .gain_by_plane
            .iter()
            .map(|k| k.map_or("–".to_owned(), |k| format!("{k:.4}")))
            .collect();
        return Some(format!(
            "the planes differ in K by more than {:.0} % ({}), and the model has one K for all",
            100.0 * PLANES,
            list.join(", ")
        ));
    }
    None
}
