//! [`EnhancerNote`]: the manifest's entry about an enhancer.
//!
//! Counts of the image sizes in which an enhancer ran: [`SizeLog`].

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};

use serde::{Deserialize, Serialize};

use crate::types::Flaw;
use crate::types::text::counted;

/// Sidecar key: the images were enhanced by another program.
pub const ELSEWHERE: &str = "enhanced";

/// Sidecar key: the data that the model was trained on.
pub const TRAINED_ON: &str = "trained_on";

/// How a run used an enhancer, and whether its images are plausible as enhanced images.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EnhancerNote {
    /// Conventions for the model's input and output.
    #[serde(default)]
    pub convention: Vec<ConventionLine>,
    /// How image sizes were adapted to the model, in words; empty before the first image.
    #[serde(default)]
    pub sizes: String,
    /// The counts behind `sizes`. An image that was enhanced again after an interruption counts twice.
    #[serde(default)]
    pub size_counts: SizeLog,
    /// True if an image was resized for the model, so that the results are not those at the image's own size.
    #[serde(default)]
    pub resized: bool,
    /// Findings of the probe before the first question; `None` if it was not run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe: Option<ProbeNote>,
    /// Time for an image, by size; empty if it was not measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub latency: Vec<EnhancerLatency>,
    /// Caveats for readers of the results, as sentences that follow the enhancer's name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Flaws of the images enhanced during the run.
    #[serde(default)]
    pub judged: JudgedImages,
    /// Burnt-out images of the run, by condition.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub burnt_out: BTreeMap<String, BurntOutImages>,
}

/// Time that an enhancer takes for an image of one size, one image after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EnhancerLatency {
    /// Width of the images, in pixels.
    pub width: usize,
    /// Height of the images, in pixels.
    pub height: usize,
    /// Number of images.
    pub images: usize,
    /// Median time, in milliseconds.
    pub median_ms: f64,
    /// Time that 95 % of the images do not exceed, in milliseconds.
    pub within_95_ms: f64,
    /// True if the only image also took the preparation for its size.
    pub with_preparation: bool,
    /// Largest number of threads for an image.
    pub threads: usize,
    /// Architecture and name of the CPU.
    pub machine: String,
}

impl fmt::Display for EnhancerLatency {
    /// `640 × 480: 38 ms per image (median of 20 images; 95 % within 44 ms), up to 2 threads of x86_64, NAME OF THE CPU`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, images, threads, machine, .. } = self;
        let [median, most] = [self.median_ms, self.within_95_ms].map(milliseconds);
        let sample = if self.with_preparation {
            "one image, with the preparation for its size".to_owned()
        } else {
            format!("median of {}; 95 % within {most} ms", counted(*images, "image"))
        };
        let threads = counted(*threads, "thread");
        write!(f, "{width} × {height}: {median} ms per image ({sample}), up to {threads} of {machine}")
    }
}

/// Milliseconds with two digits at least: `0.48`, `4.8`, `48`, `480`.
#[must_use]
pub fn milliseconds(value: f64) -> String {
    let decimals = match value {
        ..1.0 => 2,
        1.0..10.0 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

/// Burnt-out images of one condition: most of their pixels are white, although those of the degraded images differ.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BurntOutImages {
    /// The number of images.
    pub images: usize,
    /// The sum of their percentages of white pixels.
    pub percents: usize,
    /// The first of their frames by name.
    pub example: String,
}

/// One convention for a model's input or output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ConventionLine {
    /// The key of the sidecar, or a fact of the graph.
    pub key: String,
    /// The value.
    pub value: String,
    /// Origin of the value: the sidecar, a preset, the graph, the probe, or the default.
    pub source: String,
}

/// Result of probing an enhancer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeNote {
    /// The number of dark frames that were enhanced.
    pub frames: usize,
    /// The output value ranges with which the images are plausible.
    pub plausible: Vec<String>,
    /// The problem found; `None` if there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
    /// Consequence for the run.
    pub outcome: ProbeOutcome,
}

/// Consequence of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProbeOutcome {
    /// The images are plausible as enhanced images.
    Plausible,
    /// The images are unusual. They are accepted, because some models produce such images and the user stated the
    /// conventions.
    Doubtful,
    /// The images are implausible; the run continued because the user overruled the probe.
    Overruled,
}

