//! Report of a comparison with real pairs: [`RealismSummary`], its files and its figures.

use serde::Serialize;

use super::csv::csv;
use super::histogram::{HistogramLine, histogram};
use super::sheet::{self, CropRow};
use super::table::ColumnKind::{Count, Number, Text};
use super::table::TableBuilder;
use super::terminal;
use super::words::counted;
use crate::error::{Error, Result};
use crate::score::realism::mean::Mean;
use crate::score::realism::residual::{Bins, EmptyBins, Residuals};
use crate::score::realism::{ImageComparison, PairComparison};
use crate::types::Rgb;

/// Summary over all pairs.
#[derive(Debug, Serialize)]
pub(crate) struct RealismSummary {
    pairs: usize,
    #[serde(flatten)]
    source: ComparedData,
    /// Bins and rule for empty bins of the divergence, in words.
    kl_rule: String,
    /// The same with the other rule for empty bins; `None` for bins that are never empty.
    kl_other_rule: Option<String>,
    /// Mean exposure drop in EV.
    drop: Mean,
    exposure: MethodRow,
    noise: MethodRow,
    clean_psnr: Mean,
    /// A line of text for each pair.
    #[serde(skip)]
    by_pair: Vec<String>,
}

/// The rules by which residuals are compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResidualRules {
    /// Bins of the histograms.
    pub bins: Bins,
    /// Rule for empty bins.
    pub empty: EmptyBins,
}

impl ResidualRules {
    fn named(self, empty: EmptyBins) -> String {
        match self.bins {
            Bins::Fu => format!("{}; {empty}", self.bins),
            Bins::Kousha => self.bins.to_string(),
        }
    }
}

/// The data and settings of a comparison.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ComparedData {
    /// Seed of the noise.
    pub seed: u64,
    /// Settings of the synthesis.
    pub synthesis: serde_json::Value,
    /// Number of images without a partner.
    pub unmatched: usize,
    /// Number of pairs that could not be compared.
    pub failed: usize,
}

/// The numbers of one pair as a line of text, exposure drop alone first.
fn line(pair: &PairComparison) -> String {
    let [ev, noise] = [&pair.exposure, &pair.noise].map(|comparison| {
        let (psnr, ssim, kl) = (comparison.psnr, comparison.ssim, comparison.kl.nats);
        format!("PSNR {psnr:.2} SSIM {ssim:.4} D_KL {kl:.3}")
    });
    format!(
        "{}: drop {:.3} EV; alone {ev}; with noise {noise}",
        pair.pair, pair.drop
    )
}

/// Means over pairs for one way of making the low-light images.
#[derive(Debug, Serialize)]
struct MethodRow {
    psnr: Mean,
    ssim: Mean,
    kl: Mean,
    kl_other: Mean,
    /// Number of bins that are empty on the synthetic side only.
    empty_bins: Mean,
}

impl MethodRow {
    fn of(pairs: &[&PairComparison], of: fn(&PairComparison) -> &ImageComparison) -> Option<Self> {
        let mean = |number: fn(&ImageComparison) -> f64| {
            let numbers: Vec<f64> = pairs.iter().map(|pair| number(of(pair))).collect();
            Mean::of(&numbers)
        };
        Some(Self {
            psnr: mean(|m| m.psnr)?,
            ssim: mean(|m| m.ssim)?,
            kl: mean(|m| m.kl.nats)?,
            kl_other: mean(|m| m.kl_other.nats)?,
            empty_bins: mean(|m| m.kl.empty as f64)?,
        })
    }
}

impl RealismSummary {
    /// Means over all pairs.
    ///
    /// # Errors
    /// If there is no pair.
    pub(crate) fn new(
        rules: ResidualRules,
        source: ComparedData,
        pairs: &[&PairComparison],
    ) -> Result<Self> {
        let mean = |number: fn(&PairComparison) -> f64| {
            let numbers: Vec<f64> = pairs.iter().map(|pair| number(pair)).collect();
            Mean::of(&numbers)
        };
        let summary = || {
            Some(Self {
                pairs: pairs.len(),
                kl_rule: rules.named(rules.empty),
                kl_other_rule: (rules.bins == Bins::Fu).then(|| rules.named(rules.empty.other())),
                drop: mean(|pair| f64::from(pair.drop))?,
                exposure: MethodRow::of(pairs, |pair| &pair.exposure)?,
                noise: MethodRow::of(pairs, |pair| &pair.noise)?,
                clean_psnr: mean(|pair| pair.clean_psnr)?,
                source,
                by_pair: pairs.iter().map(|pair| line(pair)).collect(),
            })
        };
        summary().ok_or_else(|| Error::data("pairs", "none of them could be compared"))
    }

