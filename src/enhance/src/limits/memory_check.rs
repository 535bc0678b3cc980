//! Check, before a large run, that its memory is free: [`MemoryCheck`].
//!
//! The estimate is of the size that is really fed, whatever it was made of: a wrong multiple or fixed size of a sidecar makes a
//! small image large. Nothing that is checked has been allocated yet.

use super::memory::{self, MemoryCost, PROBE_SIDES};
use crate::conventions::Locality;
use crate::failure::{RunFailure, format_size};
use crate::graphs::{Arena, Graph, RunResult};
use crate::sizing::{CODES, MAX_WHOLE, SizeRule, TileWindow, texture};
use darkqa_ground::error::Result;

/// Memory that a model needs, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Estimate {
    /// It has not been measured yet.
    Unknown,
    /// It cannot be measured, so that only the tensors of input and output count.
    Tensors,
    /// It was measured.
    Measured(MemoryCost),
}

/// The check of one model.
#[derive(Debug, Clone)]
pub(crate) struct MemoryCheck(Estimate);

impl MemoryCheck {
    /// A check that has measured nothing yet.
    pub(crate) fn new() -> Self {
        Self(Estimate::Unknown)
    }

    /// Checks a run of this height and width on an image of `size`; the inner error states the required and the free memory, and a remedy.
    pub(crate) fn run(
        &mut self,
        graph: &Graph,
        rule: SizeRule,
        fed: [usize; 2],
        size: [usize; 2],
    ) -> Result<std::result::Result<(), String>> {
        let pixels = fed[0].saturating_mul(fed[1]);
        let Some(available) = memory::available().filter(|_| pixels > MAX_WHOLE) else {
            return Ok(Ok(()));
        };
        let runs = graph.batch().saturating_mul(pixels);
        let tensors = MemoryCost::for_tensors();
        let mut checked = tensors.fits(runs, available);
        if checked.is_ok() {
            if self.0 == Estimate::Unknown {
                self.0 = measure(graph, rule, available)?;
            }
            if let Estimate::Measured(cost) = self.0 {
                checked = cost.fits(pixels, available);
            }
        }
        Ok(checked.map_err(|[needed, available]| {
            format!(
                "needs about {needed:.1} GB of memory for {}, but {available:.1} GB are free; {}",
                format_size(fed),
                remedy(rule, fed, size)
            )
        }))
    }
}

/// Message for a run on an image of `size` that ONNX Runtime ended because it did not get its memory.
pub(crate) fn out_of_memory(failure: &RunFailure, rule: SizeRule, size: [usize; 2]) -> String {
    let RunFailure::NoMemory { fed, requested } = failure else {
        return failure.message();
    };
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 / 1e9);
    let requested = requested.map_or(String::new(), |bytes| {
        format!("{} were needed at once, ", gigabytes(bytes))
    });
    let free = memory::available().map_or("too few GB".to_owned(), gigabytes);
    let (words, remedy) = (failure.message(), remedy(rule, *fed, size));
    format!("{words}: {requested}{free} are free; {remedy}")
}

/// Remedy for lack of memory in a run of `fed` on an image of `size`.
fn remedy(rule: SizeRule, fed: [usize; 2], size: [usize; 2]) -> String {
    const SMALLER: &str = "--llie-options max-side=1280 enhances a smaller image";
    let much_larger = fed[0] * fed[1] > 4 * size[0] * size[1];
    match rule.tile {
        _ if much_larger && !rule.takes_any_size() => format!(
            "the image has only {}: check the size that its graph or MODEL.onnx.toml fixes",
            format_size(size)
        ),
        _ if much_larger => format!(
            "the image has only {}: check `multiple = {}` in MODEL.onnx.toml or the preset",
            format_size(size),
            rule.multiple
        ),
        _ if !rule.takes_any_size() => {
            "export it for a smaller size, or with dynamic_axes".to_owned()
        }
        Some(Locality::Global) => SMALLER.to_owned(),
        Some(Locality::Exact(_)) => "--llie-options tile=256 needs a fraction of it".to_owned(),
        None => format!(
            "--llie-options tile=256 needs a fraction of it if a pixel depends only on the pixels around it; otherwise {SMALLER}"
        ),
    }
}

/// Memory cost, measured on small images. A probe that could itself need more than half of the free memory, if the memory
/// grows with the square of the pixels, is left out.
fn measure(graph: &Graph, rule: SizeRule, available: u64) -> Result<Estimate> {
    if graph.signature.height.is_some() || graph.signature.width.is_some() {
        return Ok(Estimate::Tensors);
    }
    // Sides that suit common multiples; a multiple that no small image has is likely wrong, and is not probed.
    let sides = PROBE_SIDES.map(|side| match rule.multiple {
        multiple if multiple <= PROBE_SIDES[0] => side.next_multiple_of(multiple),
        _ => side,
    });
    let mut measured: Vec<(usize, u64)> = Vec::new();
    // Memory that earlier images left in the arena is released first; else the probes would reuse it and show no growth.
    if !probe(graph, sides[0], Arena::Released)? {
        return Ok(Estimate::Tensors);
    }
    for side in sides {
        if MemoryCost::worst_case_bytes(&measured, side * side) > available as f64 / 2.0 {
            break;
        }
        let ran = probe(graph, side, Arena::Kept)?;
        let (true, Some(resident)) = (ran, memory::resident()) else {
            return Ok(Estimate::Tensors);
        };
        measured.push((side * side, resident));
    }
    Ok(MemoryCost::from_probes(&measured).map_or(Estimate::Tensors, Estimate::Measured))
}

/// Runs a model on a small image; returns whether that worked.
fn probe(graph: &Graph, side: usize, arena: Arena) -> Result<bool> {
    let window = TileWindow::whole([side; 2]);
    graph.restart_clock();
    let image = texture([side; 2], &CODES[1]);
    let result = graph.probe_memory(&image, window, arena)?;
    Ok(!matches!(result, RunResult::Failed(_)))
}
