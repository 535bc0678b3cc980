//! Report on a comparison of synthetic with real low light: [`RealismSummary`], its files and its figures.

mod files;
mod fits;
mod rows;

use serde::Serialize;

pub(crate) use files::{PooledResiduals, by_code, crops, figure, pairs};
pub(crate) use fits::{AS_SAVED, csv as fits_csv};
use rows::{MethodRow, NoiseRow, difference_text, mean_text};

use crate::error::{Error, Result};
use crate::report::text::table::ColumnKind::{Count, Text};
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use crate::types::text::counted;
use darkqa_score::photographs::realism::gain::ProfileFit;
use darkqa_score::photographs::realism::mean::{MIN_VALUES, Mean};
use darkqa_score::photographs::realism::residual::{Bins, EmptyBins};
use darkqa_score::photographs::realism::{ImageComparison, PairComparison};

/// Summary over all pairs.
#[derive(Debug, Serialize)]
pub(crate) struct RealismSummary {
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
pub(crate) struct ResidualRules {
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
pub(crate) struct ComparedData {
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
pub(crate) struct LeftOut {
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
    pub(crate) fn is_empty(&self) -> bool {
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
    pub(crate) fn new(
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
    pub(crate) fn json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    /// Formats the paper's table with intervals, the differences from exposure drop alone, the fitted gains, and notes.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let mut text = format!(
            "Synthetic against real low light, {}: mean ± half of the 95 % interval (Student's t, from {MIN_VALUES} pairs on)\n{}{}",
            counted(self.pairs, "pair"),
            self.methods_table(),
            self.differences_table(),
        );
        if !self.fits.is_empty() {
            text += &fits::table(&self.fits);
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
        notes.extend(fits::pair_lines(&self.fits));
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