    /// The summary as JSON.
    #[must_use]
    pub(crate) fn json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    /// The paper's table with intervals, and notes on the rules of its numbers below it.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let variants = [
            ("exposure drop alone", &self.exposure),
            ("with sensor noise", &self.noise),
        ];
        let mut layout = TableBuilder::new("realism", variants)
            .column(Text, "terminal", |(name, _)| *name)
            .column(Text, "terminal PSNR dB", |(_, row)| mean_text(&row.psnr, 2))
            .column(Text, "terminal SSIM", |(_, row)| mean_text(&row.ssim, 4))
            .column(Text, "terminal D_KL", |(_, row)| mean_text(&row.kl, 3))
            .column(Text, "terminal bins empty", |(_, row)| {
                mean_text(&row.empty_bins, 1)
            });
        if self.kl_other_rule.is_some() {
            let name = "terminal D_KL (other rule)";
            layout = layout.column(Text, name, |(_, row)| mean_text(&row.kl_other, 3));
        }
        let table = terminal::table(&[layout.build()]);
        let title = format!(
            "Synthetic against real low light, {} pairs: mean ± half of the 95 % interval (Student's t)",
            self.pairs
        );
        format!("{title}\n{table}{}\n", self.notes().join("\n"))
    }

    /// The notes below the table: the rules of its numbers, and a line for each pair.
    fn notes(&self) -> Vec<String> {
        let ComparedData {
            unmatched, failed, ..
        } = self.source;
        let mut notes = vec![format!(
            "D_KL(real ‖ synthetic) of residuals over the dropped clean image, in nats: {}",
            self.kl_rule
        )];
        let other = self.kl_other_rule.iter();
        notes.extend(other.map(|rule| format!("other rule: {rule}")));
        notes.push(
            "exposure drop alone has no residual: its D_KL shows the rule, not noise".to_owned(),
        );
        notes.push(format!(
            "drop {} EV; PSNR of the sensor branch without noise {} dB",
            mean_text(&self.drop, 3),
            mean_text(&self.clean_psnr, 2)
        ));
        notes.extend(self.by_pair.iter().cloned());
        if failed > 0 || unmatched > 0 {
            notes.push(format!(
                "{} failed, {} without a partner",
                counted(failed, "pair"),
                counted(unmatched, "image")
            ));
        }
        notes
    }
}

fn mean_text(mean: &Mean, digits: usize) -> String {
    if mean.value.is_infinite() {
        return "∞".to_owned();
    }
    match mean.interval {
        Some([low, high]) => format!("{:.digits$} ±{:.digits$}", mean.value, (high - low) / 2.0),
        None => format!("{:.digits$}", mean.value),
    }
}

/// CSV file with a row for each pair and each way of making its image.
pub(crate) fn pairs(pairs: &[&PairComparison]) -> Result<Vec<u8>> {
    let rows = pairs.iter().flat_map(|pair| {
        [("ev", &pair.exposure), ("noise", &pair.noise)]
            .map(|(variant, comparison)| (*pair, variant, comparison))
    });
    let table = TableBuilder::new("pairs", rows)
        .column(Text, "csv pair", |(pair, _, _)| pair.pair.clone())
        .column(Text, "csv drop", |(pair, _, _)| pair.drop.to_string())
        .column(Text, "csv variant", |(_, variant, _)| *variant)
        .column(Number, "csv psnr", |(_, _, comparison)| comparison.psnr)
        .column(Number, "csv ssim", |(_, _, comparison)| comparison.ssim)
        .column(Number, "csv kl", |(_, _, comparison)| comparison.kl.nats)
        .column(Number, "csv kl_other", |(_, _, comparison)| {
            comparison.kl_other.nats
        })
        .column(Count, "csv empty_bins", |(_, _, comparison)| {
            comparison.kl.empty
        })
        .column(Number, "csv clean_psnr", |(pair, _, _)| pair.clean_psnr)
        .build();
    csv(&[table])
}

/// CSV file with the mean and standard deviation of real and synthetic residuals by clean code.
pub(crate) fn by_code(residuals: &[Residuals; 2]) -> Result<Vec<u8>> {
    let [real, noise] = residuals;
    let table = TableBuilder::new("residuals", real.by_code().zip(noise.by_code()))
        .column(Text, "csv code", |((code, _, _), _)| code.to_string())
        .column(Text, "csv n", |((_, n, _), _)| n.to_string())
        .column(Number, "csv real_mean", |((_, _, real), _)| real[0])
        .column(Number, "csv real_std", |((_, _, real), _)| real[1])
        .column(Number, "csv noise_mean", |(_, (_, _, noise))| noise[0])
        .column(Number, "csv noise_std", |(_, (_, _, noise))| noise[1])
        .build();
    csv(&[table])
}

/// Figure of the histograms of real and synthetic residuals.
pub(crate) fn figure([real, noise]: &[Residuals; 2]) -> Result<String> {
    let line = |name: &str, residuals: &Residuals| HistogramLine {
        name: name.to_owned(),
        shares: residuals.shares().collect(),
    };
    let lines = [
        line("real", real),
        line("synthetic, with sensor noise", noise),
    ];
    histogram("Residuals over the dropped clean image, all pairs", &lines)
}

/// Crops of pairs, brightened by the exposure drop of each pair.
#[must_use]
pub(crate) fn crops<'a>(pairs: impl Iterator<Item = (&'a PairComparison, &'a [Rgb; 3])>) -> Rgb {
    let rows: Vec<CropRow<'_>> = pairs
        .map(|(pair, images)| CropRow {
            name: format!("{} (drop {:.2} EV)", pair.pair, pair.drop),
            images: images.iter().collect(),
            amplified: f64::from(pair.drop).exp2(),
        })
        .collect();
    sheet::crops(&["real", "exposure drop alone", "with sensor noise"], &rows)
}
