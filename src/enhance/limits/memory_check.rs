//! Check that enough memory is free for a large run: [`MemoryCheck`].
//!
//! The estimate is based on the size of the input tensor, because a wrong multiple or fixed size in a sidecar can make
//! it much larger than the image. The check precedes the allocation.

use super::{MemoryCost, PROBE_SIDES};
use crate::conventions::Locality;
use crate::failure::{RunFailure, format_size};
use crate::graphs::{Arena, Graph, RunResult};
use crate::sizing::{CODES, MAX_WHOLE, SizeRule, TileWindow, texture};
use darkqa_base::error::Result;

/// Estimate of the memory that a model needs.
#[derive(Debug, Clone, Copy, PartialEq)]
enum MemoryEstimate {
    /// Not measured yet.
    Unknown,
    /// Cannot be measured; a lower bound from the input and output tensors is used instead.
    Tensors,
    /// Measured on small images.
    Measured(MemoryCost),
}

/// Memory check for one model.
#[derive(Debug, Clone)]
pub(crate) struct MemoryCheck(MemoryEstimate);

impl MemoryCheck {
    /// Creates a check without measurements.
    pub(crate) fn new() -> Self {
        Self(MemoryEstimate::Unknown)
    }

    /// Checks a run on an image. The sizes of the input and the image are heights and widths in pixels. Small inputs
    /// always pass.
    ///
    /// The inner error is a message with the needed memory, the free memory and a remedy.
    ///
    /// # Errors
    /// The outer error comes from the runs that measure memory.
    pub(crate) fn run(
        &mut self,
        graph: &Graph,
        rule: SizeRule,
        input_size: [usize; 2],
        image_size: [usize; 2],
    ) -> Result<std::result::Result<(), String>> {
        let pixels = input_size[0].saturating_mul(input_size[1]);
        let Some(available) = super::available().filter(|_| pixels > MAX_WHOLE) else {
            return Ok(Ok(()));
        };
        let batch_pixels = graph.batch().saturating_mul(pixels);
        let mut result = MemoryCost::for_tensors().check_fit(batch_pixels, available);
        if result.is_ok() {
            if self.0 == MemoryEstimate::Unknown {
                self.0 = measure(graph, rule, available)?;
            }
            if let MemoryEstimate::Measured(cost) = self.0 {
                result = cost.check_fit(pixels, available);
            }
        }
        Ok(result.map_err(|[needed, available]| {
            format!(
                "needs about {needed:.1} GB of memory for {}, but {available:.1} GB are free; {}",
                format_size(input_size),
                remedy(rule, input_size, image_size)
            )
        }))
    }
}

/// Message for an image on which ONNX Runtime could not allocate memory, with a remedy.
pub(crate) fn out_of_memory(failure: &RunFailure, rule: SizeRule, image_size: [usize; 2]) -> String {
    let RunFailure::NoMemory { fed, requested } = failure else {
        return failure.message();
    };
    let requested =
        requested.map_or(String::new(), |bytes| format!("{} were needed at once, ", format_gigabytes(bytes)));
    let free = super::available().map_or("too few GB".to_owned(), format_gigabytes);
    let (message, remedy) = (failure.message(), remedy(rule, *fed, image_size));
    format!("{message}: {requested}{free} are free; {remedy}")
}

fn format_gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

/// Remedy for a run without enough memory.
fn remedy(rule: SizeRule, input_size: [usize; 2], image_size: [usize; 2]) -> String {
    const SMALLER: &str = "--llie-options max-side=1280 enhances a smaller image";
    let input_pixels = input_size[0].saturating_mul(input_size[1]);
    let is_much_larger = input_pixels > 4 * image_size[0] * image_size[1];
    match rule.tile {
        _ if is_much_larger && !rule.takes_any_size() => format!(
            "the image has only {}: check the size that its graph or MODEL.onnx.toml fixes",
            format_size(image_size)
        ),
        _ if is_much_larger => format!(
            "the image has only {}: check `multiple = {}` in MODEL.onnx.toml or the preset",
            format_size(image_size),
            rule.multiple
        ),
        _ if !rule.takes_any_size() => "export it for a smaller size, or with dynamic_axes".to_owned(),
        Some(Locality::Global) => SMALLER.to_owned(),
        Some(Locality::Exact(_)) => "--llie-options tile=256 needs a fraction of it".to_owned(),
        None => format!(
            "--llie-options tile=256 needs a fraction of it if a pixel depends only on the pixels around it; otherwise {SMALLER}"
        ),
    }
}

/// Measures the memory cost on small images of increasing size. Stops before a probe that could need more than half of
/// the free memory, assuming quadratic growth.
fn measure(graph: &Graph, rule: SizeRule, available: u64) -> Result<MemoryEstimate> {
    if graph.signature.height.is_some() || graph.signature.width.is_some() {
        return Ok(MemoryEstimate::Tensors);
    }
    // Sides are padded to the model's multiple, unless it exceeds the smallest side: such a multiple is probably wrong.
    let sides = PROBE_SIDES.map(|side| match rule.multiple {
        multiple if multiple <= PROBE_SIDES[0] => side.next_multiple_of(multiple),
        _ => side,
    });
    let mut measured: Vec<(usize, u64)> = Vec::new();
    // Release the memory that earlier images left in the arena; otherwise the probes would reuse it and show no growth.
    if !probe(graph, sides[0], Arena::Released)? {
        return Ok(MemoryEstimate::Tensors);
    }
    for side in sides {
        if MemoryCost::worst_case_bytes(&measured, side * side) > available as f64 / 2.0 {
            break;
        }
        if !probe(graph, side, Arena::Kept)? {
            return Ok(MemoryEstimate::Tensors);
        }
        let Some(resident) = super::resident() else {
            return Ok(MemoryEstimate::Tensors);
        };
        measured.push((side * side, resident));
    }
    Ok(MemoryCost::from_probes(&measured).map_or(MemoryEstimate::Tensors, MemoryEstimate::Measured))
}

/// Runs a model on a square image with sides of `side` pixels; returns false if the run fails.
fn probe(graph: &Graph, side: usize, arena: Arena) -> Result<bool> {
    let window = TileWindow::whole([side; 2]);
    graph.restart_clock();
    let image = texture([side; 2], &CODES[1]);
    let result = graph.probe_memory(&image, window, arena)?;
    Ok(!matches!(result, RunResult::Failed(_)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::Padding;
    use crate::conventions::sidecar::ModelSidecar;

    #[test]
    fn remedy_for_huge_size_names_image() {
        let side = 1 << 32;
        let rule = SizeRule::new([Some(side); 2], &ModelSidecar::default(), Padding::Zero);
        let remedy = remedy(rule, [side; 2], [480, 640]);
        assert!(remedy.starts_with("the image has only 640 × 480"), "{remedy}");
    }
}
