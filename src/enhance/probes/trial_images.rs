//! Outputs of a model for the frames of a trial: [`run_frames`].

use super::plausible::UnclampedImage;
use crate::graphs::{Graph, RunResult};
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

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
