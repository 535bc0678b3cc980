//! Report on a comparison of synthetic with real low light: [`RealismSummary`], its files and its figures.
//!
//! Files of a comparison of synthetic with real low light: CSV tables, the figure of residuals, and crops.
//!
//! Table and file of the gains fitted to real images: [`table`], [`fit_lines`] and [`fits_csv()`].
//!
//! Table rows with means over pairs: of any synthesis method ([`MethodRow`]), and of a noise method ([`NoiseRow`]).

use serde::Serialize;

use crate::charts::chart::{LineContent, LineStyle, Panel, PlotLine, Scale};
use crate::charts::paper::point_figure;
use crate::charts::sheet;
use crate::charts::sheet::CropRow;
use crate::text::table::ColumnKind::{Count, Number, Text};
use crate::text::table::{TableBuilder, csv};
use crate::text::terminal;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;
use darkqa_base::types::text::counted;
use darkqa_score::photographs::realism::gain::{FitOutcome, PairFit, PooledGain, ProfileFit};
use darkqa_score::photographs::realism::residual::{Bins, EmptyBins, Residuals};
use darkqa_score::photographs::realism::smooth::{MIN_VALUES, Mean};
use darkqa_score::photographs::realism::{CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison};

/// Summary over all pairs.
#[derive(Debug, Serialize)]
pub struct RealismSummary {
    pairs: usize,
    #[serde(flatten)]
    source: ComparedData,
    /// Text for the bins of the KL divergence and their rule for empty bins.
    kl_rule: String,
    /// Text with the other rule for empty bins; `None` for bins that are never empty.
    kl_other_rule: Option<String>,
    /// Mean exposure drop in EV.
    drop: Mean,
    exposure: MethodRow,
    /// One row for each noise profile and camera.
    noise: Vec<NoiseRow>,
    /// Fitted gains by noise profile; empty without `--fit`.
    fits: Vec<ProfileFit>,
    /// One line of text for each pair.
    #[serde(skip)]
    pair_lines: Vec<String>,
}

/// Histogram rules for the comparison of residuals.
#[derive(Debug, Clone, Copy)]
pub struct ResidualRules {
    /// Bins of the histograms.
    pub bins: Bins,
    /// Rule for empty bins.
    pub empty: EmptyBins,
}

impl ResidualRules {
    /// Text for the bins with a rule for empty bins.
    fn text(self, empty: EmptyBins) -> String {
        match self.bins {
            Bins::Fu => format!("{}; {empty}", self.bins),
            Bins::Kousha => self.bins.to_string(),
        }
    }
}

/// Data and settings of a comparison.
#[derive(Debug, Clone, Serialize)]
pub struct ComparedData {
    /// Seed of the noise.
    pub seed: u64,
    /// Settings of the synthesis, by noise profile.
    pub synthesis: serde_json::Value,
    /// Number of images without a partner.
    pub unmatched: usize,
    #[serde(flatten)]
    pub left_out: LeftOut,
}

/// Names of the pairs that were not compared, by reason.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Pairs whose images could not be decoded or compared.
    pub failed: Vec<String>,
    /// Pairs whose low-light image is brighter than the other image.
    pub swapped: Vec<String>,
    /// Pairs whose images show different scenes.
    pub two_scenes: Vec<String>,
}

impl LeftOut {
    /// True if every pair was compared.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// One text for each reason, with its number of pairs.
    fn reasons(&self) -> impl Iterator<Item = String> {
        [
            (&self.failed, "failed"),
            (&self.swapped, "left out as swapped"),
            (&self.two_scenes, "left out as images of two scenes"),
        ]
        .into_iter()
        .filter(|(names, _)| !names.is_empty())
        .map(|(names, why)| format!("{} {why}", counted(names.len(), "pair")))
    }
}

/// Similarity of a synthetic image to the real one, as text.
fn similarity_text(comparison: &ImageComparison) -> String {
    let (psnr, ssim, kl) = (comparison.psnr, comparison.ssim, comparison.kl.nats);
    format!("PSNR {psnr:.2} SSIM {ssim:.4} D_KL {kl:.3}")
}

