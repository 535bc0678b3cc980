//! The files of a comparison: CSV tables, the figure of the residuals, and crops.

use crate::error::Result;
use crate::report::csv::csv;
use crate::report::histogram::{HistogramLine, histogram};
use crate::report::sheet::{self, CropRow};
use crate::report::table::ColumnKind::{Count, Number, Text};
use crate::report::table::TableBuilder;
use crate::score::realism::residual::Residuals;
use crate::score::realism::{
    CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison,
};
use crate::types::Rgb;

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
        let methods = std::iter::once(None).chain(noise);
        methods.map(|noise| PairRow { pair, noise })
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
            let reading = row.noise.map(|noise| noise.method.reading.to_string());
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
        let codes = residuals.real.by_code().zip(noise.by_code());
        codes.map(move |(real, noise)| (method, real, noise))
    });
    let table = TableBuilder::new("residuals", rows)
        .column(Text, "csv code", |(_, (code, ..), _)| code.to_string())
        .column(Text, "csv n", |(_, (_, n, _), _)| n.to_string())
        .column(Number, "csv real_mean", |(_, (.., real), _)| real[0])
        .column(Number, "csv real_std", |(_, (.., real), _)| real[1])
        .column(Number, "csv noise_mean", |(.., (.., noise))| noise[0])
        .column(Number, "csv noise_std", |(.., (.., noise))| noise[1])
        .column(Text, "csv reading", |(method, ..)| {
            method.reading.to_string()
        })
        .column(Text, "csv camera", |(method, ..)| method.camera.word())
        .build();
    csv(&[table])
}

/// Figure of the histograms of real and synthetic residuals.
pub(crate) fn figure(residuals: &PooledResiduals) -> Result<String> {
    let line = |name: String, residuals: &Residuals| HistogramLine {
        name,
        shares: residuals.shares().collect(),
    };
    let noise = residuals.noise.iter();
    let noise = noise.map(|(method, noise)| line(format!("synthetic, {method}"), noise));
    let real = line("real".to_owned(), &residuals.real);
    let lines: Vec<HistogramLine> = std::iter::once(real).chain(noise).collect();
    histogram("Residuals over the dropped clean image, all pairs", &lines)
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
        CameraOrigin::Given => format!("with noise, {}", noise.method.reading),
        _ => format!("with noise, {}, fitted", noise.method.reading),
    });
    let columns = ["real", "exposure drop alone"].map(str::to_owned);
    let columns: Vec<String> = columns.into_iter().chain(noise).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    sheet::crops(&columns, &rows)
}
