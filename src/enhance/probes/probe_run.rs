//! Running the probe of a model on dark frames: [`Enhancer::probe`].
//!
//! Outputs of a model for the frames of a trial: [`run_frames`].
//!
//! Results of opening and probing an enhancer, to be stored and reused: [`ProbeFindings`].

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::plausible::UnclampedImage;
use super::probe::{self, Conclusion, OUTPUT, OutputEnds, PairTrial, Probe, RangePair, StatedRanges, black_and_white};
use super::usage::{ImageUse, Implausible, Judgement, Usage, doctor_advice, white_percent};
use crate::conventions::sidecar::{self, ADD, ModelSidecar};
use crate::conventions::{Rounding, ValueRange};
use crate::enhancer::Enhancer;
use crate::graphs::{Graph, RunResult};
use crate::outputs::expression_name;
use crate::planes::Planes;
use crate::sizing::AcceptedSizes;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{ConventionLine, ProbeNote, ProbeOutcome};
use darkqa_base::types::{EnhancerName, Flaw, Rgb};

/// Sizes of probe frames, tried in this order; longer and shorter side in pixels. Most multiples that models need
/// divide one of them.
const SIZES: [[usize; 2]; 3] = [[144, 96], [160, 120], [128, 128]];

/// Results of a model on dark frames.
pub(super) struct ProbeTrials<const N: usize> {
    /// The frames, in the size in which they were fed.
    pub(super) frames: Vec<Rgb>,
    /// Results by convention.
    pub(super) probes: [Probe; N],
}

impl Enhancer {
    /// Runs the model on dark frames, and chooses the value ranges that are not stated.
    ///
    /// # Errors
    /// If the images are implausible or the ranges ambiguous, unless implausible images are accepted. The message
    /// proposes sidecar lines.
    pub fn probe(&mut self, dark: &[Rgb], implausible: Implausible) -> Result<()> {
        if dark.is_empty() {
            let name = self.name();
            tracing::warn!("{name}: its images were not checked, because the frames show nothing");
            return Ok(());
        }
        let mut trials = self.trials(dark, [self.convention()], self.stated_ranges())?;
        if let (None, Some(frame)) = (&trials, dark.first()) {
            // The model may accept the frame's own size, or its accepted sizes are found by trial.
            self.enhance(frame)?;
            trials = self.trials(dark, [self.convention()], self.stated_ranges())?;
        }
        let Some(ProbeTrials { probes: [probe], .. }) = trials else {
            warn_not_probed(self.name());
            return Ok(());
        };
        let outcome = match probe.conclusion() {
            Conclusion::Plausible | Conclusion::Assumed => ProbeOutcome::Plausible,
            Conclusion::Doubtful(_) => ProbeOutcome::Doubtful,
            _ => ProbeOutcome::Overruled,
        };
        let problem = self.problem(&probe, dark)?;
        match (&problem, outcome, implausible) {
            (Some(problem), ProbeOutcome::Overruled, Implausible::Refused) => {
                return Err(self.error(format!("{problem}. {}", doctor_advice(self.path()))));
            }
            (Some(problem), ..) => tracing::warn!("{}: {problem}", self.name()),
            (None, ..) => {}
        }
        let no_image = match &problem {
            Some(_) => None,
            None => self.remark_on_endpoints(probe.usual)?.or_else(|| self.remark_on_name()),
        };
        if let Some(remark) = &no_image {
            self.remark(remark);
        }
        self.log_remarks();
        if probe.conclusion() == Conclusion::Assumed {
            self.warn_ranges_assumed(probe.usual, no_image.is_none());
        }
        let note = ProbeNote {
            frames: dark.len(),
            plausible: probe.plausible().iter().map(ToString::to_string).collect(),
            problem,
            outcome,
        };
        self.set_probe_result(note)
    }