/// Counts of the enhanced images of dark frames that were checked, and of those with a flaw.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JudgedImages {
    /// The number of images that were checked.
    pub images: usize,
    /// The numbers of images with a flaw, by flaw.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub flawed: BTreeMap<Flaw, usize>,
    /// The first images with a flaw in sorted order, at most [`JudgedImages::EXAMPLES`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub examples: Vec<FlawedImage>,
}

/// One image with a flaw.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FlawedImage {
    /// The frame.
    pub frame: String,
    /// The condition.
    pub condition: String,
    /// Flaw of the image.
    pub flaw: Flaw,
}

impl EnhancerNote {
    /// Data that the model was trained on; `None` if the sidecar does not state them.
    #[must_use]
    pub fn trained_on(&self) -> Option<&str> {
        let line = self.convention.iter().find(|line| line.key == TRAINED_ON)?;
        Some(&line.value)
    }

    /// Counts a burnt-out image of a frame and condition, with its percentage of white pixels.
    pub fn count_burnt_out(&mut self, frame: String, condition: String, white: u8) {
        let found = BurntOutImages { images: 1, percents: white.into(), example: frame };
        self.burnt_out.entry(condition).or_default().add(&found);
    }

    /// Merges the note of an earlier session of the run into this one.
    #[must_use]
    pub fn with_earlier(mut self, earlier: Option<Self>) -> Self {
        let Some(earlier) = earlier else { return self };
        self.judged.add(&earlier.judged);
        for (condition, images) in &earlier.burnt_out {
            let all = self.burnt_out.entry(condition.clone()).or_default();
            all.add(images);
        }
        self.resized |= earlier.resized;
        self.probe = self.probe.or(earlier.probe);
        if self.latency.is_empty() {
            self.latency = earlier.latency;
        }
        for remark in earlier.remarks {
            if !self.remarks.contains(&remark) {
                self.remarks.push(remark);
            }
        }
        if self.sizes.is_empty() {
            self.sizes = earlier.sizes;
            self.size_counts = earlier.size_counts;
        } else if earlier.size_counts != SizeLog::default() {
            self.size_counts.add(&earlier.size_counts);
            self.sizes = self.size_counts.summary();
        }
        self
    }
}

impl BurntOutImages {
    /// Adds other images of the same condition.
    fn add(&mut self, other: &Self) {
        self.images += other.images;
        self.percents += other.percents;
        // The first by name, so that the example does not depend on the order of the images.
        if self.example.is_empty() || other.example < self.example {
            self.example.clone_from(&other.example);
        }
    }
}

impl JudgedImages {
    /// Largest number of examples; chosen.
    pub const EXAMPLES: usize = 6;

    /// The number of images with a flaw.
    #[must_use]
    pub fn flaws(&self) -> usize {
        self.flawed.values().sum()
    }

    /// Counts one more image.
    pub fn count(&mut self, flawed: Option<FlawedImage>) {
        self.images += 1;
        let Some(image) = flawed else { return };
        *self.flawed.entry(image.flaw).or_default() += 1;
        // Sorted, so that the examples do not depend on the order of the images.
        let place = self.examples.partition_point(|known| *known < image);
        self.examples.insert(place, image);
        self.examples.truncate(Self::EXAMPLES);
    }

    /// Adds the counts of an earlier command or of another shard.
    pub fn add(&mut self, other: &Self) {
        self.images += other.images;
        for (flaw, count) in &other.flawed {
            *self.flawed.entry(*flaw).or_default() += count;
        }
        self.examples.extend(other.examples.iter().cloned());
        self.examples.sort();
        self.examples.dedup();
        self.examples.truncate(Self::EXAMPLES);
    }
}

