//! Consistency checks between settings: [`order_doubts`].

use super::recording::{Recording, SettingFiles};
use super::setting::SettingFit;

/// Maximum distance of the offset of a setting from the trend of all settings, in standard deviations of the noise
/// (chosen).
const MAX_OFF_TREND: f64 = 5.0;

/// Warnings about settings, which are in the order of the numbers in their names: K must rise, and offsets must follow
/// a trend.
pub(super) fn order_doubts(settings: &[SettingFit], recording: &Recording) -> Vec<String> {
    let mut doubts = Vec::new();
    let numbers = recording.settings.iter().map(SettingFiles::number);
    let numbered: Vec<(&SettingFit, f64)> =
        settings.iter().zip(numbers).filter_map(|(fit, number)| Some((fit, number?))).collect();
    for pair in numbered.windows(2) {
        let [(low, first), (high, second)] = [pair[0], pair[1]];
        if first < second && high.gain.value <= low.gain.value {
            doubts.push(format!(
                "{}: K {:.4} is not above that of {}, {:.4}: are frames in the wrong folder?",
                high.name, high.gain.value, low.name, low.gain.value
            ));
        }
    }
    doubts.extend(off_trend(settings));
    doubts
}

/// Warnings about settings whose offset is far from the trend over ln K. The trend is a line with the median slope
/// (Theil–Sen estimator), which is robust to outliers among up to a third of the settings; with at most three settings
/// it is their median.
fn off_trend(settings: &[SettingFit]) -> Vec<String> {
    let points: Vec<[f64; 2]> = settings
        .iter()
        .map(|fit| {
            let offsets: f64 = fit.offsets.iter().map(|offset| offset.value).sum();
            [libm::log(fit.gain.value), offsets / fit.offsets.len() as f64]
        })
        .collect();
    if points.len() < 2 {
        return Vec::new();
    }
    let slope = if points.len() > 3 {
        let slopes = points
            .iter()
            .enumerate()
            .flat_map(|(i, a)| points[i + 1..].iter().map(move |b| (a, b)))
            .filter(|(a, b)| (a[0] - b[0]).abs() > 1e-9);
        median(slopes.map(|(a, b)| (b[1] - a[1]) / (b[0] - a[0])).collect())
    } else {
        0.0
    };
    let level = median(points.iter().map(|[x, y]| y - slope * x).collect());
    settings.iter().zip(&points).filter_map(|(fit, [x, y])| {
        let off = y - slope * x - level;
        (off.abs() > MAX_OFF_TREND * fit.read_deviation).then(|| {
            format!(
                "{}: the offset of its bias frames, {y:.1} ADU, is {off:+.1} ADU off the trend of all settings: are they of another camera, or of another black level?",
                fit.name
            )
        })
    }).collect()
}

/// Median of numbers: the upper one of two middle numbers, and 0 without any.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