    /// Message about the flaw of a probe's images, with a remedy; `None` if they are plausible. Without a preset,
    /// corrected sidecar lines are searched by trial.
    fn problem(&self, probe: &Probe, dark: &[Rgb]) -> Result<Option<String>> {
        let problem = match probe.conclusion() {
            // A preset's convention comes from the authors' code, so no other one is proposed.
            Conclusion::Implausible(seen) | Conclusion::Doubtful(seen) if !self.follows_preset() => {
                let better = match (self.better_lines(dark)?, seen.example.flaw) {
                    // Noise, such as the output of random weights, is neither a residual nor a map.
                    (None, Flaw::Shuffled) => None,
                    (None, flaw) => self.better_expression(dark, flaw)?,
                    (lines, _) => lines,
                };
                better.map(|better| format!("{seen}. {better}"))
            }
            _ => None,
        };
        let Some(problem) = problem.or_else(|| probe.problem()) else {
            return Ok(None);
        };
        let problem = problem.replace(OUTPUT, &self.read_output());
        let unread = self
            .graph()
            .unread_images()
            .map_or(String::new(), |unread| format!(". Perhaps another output is needed: {unread}"));
        Ok(Some(sidecar::insert_sidecar_name(&(problem + &unread), self.path())))
    }

    /// The present image output, as a term of an expression.
    fn read_output(&self) -> String {
        match &self.graph().convention.image {
            Some(image) => format!("({image})"),
            None => expression_name(&self.graph().signature.outputs[0].port.name),
        }
    }