/// Lines of text for one pair: exposure drop alone, then each noise method.
fn pair_lines(pair: &PairComparison) -> impl Iterator<Item = String> {
    let head = format!("{}: drop {:.3} EV", pair.pair, pair.drop);
    let alone = format!("{head}; alone {}", similarity_text(&pair.exposure));
    let noise = pair.noise.iter().map(move |noise| {
        let numbers = similarity_text(&noise.image);
        format!("{}: with noise, {}: {numbers}", pair.pair, noise.method)
    });
    std::iter::once(alone).chain(noise)
}

impl RealismSummary {
    /// Computes the means over all pairs.
    ///
    /// # Errors
    /// If no pair was compared.
    pub fn new(
        rules: ResidualRules,
        source: ComparedData,
        pairs: &[&PairComparison],
        fits: Vec<ProfileFit>,
    ) -> Result<Self> {
        let drops: Vec<f64> = pairs.iter().map(|pair| f64::from(pair.drop)).collect();
        let exposures: Vec<&ImageComparison> = pairs.iter().map(|pair| &pair.exposure).collect();
        let (Some(drop), Some(exposure)) = (Mean::from_values(&drops), MethodRow::new(&exposures)) else {
            return Err(Error::data("pairs", "none of them could be compared"));
        };
        Ok(Self {
            pairs: pairs.len(),
            kl_rule: rules.text(rules.empty),
            kl_other_rule: (rules.bins == Bins::Fu).then(|| rules.text(rules.empty.other())),
            drop,
            exposure,
            noise: NoiseRow::all(pairs),
            source,
            fits,
            pair_lines: pairs.iter().flat_map(|pair| pair_lines(pair)).collect(),
        })
    }