/// Counts of the ways in which image sizes were adapted to an enhancer, with their parameters. An image can be both
/// padded and tiled.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SizeLog {
    /// Images that were enhanced.
    pub images: usize,
    /// Images that were enhanced at their own size.
    pub whole: usize,
    /// Images that were padded on the right and at the bottom, and cropped afterwards.
    pub padded: usize,
    /// Images that were cut into tiles.
    pub tiled: usize,
    /// Images that were resized to the model's fixed size and back (`--llie-options resize`).
    pub resized: usize,
    /// Images that were reduced by `--llie-options max-side` and enlarged again.
    pub reduced: usize,
    /// Fixed width and height of the model's input; `None` for a side of any length.
    pub fixed: Option<[Option<usize>; 2]>,
    /// Sides must be multiples of this many pixels; `None` if any size will do.
    pub multiple: Option<usize>,
    /// Padding mode, as `reflect`; `None` if no image was padded.
    pub pad: Option<String>,
    /// Width and height of the largest tiles; `None` if no image was cut.
    pub tile: Option<[usize; 2]>,
    /// Largest context of tiles in pixels; `None` if no image was cut.
    pub context: Option<usize>,
    /// Measured radius of the receptive field, in pixels; `None` if it was not measured.
    pub reach: Option<usize>,
    /// Comparison of the pixels in the overlap of two tiles.
    pub seam: SeamCounts,
    /// Images that were not enhanced because of the time limit.
    pub too_long: usize,
}

/// Comparison of the samples in the overlap of two tiles, over all images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeamCounts {
    /// Samples that were compared.
    pub compared: usize,
    /// Number of these that are nearly black in both tiles, where a seam cannot be seen.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub black: usize,
    /// Samples that differed.
    pub differing: usize,
    /// Largest difference in 8-bit codes.
    pub most: u8,
}

