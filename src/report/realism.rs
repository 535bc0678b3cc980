//! What a comparison with real pairs shows: [`RealismSummary`], and the files and figures beside it.

use serde::Serialize;

use super::csv::csv;
use super::histogram::{HistogramLine, histogram};
use super::sheet::{self, CropRow};
use super::table::ColumnKind::{Count, Number, Text};
use super::table::TableBuilder;
use super::terminal;
use crate::error::{Error, Result};
use crate::score::realism::mean::Mean;
use crate::score::realism::residual::{Bins, EmptyBins, Residuals};
use crate::score::realism::{ImageComparison, PairComparison};
use crate::types::Rgb;

/// All pairs together.
#[derive(Debug, Serialize)]
pub(crate) struct RealismSummary {
    pairs: usize,
    #[serde(flatten)]
    source: ComparedData,
    /// The rule of the divergence.
    kl_rule: String,
    /// The other rule about empty bins, where it matters.
    kl_other_rule: Option<String>,
    /// The mean exposure drop in EV.
    drop: Mean,
    exposure: MethodRow,
    noise: MethodRow,
    clean_psnr: Mean,
    /// A line for each pair.
    #[serde(skip)]
    by_pair: Vec<String>,
}

/// By which rules residuals are compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResidualRules {
    /// The bins.
    pub bins: Bins,
    /// What is done about empty ones.
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

/// What was compared.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ComparedData {
    /// The seed of the noise.
    pub seed: u64,
    /// The choices of the synthesis.
    pub synthesis: serde_json::Value,
    /// Images without a partner.
    pub unmatched: usize,
    /// Pairs that could not be compared.
    pub failed: usize,
}

/// One pair in a line, exposure drop alone before noise.
fn line(pair: &PairComparison) -> String {
    let [ev, noise] = [&pair.exposure, &pair.noise].map(|measured| {
        let (psnr, ssim, kl) = (measured.psnr, measured.ssim, measured.kl.nats);
        format!("PSNR {psnr:.2} SSIM {ssim:.4} D_KL {kl:.3}")
    });
    format!(
        "{}: drop {:.3} EV; alone {ev}; with noise {noise}",
        pair.pair, pair.drop
    )
}

/// One way to make the dark images.
#[derive(Debug, Serialize)]
struct MethodRow {
    psnr: Mean,
    ssim: Mean,
    kl: Mean,
    kl_other: Mean,
    /// Bins that are empty on the synthetic side alone, mean over pairs.
    empty_bins: Mean,
}

impl MethodRow {
    fn of(
        compared: &[&PairComparison],
        of: fn(&PairComparison) -> &ImageComparison,
    ) -> Option<Self> {
        let mean = |number: fn(&ImageComparison) -> f64| {
            let numbers: Vec<f64> = compared.iter().map(|pair| number(of(pair))).collect();
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
    /// Takes the means over all pairs.
    ///
    /// # Errors
    /// Where there is none.
    pub(crate) fn new(
        rules: ResidualRules,
        source: ComparedData,
        compared: &[&PairComparison],
    ) -> Result<Self> {
        let mean = |number: fn(&PairComparison) -> f64| {
            let numbers: Vec<f64> = compared.iter().map(|pair| number(pair)).collect();
            Mean::of(&numbers)
        };
        let summary = || {
            Some(Self {
                pairs: compared.len(),
                kl_rule: rules.named(rules.empty),
                kl_other_rule: (rules.bins == Bins::Fu).then(|| rules.named(rules.empty.other())),
                drop: mean(|pair| f64::from(pair.drop))?,
                exposure: MethodRow::of(compared, |pair| &pair.exposure)?,
                noise: MethodRow::of(compared, |pair| &pair.noise)?,
                clean_psnr: mean(|pair| pair.clean_psnr)?,
                source,
                by_pair: compared.iter().map(|pair| line(pair)).collect(),
            })
        };
        summary().ok_or_else(|| Error::data("pairs", "none of them could be compared"))
    }

    /// As JSON.
    #[must_use]
    pub(crate) fn json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    /// The paper's table, with intervals, and with the rules of its numbers below it.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let ways = [
            ("exposure drop alone", &self.exposure),
            ("with sensor noise", &self.noise),
        ];
        let mut layout = TableBuilder::new("realism", ways)
            .column(Text, "terminal", |(name, _)| *name)
            .column(Text, "terminal PSNR dB", |(_, row)| shown(&row.psnr, 2))
            .column(Text, "terminal SSIM", |(_, row)| shown(&row.ssim, 4))
            .column(Text, "terminal D_KL", |(_, row)| shown(&row.kl, 3))
            .column(Text, "terminal bins empty", |(_, row)| {
                shown(&row.empty_bins, 1)
            });
        if self.kl_other_rule.is_some() {
            let name = "terminal D_KL (other rule)";
            layout = layout.column(Text, name, |(_, row)| shown(&row.kl_other, 3));
        }
        let table = terminal::table(&[layout.made()]);
        let title = format!(
            "Synthetic against real low light, {} pairs: mean ± half of the 95 % interval (Student's t)",
            self.pairs
        );
        format!("{title}\n{table}{}\n", self.notes().join("\n"))
    }