    /// Serializes the summary as JSON.
    #[must_use]
    pub fn json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    /// Formats the paper's table with intervals, the differences from exposure drop alone, the fitted gains, and notes.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!(
            "Synthetic against real low light, {}: mean ± half of the 95 % interval (Student's t, from {MIN_VALUES} pairs on)\n{}{}",
            counted(self.pairs, "pair"),
            self.methods_table(),
            self.differences_table(),
        );
        if !self.fits.is_empty() {
            text += &table(&self.fits);
        }
        format!("{text}{}\n", self.notes().join("\n"))
    }

    /// The paper's table, with a row for each way to synthesize the images.
    fn methods_table(&self) -> String {
        let exposure = ("exposure drop alone".to_owned(), &self.exposure);
        let noise = self.noise.iter().map(|row| (format!("with sensor noise, {}", row.method), &row.images));
        let mut builder = TableBuilder::new("realism", std::iter::once(exposure).chain(noise))
            .column(Text, "terminal", |(name, _)| name.clone())
            .column(Text, "terminal PSNR dB", |(_, row)| mean_text(&row.psnr, 2))
            .column(Text, "terminal SSIM", |(_, row)| mean_text(&row.ssim, 4))
            .column(Text, "terminal D_KL", |(_, row)| mean_text(&row.kl, 3))
            .column(Text, "terminal bins empty", |(_, row)| mean_text(&row.empty_bins, 1));
        if self.kl_other_rule.is_some() {
            let name = "terminal D_KL (other rule)";
            builder = builder.column(Text, name, |(_, row)| mean_text(&row.kl_other, 3));
        }
        terminal::table(&[builder.build()])
    }

    /// Table of the mean differences between noise and exposure drop alone, paired by image.
    fn differences_table(&self) -> String {
        let table = TableBuilder::new("differences", &self.noise)
            .column(Text, "terminal noise − exposure drop alone", |row| row.method.to_string())
            .column(Text, "terminal PSNR dB", |row| difference_text(&row.differences.psnr, 2))
            .column(Text, "terminal SSIM", |row| difference_text(&row.differences.ssim, 4))
            .column(Text, "terminal D_KL", |row| difference_text(&row.differences.kl, 3))
            .column(Count, "terminal pairs", |row| row.differences.psnr.n)
            .build();
        terminal::table(&[table])
    }

    /// Notes below the tables: rules of the numbers, a line for each pair, and pairs left out.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec![format!(
            "D_KL(real ‖ synthetic) of residuals over the dropped clean image, in nats: {}",
            self.kl_rule
        )];
        if let Some(rule) = &self.kl_other_rule {
            notes.push(format!("other rule: {rule}"));
        }
        notes.push("exposure drop alone has no residual: its D_KL shows the rule, not noise".to_owned());
        notes.push(
            "D_KL is least with more noise than a picture has, because residuals also hold misalignment and tone: --fit goes by the spread of smooth blocks, never by D_KL"
                .to_owned(),
        );
        let mut clean: Vec<String> = self
            .noise
            .iter()
            .map(|row| {
                let psnr = mean_text(&row.clean_psnr, 2);
                format!("{} {psnr} dB", row.method.profile)
            })
            .collect();
        clean.dedup();
        notes.push(format!(
            "drop {} EV; PSNR of the sensor branch without noise: {}",
            mean_text(&self.drop, 3),
            clean.join(", ")
        ));
        notes.extend(self.pair_lines.iter().cloned());
        notes.extend(fit_lines(&self.fits));
        let mut left_out: Vec<String> = self.source.left_out.reasons().collect();
        if self.source.unmatched > 0 {
            let images = counted(self.source.unmatched, "image");
            left_out.push(format!("{images} without a partner"));
        }
        if !left_out.is_empty() {
            notes.push(left_out.join(", "));
        }
        notes
    }
}

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
pub fn pairs(pairs: &[&PairComparison]) -> Result<Vec<u8>> {
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
pub struct PooledResiduals {
    pub real: Residuals,
    pub noise: Vec<(NoiseMethod, Residuals)>,
}

/// CSV file with the mean and standard deviation of real and synthetic residuals by clean code.
pub fn by_code(residuals: &PooledResiduals) -> Result<Vec<u8>> {
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
pub fn figure(residuals: &PooledResiduals) -> Result<String> {
    let mut lines = histogram("real", LineStyle::BLACK, residuals.real.shares());
    for (style, (method, noise)) in residuals.noise.iter().enumerate() {
        lines.extend(histogram(&format!("synthetic, {method}"), LineStyle(style), noise.shares()));
    }
    point_figure(vec![Panel {
        title: "Residuals over the dropped clean image, all pairs".to_owned(),
        x: Scale::Numbers("residual in 8-bit codes"),
        y: Scale::Numbers("log10 of the share of samples"),
        lines,
        model: None,
    }])
}

/// Smallest share that is drawn.
const MIN_SHARE: f64 = 1e-7;

/// Histogram on a logarithmic scale as lines, with gaps at residuals that do not occur. A residual without neighbours
/// is a point.
fn histogram(name: &str, style: LineStyle, shares: impl Iterator<Item = (i32, f64)>) -> Vec<PlotLine> {
    let (points, paths): (Vec<_>, Vec<_>) = shares
        .collect::<Vec<_>>()
        .split(|(_, share)| *share <= MIN_SHARE)
        .filter(|run| !run.is_empty())
        .map(|run| run.iter().map(|(size, share)| [f64::from(*size), libm::log10(*share)]).collect::<Vec<_>>())
        .partition(|run| run.len() == 1);
    let points = LineContent::points(points.concat());
    let contents = paths.into_iter().map(LineContent::Path).chain([points]);
    contents.map(|content| PlotLine::new(name.to_owned(), style, content)).filter(|line| !line.is_empty()).collect()
}

/// Sheet of crops from each pair, brightened by its exposure drop: real image, exposure drop alone, and each noise
/// method.
#[must_use]
pub fn crops<'a>(pairs: impl Iterator<Item = (&'a PairComparison, &'a [Rgb])>) -> Rgb {
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

/// Remark on the gain of a saved image, printed with every gain.
pub const AS_SAVED: &str = "as saved; a smaller K than the sensor's means that noise was averaged away";

/// Table of the gains over pairs, with a row for each noise profile.
fn table(fits: &[ProfileFit]) -> String {
    let table = TableBuilder::new("fits", fits)
        .column(Text, "terminal", |fit| fit.profile.to_string())
        .column(Text, "terminal K", |fit| fit.pooled.as_ref().map(|gains| gain_text(fit, gains, 1.0)))
        .column(Text, "terminal rK", |fit| {
            let product = gain_text(fit, fit.pooled.as_ref()?, fit.ratio?);
            Some(format!("{product} at r {}", number(fit.ratio?)))
        })
        .column(Text, "terminal 10–90 %", |fit| {
            let [low, high] = fit.pooled.as_ref()?.range.map(number);
            Some(format!("{low} to {high}"))
        })
        .column(Text, "terminal pairs fitted", |fit| {
            let fitted = fit.pooled.as_ref().map_or(0, |gains| gains.n);
            format!("{fitted} of {}", fit.pairs.len())
        })
        .build();
    format!("System gain K by the spread of smooth blocks, {AS_SAVED}\n{}", terminal::table(&[table]))
}

/// Geometric mean of K times a factor, with its interval; a list of all values if they are too few for an interval.
fn gain_text(fit: &ProfileFit, gains: &PooledGain, factor: f64) -> String {
    if let Some(Mean { value, interval: Some([low, high]), .. }) = gains.mean {
        let [value, low, high] = [value, low, high].map(|gain| number(factor * gain));
        return format!("{value} ({low} to {high})");
    }
    fit.pairs
        .iter()
        .filter_map(|pair| pair.fit.fitted())
        .map(|gain| number(factor * gain))
        .collect::<Vec<_>>()
        .join(", ")
}

/// One line of text for each pair and each noise profile.
fn fit_lines(fits: &[ProfileFit]) -> impl Iterator<Item = String> {
    fits.iter().flat_map(|fit| fit.pairs.iter().map(|pair| pair_line(fit, pair)))
}

fn pair_line(fit: &ProfileFit, PairFit { pair, fit: result }: &PairFit) -> String {
    let gain = result.gain.map(|gain| match fit.ratio {
        Some(ratio) => format!("rK {} (K {} at r {})", number(ratio * gain), number(gain), number(ratio)),
        None => format!("K {}", number(gain)),
    });
    let misfit = result.misfit.map(|misfit| format!("misfit {misfit:.2}"));
    let outcome = (result.outcome != FitOutcome::Fitted).then(|| result.outcome.to_string());
    let parts: Vec<String> = [gain, misfit, outcome].into_iter().flatten().collect();
    format!("{pair}, {}: {}", fit.profile, parts.join(", "))
}

/// Formats a number with three significant digits.
fn number(value: f64) -> String {
    let digits = 2 - libm::log10(value.abs().max(1e-9)).floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// CSV file with a row for each pair and each noise profile.
pub fn fits_csv(fits: &[ProfileFit]) -> Result<Vec<u8>> {
    let rows = fits.iter().flat_map(|fit| fit.pairs.iter().map(move |pair| (fit, pair)));
    let table = TableBuilder::new("fits", rows)
        .column(Text, "csv pair", |(_, pair)| pair.pair.clone())
        .column(Text, "csv reading", |(fit, _)| fit.profile.to_string())
        .column(Number, "csv gain", |(_, pair)| pair.fit.gain)
        .column(Number, "csv ratio", |(fit, _)| fit.ratio)
        .column(Number, "csv ratio_gain", |(fit, pair)| Some(fit.ratio? * pair.fit.gain?))
        .column(Number, "csv misfit", |(_, pair)| pair.fit.misfit)
        .column(Text, "csv outcome", |(_, pair)| pair.fit.outcome.word())
        .build();
    csv(&[table])
}

/// Means over pairs for one way to synthesize the low-light images.
#[derive(Debug, Serialize)]
pub(super) struct MethodRow {
    pub psnr: Mean,
    pub ssim: Mean,
    pub kl: Mean,
    pub kl_other: Mean,
    /// Number of bins that are empty on the synthetic side only.
    pub empty_bins: Mean,
}

impl MethodRow {
    /// Computes the means over images; `None` without any.
    fn new(images: &[&ImageComparison]) -> Option<Self> {
        Some(Self {
            psnr: mean(images, |image| image.psnr)?,
            ssim: mean(images, |image| image.ssim)?,
            kl: mean(images, |image| image.kl.nats)?,
            kl_other: mean(images, |image| image.kl_other.nats)?,
            empty_bins: mean(images, |image| image.kl.empty as f64)?,
        })
    }
}

fn mean(images: &[&ImageComparison], value: fn(&ImageComparison) -> f64) -> Option<Mean> {
    let values: Vec<f64> = images.iter().map(|image| value(image)).collect();
    Mean::from_values(&values)
}

/// Means over pairs for one noise method.
#[derive(Debug, Serialize)]
pub(super) struct NoiseRow {
    #[serde(flatten)]
    pub method: NoiseMethod,
    #[serde(flatten)]
    pub images: MethodRow,
    /// PSNR in dB of the sensor branch without noise.
    pub clean_psnr: Mean,
    pub differences: Differences,
}

/// Means of the paired differences from exposure drop alone.
#[derive(Debug, Serialize)]
pub(super) struct Differences {
    /// Difference in PSNR, in dB.
    pub psnr: Mean,
    pub ssim: Mean,
    /// Difference in KL divergence, in nats.
    pub kl: Mean,
}

impl NoiseRow {
    /// Rows of all noise methods. All pairs have the same methods in the same order.
    fn all(pairs: &[&PairComparison]) -> Vec<Self> {
        let Some(first) = pairs.first() else {
            return Vec::new();
        };
        first
            .noise
            .iter()
            .enumerate()
            .filter_map(|(index, noise)| {
                let comparisons: Vec<(&ImageComparison, &NoiseComparison)> =
                    pairs.iter().filter_map(|pair| Some((&pair.exposure, pair.noise.get(index)?))).collect();
                Self::new(&noise.method, &comparisons)
            })
            .collect()
    }

    fn new(method: &NoiseMethod, pairs: &[(&ImageComparison, &NoiseComparison)]) -> Option<Self> {
        let images: Vec<&ImageComparison> = pairs.iter().map(|(_, noise)| &noise.image).collect();
        let clean: Vec<f64> = pairs.iter().map(|(_, noise)| noise.clean_psnr).collect();
        let differences: Vec<[f64; 3]> =
            pairs.iter().map(|(exposure, noise)| noise.image.differences(exposure)).collect();
        let [psnr, ssim, kl] = [0, 1, 2].map(|index: usize| {
            let values: Vec<f64> = differences.iter().map(|values| values[index]).collect();
            Mean::from_values(&values)
        });
        Some(Self {
            method: method.clone(),
            images: MethodRow::new(&images)?,
            clean_psnr: Mean::from_values(&clean)?,
            differences: Differences { psnr: psnr?, ssim: ssim?, kl: kl? },
        })
    }
}

/// Formats a mean with half the width of its interval, if it has one.
fn mean_text(mean: &Mean, digits: usize) -> String {
    if mean.value.is_infinite() {
        let sign = if mean.value < 0.0 { "−" } else { "" };
        return format!("{sign}∞");
    }
    match mean.interval {
        Some([low, high]) => format!("{:.digits$} ±{:.digits$}", mean.value, (high - low) / 2.0),
        None => format!("{:.digits$}", mean.value),
    }
}

/// Formats a mean difference with its sign, and half the width of its interval, if it has one.
fn difference_text(mean: &Mean, digits: usize) -> String {
    let sign = if mean.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", mean_text(mean, digits).replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_have_gaps() {
        let shares = [(-1, 0.1), (0, 0.8), (1, 0.1), (2, 0.0), (3, 0.01), (4, 1e-8)];
        let lines = histogram("real", LineStyle::BLACK, shares.into_iter());
        let [LineContent::Path(path), LineContent::Points(points)] = [&lines[0].content, &lines[1].content] else {
            panic!("{lines:?}");
        };
        assert_eq!(path[..], [[-1.0, -1.0], [0.0, libm::log10(0.8)], [1.0, -1.0]]);
        assert_eq!(points.iter().map(|(x, y)| [*x, y.value]).collect::<Vec<_>>(), [[3.0, -2.0]]);
    }

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in
            [(0.044_712, "0.0447"), (0.2, "0.2"), (8.942, "8.94"), (200.0, "200"), (1234.5, "1234"), (30.0, "30")]
        {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn differences_have_signs_and_intervals() {
        for (numbers, text) in [
            (&[1.0, 2.0][..], "+1.50"),
            (&[-1.0, -2.0], "−1.50"),
            (&[0.0, 0.0], "0.00"),
            (&[1.0, 2.0, 3.0], "+2.00 ±2.48"),
            (&[f64::NEG_INFINITY, 1.0], "−∞"),
            (&[f64::INFINITY, 1.0], "+∞"),
        ] {
            assert_eq!(difference_text(&Mean::from_values(numbers).unwrap(), 2), text);
        }
    }
}
