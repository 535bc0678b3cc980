//! Files of a comparison of synthetic with real low light: CSV tables, the figure of residuals, and crops.

use crate::error::Result;
use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::points::{PointPanel, PointSeries};
use crate::report::charts::paper::point_figure;
use crate::report::charts::sheet::{self, CropRow};
use crate::report::text::csv::csv;
use crate::report::text::table::ColumnKind::{Count, Number, Text};
use crate::report::text::table::TableBuilder;
use crate::types::Rgb;
use darkqa_score::photographs::realism::residual::Residuals;
use darkqa_score::photographs::realism::{CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison};

/// Synthetic image of one pair; `noise` is `None` for exposure drop alone.
struct PairRow<'a> {
    pair: &'a PairComparison,
    noise: Option<&'a NoiseComparison>,
}

impl PairRow<'_> {
    fn image(&self) -> &ImageComparison {
        self.noise.map_or(&self.pair.exposure, |noise| &noise.image)
    }

    /// Difference of a measure from exposure drop alone, by its index in [`ImageComparison::differences`].
    fn difference(&self, index: usize) -> Option<f64> {
        let differences = self.noise?.image.differences(&self.pair.exposure);
        Some(differences[index])
    }
}

/// CSV file with a row for each pair and each way to synthesize its image.
pub(crate) fn pairs(pairs: &[&PairComparison]) -> Result<Vec<u8>> {
    let rows = pairs
        .iter()
        .flat_map(|pair| std::iter::once(None).chain(pair.noise.iter().map(Some)).map(|noise| PairRow { pair, noise }));
    let table = TableBuilder::new("pairs", rows)
        .column(Text, "csv pair", |row| row.pair.pair.clone())
        .column(Text, "csv drop", |row| row.pair.drop.to_string())
        .column(Text, "csv variant", |row| match row.noise {
            None => "ev",
            Some(_) => "noise",
        })
        .column(Number, "csv psnr", |row| row.image().psnr)
        .column(Number, "csv ssim", |row| row.image().ssim)
        .column(Number, "csv kl", |row| row.image().kl.nats)
        .column(Number, "csv kl_other", |row| row.image().kl_other.nats)
        .column(Count, "csv empty_bins", |row| row.image().kl.empty)
        .column(Number, "csv clean_psnr", |row| row.noise.map(|noise| noise.clean_psnr))
        .column(Text, "csv reading", |row| {
            let reading = row.noise.map(|noise| noise.method.profile.to_string());
            reading.unwrap_or_default()
        })
        .column(Text, "csv camera", |row| row.noise.map_or("", |noise| noise.method.camera.word()))
        .column(Number, "csv psnr_difference", |row| row.difference(0))
        .column(Number, "csv ssim_difference", |row| row.difference(1))
        .column(Number, "csv kl_difference", |row| row.difference(2))
        .column(Number, "csv structure", |row| row.pair.scene.correlation)
        .build();
    csv(&[table])
}

/// Residuals of all pairs together: of the real images, and of each noise method.
pub(crate) struct PooledResiduals {
    pub real: Residuals,
    pub noise: Vec<(NoiseMethod, Residuals)>,
}

/// CSV file with the mean and standard deviation of real and synthetic residuals by clean code.
pub(crate) fn by_code(residuals: &PooledResiduals) -> Result<Vec<u8>> {
    let rows = residuals.noise.iter().flat_map(|(method, noise)| {
        residuals.real.by_code().zip(noise.by_code()).map(move |(real, noise)| (method, real, noise))
    });
    let table = TableBuilder::new("residuals", rows)
        .column(Text, "csv code", |(_, (code, ..), _)| code.to_string())
        .column(Text, "csv n", |(_, (_, n, _), _)| n.to_string())
        .column(Number, "csv real_mean", |(_, (.., real), _)| real[0])
        .column(Number, "csv real_std", |(_, (.., real), _)| real[1])
        .column(Number, "csv noise_mean", |(.., (.., noise))| noise[0])
        .column(Number, "csv noise_std", |(.., (.., noise))| noise[1])
        .column(Text, "csv reading", |(method, ..)| method.profile.to_string())
        .column(Text, "csv camera", |(method, ..)| method.camera.word())
        .build();
    csv(&[table])
}

/// Figure with histograms of real and synthetic residuals in 8-bit codes.
pub(crate) fn figure(residuals: &PooledResiduals) -> Result<String> {
    let mut series = vec![histogram("real".to_owned(), LineStyle::BLACK, residuals.real.shares())];
    for (style, (method, noise)) in residuals.noise.iter().enumerate() {
        let name = format!("synthetic, {method}");
        series.push(histogram(name, LineStyle(style), noise.shares()));
    }
    point_figure(&[PointPanel {
        title: "Residuals over the dropped clean image, all pairs".to_owned(),
        axes: ["residual in 8-bit codes", "log10 of the share of samples"],
        series,
    }])
}

/// Smallest share that is drawn.
const MIN_SHARE: f64 = 1e-7;

/// Histogram on a logarithmic scale as lines, with gaps at residuals that do not occur. A residual without neighbours
/// is a point.
fn histogram(name: String, style: LineStyle, shares: impl Iterator<Item = (i32, f64)>) -> PointSeries {
    let (points, lines): (Vec<_>, Vec<_>) = shares
        .collect::<Vec<_>>()
        .split(|(_, share)| *share <= MIN_SHARE)
        .filter(|run| !run.is_empty())
        .map(|run| run.iter().map(|(size, share)| [f64::from(*size), libm::log10(*share)]).collect::<Vec<_>>())
        .partition(|run| run.len() == 1);
    PointSeries { name, style, points: points.concat(), lines }
}

/// Sheet of crops from each pair, brightened by its exposure drop: real image, exposure drop alone, and each noise
/// method.
#[must_use]
pub(crate) fn crops<'a>(pairs: impl Iterator<Item = (&'a PairComparison, &'a [Rgb])>) -> Rgb {
    let pairs: Vec<_> = pairs.collect();
    let rows: Vec<CropRow<'_>> = pairs
        .iter()
        .map(|(pair, images)| CropRow {
            name: format!("{} (drop {:.2} EV)", pair.pair, pair.drop),
            images: images.iter().collect(),
            gain: f64::from(pair.drop).exp2(),
        })
        .collect();
    let mut columns = vec!["real".to_owned(), "exposure drop alone".to_owned()];
    for noise in pairs.iter().take(1).flat_map(|(pair, _)| &pair.noise) {
        // A column has space for 36 letters.
        columns.push(match noise.method.camera {
            CameraOrigin::Given => format!("with noise, {}", noise.method.profile),
            _ => format!("with noise, {}, fitted", noise.method.profile),
        });
    }
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    sheet::crops(&columns, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_have_gaps() {
        let shares = [(-1, 0.1), (0, 0.8), (1, 0.1), (2, 0.0), (3, 0.01), (4, 1e-8)];
        let series = histogram("real".to_owned(), LineStyle::BLACK, shares.into_iter());
        assert_eq!(series.points, [[3.0, -2.0]]);
        assert_eq!(series.lines, [[[-1.0, -1.0], [0.0, libm::log10(0.8)], [1.0, -1.0]]]);
    }
}