    /// Enhances the image of a frame and condition (`place`), judges the result, and returns it with its contribution
    /// to the usage record.
    ///
    /// # Errors
    /// As [`Self::enhance`], and if most images of dark frames so far are implausible.
    pub fn enhance_and_judge(
        &mut self,
        image: &Rgb,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<(Rgb, ImageUse)> {
        let before = self.sizes().clone();
        let enhanced = self.enhance(image)?;
        let used = ImageUse {
            // Judged in any case, because another run that reads the image from a store may need the judgement.
            seen: Judgement::on([image, &enhanced]),
            white: white_percent([image, &enhanced]),
            sizes: self.sizes().since(&before),
        };
        used.count_burnt_out(&self.usage(), place, implausible);
        self.judge(&used.seen, place, implausible)?;
        Ok((enhanced, used))
    }

    /// Records an image of a frame and condition (`place`) from another run or process, as if it was enhanced now.
    ///
    /// # Errors
    /// If most images of dark frames so far are implausible.
    pub fn judge_stored(&self, used: &ImageUse, place: [&dyn ToString; 2], implausible: Implausible) -> Result<()> {
        used.record(&self.usage(), self.path(), place, implausible)
    }

    fn judge(&self, seen: &Judgement, place: [&dyn ToString; 2], implausible: Implausible) -> Result<()> {
        seen.record(&self.usage(), self.path(), place, implausible)
    }

    /// Runs the model on dark frames in each of these conventions, which differ only in the decoding of the output,
    /// with each pair of ranges that the stated ones allow. If the usual pair is implausible, normalised pairs are
    /// tried, too, and all are ranked by the outputs for black and white. Returns `None` if the model fails at all
    /// sizes of the probe.
    pub(super) fn trials<const N: usize>(
        &self,
        dark: &[Rgb],
        conventions: [&ModelSidecar; N],
        [input, output]: [Option<ValueRange>; 2],
    ) -> Result<Option<ProbeTrials<N>>> {
        let usual = self.ranges();
        let ranges = match (input, output) {
            (Some(_), Some(_)) => StatedRanges::Both,
            (None, None) => StatedRanges::Neither,
            _ => StatedRanges::One,
        };
        for size in SIZES {
            let frames: Vec<Rgb> = dark.iter().map(|frame| self.probe_image(frame, size)).collect::<Result<_>>()?;
            let plain = RangePair::plain(input, output);
            // A failure in one range does not predict failure in the others at this size.
            let Some(pairs) = self.pair_trials(&frames, conventions, &plain)? else {
                continue;
            };
            let mut probes = pairs.map(|pairs| Probe { ranges, usual, pairs });
            let usual_pair = probes[0].usual_pair();
            if usual_pair.is_none_or(|pair| pair.verdict().is_some()) {
                if !self.is_dim(&probes[0], conventions[0])? {
                    let [inputs, outputs] = self.scales_to_try(input, output);
                    let pairs = RangePair::normalised(&inputs, &outputs);
                    for fed_alike in pairs.chunk_by(|a, b| a.input == b.input) {
                        // The plain ranges have shown that this size works, so a failure here is no reason to try
                        // another.
                        let more = self.pair_trials(&frames, conventions, fed_alike)?;
                        for (probe, pairs) in probes.iter_mut().zip(more.into_iter().flatten()) {
                            probe.pairs.extend(pairs);
                        }
                    }
                }
                for (probe, convention) in probes.iter_mut().zip(conventions) {
                    self.rank(probe, convention)?;
                }
            }
            return Ok(Some(ProbeTrials { frames, probes }));
        }
        Ok(None)
    }

    /// True if the images in the usual ranges are merely dim: not brighter, but with black and white preserved.
    fn is_dim(&self, probe: &Probe, convention: &ModelSidecar) -> Result<bool> {
        let verdict = probe.usual_pair().and_then(PairTrial::verdict);
        if verdict.is_none_or(|seen| seen.example.flaw != Flaw::Unlit) {
            return Ok(false);
        }
        let endpoints = self.endpoints(convention, probe.usual)?;
        Ok(endpoints.is_some_and(OutputEnds::are_near))
    }

    /// Trials of the frames in each of these conventions with each pair of ranges. The model runs once for each frame
    /// and input range. Returns `None` if it fails on a frame.
    fn pair_trials<const N: usize>(
        &self,
        frames: &[Rgb],
        conventions: [&ModelSidecar; N],
        ranges: &[RangePair],
    ) -> Result<Option<[Vec<PairTrial>; N]>> {
        let seen: Vec<UnclampedImage> = frames.iter().map(UnclampedImage::from_rgb).collect();
        let mut pairs = [(); N].map(|()| Vec::new());
        for fed_alike in ranges.chunk_by(|a, b| a.input == b.input) {
            let graphs: Vec<Graph> = conventions
                .iter()
                .flat_map(|convention| fed_alike.iter().map(|ranges| self.read_by(convention, *ranges)))
                .collect::<Result<_>>()?;
            let Some(made) = run_frames(&graphs, frames)? else {
                return Ok(None);
            };
            let mut made = made.into_iter();
            for pairs in &mut pairs {
                let trials = fed_alike.iter().zip(&mut made);
                pairs.extend(trials.map(|(ranges, made)| PairTrial::new(*ranges, &seen, made)));
            }
        }
        Ok(Some(pairs))
    }

    /// Measures the outputs for black and white of the plausible pairs, and ranks the pairs by them.
    fn rank(&self, probe: &mut Probe, convention: &ModelSidecar) -> Result<()> {
        for pair in &mut probe.pairs {
            if pair.verdict().is_none() {
                pair.endpoints = self.endpoints(convention, pair.ranges)?;
            }
        }
        probe.rank();
        Ok(())
    }

    /// Warns that the value ranges are assumed. If the output seems to be the image, the message proposes lines that
    /// confirm them.
    fn warn_ranges_assumed(&self, usual: RangePair, is_image: bool) {
        let lines = if is_image { format!(". To confirm, {ADD}: {}", usual.stated()) } else { String::new() };
        let words = format!(
            "value ranges of {usual} assumed, because nothing sets them; its images of dark frames are plausible{lines}"
        );
        let words = sidecar::insert_sidecar_name(&words, self.path());
        tracing::warn!("{}: {words}", self.name());
    }

    /// Outputs for black and white in a convention with these ranges; `None` if the model fails or its output is not
    /// finite.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(super) fn endpoints(&self, convention: &ModelSidecar, ranges: RangePair) -> Result<Option<OutputEnds>> {
        let graph = self.read_by(convention, ranges)?;
        let image = black_and_white(self.probe_size(probe::SIZE));
        let made = run_frames(&[graph], &[image])?;
        let codes = made.into_iter().flatten().flatten().next();
        let endpoints = codes.as_ref().map(OutputEnds::from_codes);
        Ok(endpoints.filter(|endpoints| endpoints.distance.is_finite()))
    }

    /// The model's graph in a convention with these ranges.
    pub(super) fn read_by(&self, convention: &ModelSidecar, ranges: RangePair) -> Result<Graph> {
        let convention = convention.clone().with_input_scale(ranges.input).with_output_scale(ranges.output);
        let graph = self.graph().with_convention(convention);
        graph.map_err(|problem| self.error(problem))
    }

    /// A frame resized to a size of the probe, or to the model's fixed size.
    pub(super) fn probe_image(&self, frame: &Rgb, [longer, shorter]: [usize; 2]) -> Result<Rgb> {
        let size = if frame.height() > frame.width() { [longer, shorter] } else { [shorter, longer] };
        let [height, width] = self.probe_size(size);
        let planes = Planes::from_rgb(frame).resized(height, width);
        let planes = planes.map_err(|problem| self.error(problem))?;
        planes.to_rgb(Rounding::Round).ok_or_else(|| self.error("a frame of the probe has no pixel"))
    }
}

