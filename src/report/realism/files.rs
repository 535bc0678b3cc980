//! The files of a comparison: CSV tables, the figure of the residuals, and crops.

use crate::drawing::chart::LineStyle;
use crate::drawing::chart::points::{PointPanel, PointSeries};
use crate::drawing::paper::point_figure;
use crate::drawing::sheet::{self, CropRow};
use crate::error::Result;
use crate::text::csv::csv;
use crate::text::table::ColumnKind::{Count, Number, Text};
use crate::text::table::TableBuilder;
use crate::types::Rgb;
use darkqa_score::photographs::realism::residual::Residuals;
use darkqa_score::photographs::realism::{
    CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison,
};

/// One way to make the image of one pair; no noise for exposure drop alone.
struct PairRow<'a> {
    pair: &'a PairComparison,
    noise: Option<&'a NoiseComparison>,
}

impl PairRow<'_> {
    fn image(&self) -> &ImageComparison {
        self.noise.map_or(&self.pair.exposure, |noise| &noise.image)
    }

    /// Difference of a number from that of exposure drop alone.
    fn difference(&self, index: usize) -> Option<f64> {
        let differences = self.noise?.image.differences(&self.pair.exposure);
        Some(differences[index])
    }
}

/// CSV file with a row for each pair and each way of making its image.
pub(crate) fn pairs(pairs: &[&PairComparison]) -> Result<Vec<u8>> {
    let rows = pairs.iter().flat_map(|pair| {
        let noise = pair.noise.iter().map(Some);
        std::iter::once(None)
            .chain(noise)
            .map(|noise| PairRow { pair, noise })
    });
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
        .column(Number, "csv clean_psnr", |row| {
            row.noise.map(|noise| noise.clean_psnr)
        })
        .column(Text, "csv reading", |row| {
            let reading = row.noise.map(|noise| noise.method.profile.to_string());
            reading.unwrap_or_default()
        })
        .column(Text, "csv camera", |row| {
            row.noise.map_or("", |noise| noise.method.camera.word())
        })
        .column(Number, "csv psnr_difference", |row| row.difference(0))
        .column(Number, "csv ssim_difference", |row| row.difference(1))
        .column(Number, "csv kl_difference", |row| row.difference(2))
        .column(Number, "csv structure", |row| row.pair.scene.correlation)
        .build();
    csv(&[table])
}

/// Residuals of all pairs together: of the real images, and of each way of making noise.
pub(crate) struct PooledResiduals {
    pub real: Residuals,
    pub noise: Vec<(NoiseMethod, Residuals)>,
}

/// CSV file with the mean and standard deviation of real and synthetic residuals by clean code.
pub(crate) fn by_code(residuals: &PooledResiduals) -> Result<Vec<u8>> {
    let rows = residuals.noise.iter().flat_map(|(method, noise)| {
        residuals
            .real
            .by_code()
            .zip(noise.by_code())
            .map(move |(real, noise)| (method, real, noise))
    });
    let table = TableBuilder::new("residuals", rows)
        .column(Text, "csv code", |(_, (code, ..), _)| code.to_string())
        .column(Text, "csv n", |(_, (_, n, _), _)| n.to_string())
        .column(Number, "csv real_mean", |(_, (.., real), _)| real[0])
        .column(Number, "csv real_std", |(_, (.., real), _)| real[1])
        .column(Number, "csv noise_mean", |(.., (.., noise))| noise[0])
        .column(Number, "csv noise_std", |(.., (.., noise))| noise[1])
        .column(Text, "csv reading", |(method, ..)| {
            method.profile.to_string()
        })
        .column(Text, "csv camera", |(method, ..)| method.camera.word())
        .build();
    csv(&[table])
}

/// Figure of the shares of real and synthetic residuals by their size in 8-bit codes.
pub(crate) fn figure(residuals: &PooledResiduals) -> Result<String> {
    let real = histogram("real".to_owned(), LineStyle::BLACK, residuals.real.shares());
    let noise = residuals.noise.iter().enumerate();
    let noise = noise.map(|(style, (method, noise))| {
        let name = format!("synthetic, {method}");
        histogram(name, LineStyle(style), noise.shares())
    });
    point_figure(&[PointPanel {
        title: "Residuals over the dropped clean image, all pairs".to_owned(),
        axes: ["residual in 8-bit codes", "log10 of the share of samples"],
        series: std::iter::once(real).chain(noise).collect(),
    }])
}

/// Smallest share that is drawn.
const MIN_SHARE: f64 = 1e-7;

/// A line over the sizes of residuals, with a gap where a size does not occur. A size between two that do not occur is a point.
fn histogram(
    name: String,
    style: LineStyle,
    shares: impl Iterator<Item = (i32, f64)>,
) -> PointSeries {
    let shares: Vec<(i32, f64)> = shares.collect();
    let (points, lines): (Vec<_>, Vec<_>) = shares
        .split(|(_, share)| *share <= MIN_SHARE)
        .filter(|run| !run.is_empty())
        .map(|run| {
            run.iter()
                .map(|(size, share)| [f64::from(*size), libm::log10(*share)])
                .collect::<Vec<_>>()
        })
        .partition(|run| run.len() == 1);
    PointSeries {
        name,
        style,
        points: points.concat(),
        lines,
    }
}

/// Crops of pairs, brightened by the exposure drop of each pair: the real image, that of exposure drop alone, and those with noise.
#[must_use]
pub(crate) fn crops<'a>(pairs: impl Iterator<Item = (&'a PairComparison, &'a [Rgb])>) -> Rgb {
    let pairs: Vec<_> = pairs.collect();
    let rows: Vec<CropRow<'_>> = pairs
        .iter()
        .map(|(pair, images)| CropRow {
            name: format!("{} (drop {:.2} EV)", pair.pair, pair.drop),
            images: images.iter().collect(),
            amplified: f64::from(pair.drop).exp2(),
        })
        .collect();
    let noise = pairs.iter().take(1).flat_map(|(pair, _)| &pair.noise);
    // A column is 36 letters wide.
    let noise = noise.map(|noise| match noise.method.camera {
        CameraOrigin::Given => format!("with noise, {}", noise.method.profile),
        _ => format!("with noise, {}, fitted", noise.method.profile),
    });
    let columns = ["real", "exposure drop alone"].map(str::to_owned);
    let columns: Vec<String> = columns.into_iter().chain(noise).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    sheet::crops(&columns, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histogram_has_gaps_where_nothing_occurs() {
        let shares = [
            (-1, 0.1),
            (0, 0.8),
            (1, 0.1),
            (2, 0.0),
            (3, 0.01),
            (4, 1e-8),
        ];
        let series = histogram("real".to_owned(), LineStyle::BLACK, shares.into_iter());
        assert_eq!(series.points, [[3.0, -2.0]]);
        assert_eq!(
            series.lines,
            [[[-1.0, -1.0], [0.0, libm::log10(0.8)], [1.0, -1.0]]]
        );
    }
}