    /// What stands below the table: the rules of its numbers, and each pair.
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
            "exposure drop alone has no residual: its D_KL tells of the rule, not of noise"
                .to_owned(),
        );
        notes.push(format!(
            "drop {} EV; PSNR of the sensor branch without noise {} dB",
            shown(&self.drop, 3),
            shown(&self.clean_psnr, 2)
        ));
        notes.extend(self.by_pair.iter().cloned());
        if failed > 0 || unmatched > 0 {
            notes.push(format!(
                "{failed} pairs failed, {unmatched} images without a partner"
            ));
        }
        notes
    }
}

fn shown(mean: &Mean, digits: usize) -> String {
    if mean.value.is_infinite() {
        return "∞".to_owned();
    }
    match mean.interval {
        Some([low, high]) => format!("{:.digits$} ±{:.digits$}", mean.value, (high - low) / 2.0),
        None => format!("{:.digits$}", mean.value),
    }
}

/// A row a pair and way of making it.
pub(crate) fn pairs(compared: &[&PairComparison]) -> Result<Vec<u8>> {
    let rows = compared.iter().flat_map(|pair| {
        [("ev", &pair.exposure), ("noise", &pair.noise)].map(|(way, made)| (*pair, way, made))
    });
    let table = TableBuilder::new("pairs", rows)
        .column(Text, "csv pair", |(pair, _, _)| pair.pair.clone())
        .column(Text, "csv drop", |(pair, _, _)| pair.drop.to_string())
        .column(Text, "csv variant", |(_, way, _)| *way)
        .column(Number, "csv psnr", |(_, _, made)| made.psnr)
        .column(Number, "csv ssim", |(_, _, made)| made.ssim)
        .column(Number, "csv kl", |(_, _, made)| made.kl.nats)
        .column(Number, "csv kl_other", |(_, _, made)| made.kl_other.nats)
        .column(Count, "csv empty_bins", |(_, _, made)| made.kl.empty)
        .column(Number, "csv clean_psnr", |(pair, _, _)| pair.clean_psnr)
        .made();
    csv(&[table])
}

/// The spread of real and synthetic residuals by clean code.
pub(crate) fn by_code(residuals: &[Residuals; 2]) -> Result<Vec<u8>> {
    let [real, noise] = residuals;
    let table = TableBuilder::new("residuals", real.by_code().zip(noise.by_code()))
        .column(Text, "csv code", |((code, _, _), _)| code.to_string())
        .column(Text, "csv n", |((_, n, _), _)| n.to_string())
        .column(Number, "csv real_mean", |((_, _, real), _)| real[0])
        .column(Number, "csv real_std", |((_, _, real), _)| real[1])
        .column(Number, "csv noise_mean", |(_, (_, _, noise))| noise[0])
        .column(Number, "csv noise_std", |(_, (_, _, noise))| noise[1])
        .made();
    csv(&[table])
}

/// Both residual histograms.
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

/// Crops of the first pairs, in the light of the image that they were made from.
#[must_use]
pub(crate) fn crops<'a>(pairs: impl Iterator<Item = (&'a PairComparison, &'a [Rgb; 3])>) -> Rgb {
    let rows: Vec<CropRow<'_>> = pairs
        .map(|(compared, images)| CropRow {
            name: format!("{} (drop {:.2} EV)", compared.pair, compared.drop),
            images: images.iter().collect(),
            amplified: f64::from(compared.drop).exp2(),
        })
        .collect();
    sheet::crops(&["real", "exposure drop alone", "with sensor noise"], &rows)
}