/// Runs a model on frames, and decodes the outputs by the conventions of several graphs with the same input encoding.
/// Returns the outputs by graph and frame; `None` if the model fails on a frame.
pub(super) fn run_frames(graphs: &[Graph], frames: &[Rgb]) -> Result<Option<Vec<Vec<UnclampedImage>>>> {
    let mut all = vec![Vec::with_capacity(frames.len()); graphs.len()];
    let Some(graph) = graphs.first() else {
        return Ok(Some(all));
    };
    for frame in frames {
        graph.restart_clock();
        let decodings = match graph.run_with_conventions(frame, graphs)? {
            RunResult::Output(decodings) => decodings,
            RunResult::Failed(_) => return Ok(None),
            // The plausibility rules then report the flaw.
            RunResult::Unusable(_) => {
                vec![UnclampedImage::not_a_number([frame.height(), frame.width()]); graphs.len()]
            }
        };
        for (made, codes) in all.iter_mut().zip(decodings) {
            made.push(codes);
        }
    }
    Ok(Some(all))
}

/// Results of opening an enhancer and probing it on dark frames: the content of its usage record before the first
/// image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeFindings {
    /// Rows of the table of the model's input and output convention.
    convention: Vec<ConventionLine>,
    /// Result of the probe; `None` if the model accepts none of its sizes.
    probe: Option<ProbeNote>,
    /// Caveats for readers of the results.
    #[serde(default)]
    remarks: Vec<String>,
    /// Message about the accepted sizes, if they were found by trial.
    sizes: Option<String>,
}

impl ProbeFindings {
    /// True if a run with this reaction to implausible images may use the enhancer.
    pub fn allow(&self, implausible: Implausible) -> bool {
        let probe = self.probe.as_ref();
        let is_overruled = probe.is_some_and(|probe| probe.outcome == ProbeOutcome::Overruled);
        implausible != Implausible::Refused || !is_overruled
    }

    /// A usage record that starts with these findings.
    pub fn usage(&self) -> Usage {
        let usage = Usage::default();
        usage.update(|note| {
            note.convention.clone_from(&self.convention);
            note.probe.clone_from(&self.probe);
            note.remarks.clone_from(&self.remarks);
        });
        usage
    }

    /// Repeats the warnings of the probe.
    pub fn warn(&self, name: &EnhancerName, path: &Path) {
        if let Some(sizes) = &self.sizes {
            tracing::warn!("{}: {sizes}", path.display());
        }
        for remark in &self.remarks {
            tracing::warn!("{name}: {remark}");
        }
        match &self.probe {
            None => warn_not_probed(name),
            Some(probe) => {
                if let Some(problem) = &probe.problem {
                    tracing::warn!("{name}: {problem}");
                }
            }
        }
    }
}

/// Warns about a model that accepts none of the sizes of the probe.
fn warn_not_probed(name: &EnhancerName) {
    tracing::warn!(
        "{name}: its images were not checked, because it fails at small sizes such as 144 × 96; look at some of them"
    );
}

impl Enhancer {
    /// Problem found by the probe, if the enhancer is used in spite of it; to be called after the probe.
    pub fn overruled_problem(&self) -> Option<String> {
        let probe = self.usage().note().probe?;
        let is_overruled = probe.outcome == ProbeOutcome::Overruled;
        probe.problem.filter(|_| is_overruled)
    }

    /// Results of opening and probing; to be called after the probe.
    pub fn findings(&self) -> ProbeFindings {
        let note = self.usage().note();
        ProbeFindings {
            convention: note.convention,
            probe: note.probe,
            remarks: note.remarks,
            sizes: self.found_sizes().map(AcceptedSizes::message),
        }
    }

    /// The enhancer with the findings of an earlier probe instead of a new one, and with a usage record that it
    /// continues.
    ///
    /// # Errors
    /// If the graph contradicts its own convention, which is a bug.
    pub fn with_findings(self, findings: &ProbeFindings, usage: Usage) -> Result<Self> {
        let mut enhancer = self.with_usage(usage);
        enhancer.set_remarks(&findings.remarks);
        if let Some(probe) = &findings.probe {
            enhancer.set_probe_result(probe.clone())?;
        }
        Ok(enhancer)
    }
}
