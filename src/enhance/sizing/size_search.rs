//! Search by trial for the sizes that a model accepts, after a failure at an image's size: [`SizeSearch`].

use super::texture::{CODES, texture};
use super::tiles::TileWindow;
use crate::conventions::sidecar::ADD;
use crate::failure::{RunFailure, format_size};
use crate::graphs::{Graph, RunResult};
use darkqa_base::error::Result;

/// Multiples that are tried, in this order, for networks that halve an image repeatedly, and for patches of 14 pixels.
pub(crate) const MULTIPLES: [usize; 17] = [1, 4, 8, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 96, 112, 128];

/// Minimum side of a trial image, in pixels; chosen for networks that halve the image five times.
const MIN_SIDE: usize = 64;

/// Sizes that a model accepts, found by trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AcceptedSizes {
    /// Sides that are multiples of this number, which is above 1.
    Multiple(usize),
    /// Only this height and width, frozen by tracing.
    Traced([usize; 2]),
}

impl AcceptedSizes {
    /// Message about the accepted sizes, with the sidecar line that states them.
    pub(crate) fn message(self) -> String {
        match self {
            Self::Multiple(multiple) => format!(
                "it takes only sides that are multiples of {multiple} pixels (found by trial), so other images are padded; to confirm, {ADD}: `multiple = {multiple}`"
            ),
            Self::Traced(size) => format!(
                "it was traced for {} and takes no other size, so other images are padded or tiled; export it without int(x.shape[..]) in its code, or {ADD}: `fixed = [{}, {}]`",
                format_size(size),
                size[1],
                size[0]
            ),
        }
    }
}

/// Search for the accepted sizes, made once per model.
#[derive(Debug, Clone, Default)]
pub(crate) struct SizeSearch {
    /// Sizes that may be frozen into the graph.
    traced: Vec<[usize; 2]>,
    state: SearchState,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum SearchState {
    /// Not made yet.
    #[default]
    Open,
    /// Without result: no tried size works, or the model accepts any multiple.
    Nothing,
    Found(AcceptedSizes),
}

impl SizeSearch {
    /// A search that also tries these heights and widths.
    pub(crate) fn new(traced: Vec<[usize; 2]>) -> Self {
        Self { traced, state: SearchState::Open }
    }

    /// Result of the search; `None` before the search or without a result.
    pub(crate) fn found(&self) -> Option<AcceptedSizes> {
        match self.state {
            SearchState::Found(found) => Some(found),
            SearchState::Open | SearchState::Nothing => None,
        }
    }

    /// Makes the search at the first call, and returns its result.
    pub(crate) fn run(&mut self, graph: &Graph) -> Result<Option<AcceptedSizes>> {
        if self.state == SearchState::Open {
            let found = match find_multiple(graph)? {
                Some(1) => None,
                Some(multiple) => Some(AcceptedSizes::Multiple(multiple)),
                None => self.find_traced_size(graph)?.map(AcceptedSizes::Traced),
            };
            self.state = found.map_or(SearchState::Nothing, SearchState::Found);
        }
        Ok(self.found())
    }

    /// Tries the sizes that may be frozen into the graph; returns the first at which the model runs.
    fn find_traced_size(&self, graph: &Graph) -> Result<Option<[usize; 2]>> {
        for size in &self.traced {
            match run_trial(graph, *size)? {
                TrialOutcome::Runs => return Ok(Some(*size)),
                TrialOutcome::Fails => {}
                TrialOutcome::OverLimit => return Ok(None),
            }
        }
        Ok(None)
    }
}

/// First of [`MULTIPLES`] at which the model runs; `None` if it runs at none of them.
///
/// Each multiple is tried at a size that is not a multiple of any larger one, so that success is evidence for this
/// multiple.
fn find_multiple(graph: &Graph) -> Result<Option<usize>> {
    for multiple in MULTIPLES {
        match run_trial(graph, trial_size(multiple))? {
            TrialOutcome::Runs => return Ok(Some(multiple)),
            TrialOutcome::Fails => {}
            TrialOutcome::OverLimit => return Ok(None),
        }
    }
    Ok(None)
}

/// Height and width of the trial image for a multiple: the multiple times two different primes of at least 3.
fn trial_size(multiple: usize) -> [usize; 2] {
    let mut primes = (3..)
        .filter(|n: &usize| (2..*n).all(|divisor| !n.is_multiple_of(divisor)))
        .skip_while(|n| n * multiple < MIN_SIDE);
    [(); 2].map(|()| primes.next().map_or(multiple, |prime| prime * multiple))
}

/// Result of a trial.
enum TrialOutcome {
    /// The model returned an image of the input's size, with any values.
    Runs,
    Fails,
    /// The run exceeded the limit of time or memory, so further trials make no sense.
    OverLimit,
}

fn run_trial(graph: &Graph, size: [usize; 2]) -> Result<TrialOutcome> {
    let window = TileWindow::whole(size);
    graph.restart_clock();
    let result = graph.probe(&texture(size, &CODES[1]), window)?;
    Ok(match result {
        RunResult::Output(()) | RunResult::Unusable(_) => TrialOutcome::Runs,
        RunResult::Failed(RunFailure::TimedOut(_) | RunFailure::MemoryExceeded(_)) => TrialOutcome::OverLimit,
        RunResult::Failed(_) => TrialOutcome::Fails,
    })
}

/// Message about `failure` for a model whose accepted sizes were not found.
pub(crate) fn sizes_not_found(failure: &RunFailure, search: &SizeSearch) -> String {
    let words = failure.message();
    if !failure.may_depend_on_size() {
        return words;
    }
    let traced = if search.traced.is_empty() { "" } else { ", and the sizes in its constants" };
    let tried = MULTIPLES[1..].iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    // The message about an output of another size has its own advice.
    let advice = if matches!(failure, RunFailure::WrongSize { .. }) {
        ""
    } else {
        "; export it with dynamic_axes and without int(x.shape[..]) in its code, or for the size of the images"
    };
    format!("{words}. The multiples {tried}{traced} fail, too{advice}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trial_sizes_are_not_multiples_of_larger_ones() {
        for (index, multiple) in MULTIPLES.into_iter().enumerate() {
            let size = trial_size(multiple);
            assert!(size.iter().all(|side| *side >= MIN_SIDE && side % multiple == 0));
            for larger in &MULTIPLES[index + 1..] {
                let fits = size.iter().all(|side| side % larger == 0);
                assert!(!fits, "{size:?} is a multiple of {larger}");
            }
        }
    }
}