/// Whether a count is 0.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl SizeLog {
    /// Adds the counts of another session of the same model.
    pub fn add(&mut self, other: &Self) {
        let Self {
            images,
            whole,
            padded,
            tiled,
            resized,
            reduced,
            fixed,
            multiple,
            pad,
            tile,
            context,
            reach,
            seam,
            too_long,
        } = other;
        self.images += images;
        self.whole += whole;
        self.padded += padded;
        self.tiled += tiled;
        self.resized += resized;
        self.reduced += reduced;
        self.too_long += too_long;
        self.fixed = fixed.or(self.fixed);
        self.multiple = multiple.or(self.multiple);
        self.pad = pad.clone().or(self.pad.take());
        // Maxima do not depend on the order of the images.
        self.tile = self.tile.max(*tile);
        self.context = self.context.max(*context);
        self.reach = self.reach.max(*reach);
        self.seam.compared += seam.compared;
        self.seam.black += seam.black;
        self.seam.differing += seam.differing;
        self.seam.most = self.seam.most.max(seam.most);
    }

    /// Difference to an earlier state of this log.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            images: self.images - earlier.images,
            whole: self.whole - earlier.whole,
            padded: self.padded - earlier.padded,
            tiled: self.tiled - earlier.tiled,
            resized: self.resized - earlier.resized,
            reduced: self.reduced - earlier.reduced,
            too_long: self.too_long - earlier.too_long,
            seam: SeamCounts {
                compared: self.seam.compared - earlier.seam.compared,
                black: self.seam.black - earlier.seam.black,
                differing: self.seam.differing - earlier.seam.differing,
                // A maximum cannot be subtracted; adding the difference to `earlier` gives the same maximum.
                most: self.seam.most,
            },
            ..self.clone()
        }
    }

    /// Summary in words, as `12 images: 8 as they are, 4 in tiles of 512 × 512 with 8 px context`.
    #[must_use]
    pub fn summary(&self) -> String {
        let pad = self.pad.as_deref().unwrap_or_default();
        let parts: Vec<String> = [
            (self.whole, "as they are".to_owned()),
            (self.padded, format!("filled ({pad}) and cropped")),
            (self.tiled, self.tiles()),
            (self.resized, format!("resized to {} and back", self.fixed())),
            (self.reduced, "reduced by --llie-options max-side and enlarged".to_owned()),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, words)| if count == self.images { words } else { format!("{count} {words}") })
        .collect();
        let mut text = counted(self.images, "image");
        if !parts.is_empty() {
            // Writing to a string cannot fail.
            let _ = write!(text, ": {}", parts.join(", "));
        }
        if self.too_long > 0 {
            let _ = write!(text, "; {} took too long", self.too_long);
        }
        text
    }

    /// The tiles with their context and seams.
    fn tiles(&self) -> String {
        let [width, height] = self.tile.unwrap_or_default();
        let seam = if self.seam.black > 0 && self.seam.differing == 0 && self.seam.black * 10 >= self.seam.compared * 9
        {
            "seams could not be checked, because the images are nearly black there".to_owned()
        } else if self.seam.differing == 0 {
            "no difference at seams".to_owned()
        } else {
            let SeamCounts { compared, differing, most, .. } = self.seam;
            format!("{differing} of {compared} samples at seams differ, by up to {most}")
        };
        format!("in tiles of {width} × {height} with {} px context ({seam})", self.context.unwrap_or(0))
    }

    /// The fixed input size of the model, as `96 × any`.
    fn fixed(&self) -> String {
        let [width, height] = self
            .fixed
            .unwrap_or_default()
            .map(|side: Option<usize>| side.map_or("any".to_owned(), |side| side.to_string()));
        format!("{width} × {height}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(frame: &str) -> FlawedImage {
        FlawedImage { frame: frame.to_owned(), condition: "L3+noise+m".to_owned(), flaw: Flaw::Flat }
    }

    #[test]
    fn sizes_of_all_sessions_are_counted() {
        let both = note(31, 2).with_earlier(Some(note(9, 0)));
        assert_eq!(both.size_counts, note(40, 2).size_counts);
        assert_eq!(both.sizes, note(40, 2).sizes);
        // A session without images keeps the earlier counts.
        let empty = EnhancerNote::default();
        assert_eq!(empty.with_earlier(Some(note(9, 0))), note(9, 0));
        // A manifest of an earlier version has the words alone.
        let words = EnhancerNote { sizes: "9 images: as they are".to_owned(), ..EnhancerNote::default() };
        assert_eq!(note(31, 0).with_earlier(Some(words)), note(31, 0));
    }

    fn note(whole: usize, reduced: usize) -> EnhancerNote {
        let counts = SizeLog { images: whole + reduced, whole, reduced, ..SizeLog::default() };
        EnhancerNote { sizes: counts.summary(), size_counts: counts, ..EnhancerNote::default() }
    }

    #[test]
    fn burnt_out_images_of_all_sessions_are_counted() {
        let note = |frames: &[(&str, u8)]| {
            let mut note = EnhancerNote::default();
            for (frame, white) in frames {
                note.count_burnt_out((*frame).to_owned(), "L1+ev+m".to_owned(), *white);
            }
            note
        };
        let both = note(&[("c", 97), ("b", 60)]).with_earlier(Some(note(&[("a", 80)])));
        assert_eq!(both.burnt_out, note(&[("a", 80), ("b", 60), ("c", 97)]).burnt_out);
        assert_eq!(both.burnt_out["L1+ev+m"].example, "a");
        let plain = serde_json::to_value(EnhancerNote::default()).unwrap();
        assert_eq!(plain.get("burnt_out"), None);
    }

    #[test]
    fn examples_do_not_depend_on_the_order() {
        let names: Vec<String> = (0..9).map(|i| format!("f{i}")).collect();
        let [mut one, mut other] = [JudgedImages::default(), JudgedImages::default()];
        for name in &names {
            one.count(Some(image(name)));
        }
        names.iter().rev().for_each(|name| other.count(Some(image(name))));
        assert_eq!(one, other);
        assert_eq!((one.flaws(), one.examples.len()), (9, 6));
        let mut parts = JudgedImages::default();
        parts.count(None);
        parts.count(Some(image("f0")));
        let mut rest = JudgedImages::default();
        names[1..].iter().for_each(|name| rest.count(Some(image(name))));
        parts.add(&rest);
        assert_eq!((parts.images, &parts.examples), (10, &one.examples));
    }

    #[test]
    fn summary_lists_size_adaptations() {
        let log = SizeLog {
            images: 12,
            whole: 8,
            padded: 1,
            tiled: 4,
            pad: Some("reflect".to_owned()),
            tile: Some([512, 384]),
            context: Some(8),
            ..SizeLog::default()
        };
        assert_eq!(
            log.summary(),
            "12 images: 8 as they are, 1 filled (reflect) and cropped, 4 in tiles of 512 × 384 with 8 px context (no difference at seams)"
        );
        let log = SizeLog { images: 1, resized: 1, fixed: Some([Some(96), None]), too_long: 2, ..SizeLog::default() };
        assert_eq!(log.summary(), "1 image: resized to 96 × any and back; 2 took too long");
        assert_eq!(SizeLog::default().summary(), "0 images");
        let json = serde_json::to_value(&log).unwrap();
        assert_eq!(json["fixed"], serde_json::json!([96, null]));
    }
}
