//! Failures of a run ([`RunFailure`]), and messages about models that ONNX Runtime cannot load
//! ([`describe_load_failure`]).
//!
//! The recognised error messages are those of ONNX Runtime 1.17 to 1.31.1.

use std::time::Duration;

use super::conventions::ValueRange;
use super::conventions::sidecar::ADD;
use super::libraries::PINNED;
use super::limits::MemoryLimit;
use super::outputs::InvalidValues;

/// Newest IR version of ONNX that ONNX Runtime 1.31.1 reads; measured with models of each version.
const PINNED_IR: u32 = 13;
/// Newest operator set that ONNX Runtime 1.31.1 reads; measured with models of each version.
const PINNED_OPSET: u32 = 26;

/// Factors by which super-resolution models enlarge images.
const UPSCALING_FACTORS: std::ops::RangeInclusive<usize> = 2..=4;

/// Reason why a run gave no enhanced image.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RunFailure {
    /// The output is not an image of the input's size.
    WrongSize {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Dimensions of the output.
        dims: Vec<i64>,
        /// Height and width of the output; `None` if it is not an image.
        given: Option<[usize; 2]>,
    },
    /// ONNX Runtime stopped with an error.
    RuntimeError {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Error message of ONNX Runtime, in one line.
        message: String,
    },
    /// ONNX Runtime could not allocate memory.
    NoMemory {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Bytes of the allocation that failed, if ONNX Runtime reports them.
        requested: Option<u64>,
    },
    /// The image took longer than this limit.
    TimedOut(Duration),
    /// The process took more memory than this limit.
    MemoryExceeded(MemoryLimit),
    /// A further input cannot be cut into tiles; the message follows the file's name.
    CannotTile(String),
}

impl RunFailure {
    /// Classifies an error message of ONNX Runtime from a run on an input of height and width `fed`.
    pub(super) fn from_message(fed: [usize; 2], message: String) -> Self {
        const MEMORY: [&str; 4] = ["Failed to allocate memory", "bad_alloc", "bad allocation", "Available memory of"];
        if MEMORY.iter().any(|words| message.contains(words)) {
            let requested = parse_number_after(&message, "requested buffer of size ");
            return Self::NoMemory { fed, requested };
        }
        Self::RuntimeError { fed, message }
    }

    /// True if the run may succeed at another input size.
    pub(super) fn may_depend_on_size(&self) -> bool {
        match self {
            Self::WrongSize { .. } => self.upscaling_factor().is_none(),
            Self::RuntimeError { .. } => true,
            Self::NoMemory { .. } | Self::TimedOut(_) | Self::MemoryExceeded(_) | Self::CannotTile(_) => false,
        }
    }

    /// Factor by which the model enlarges both sides; `None` if it does not enlarge them or by different factors.
    fn upscaling_factor(&self) -> Option<usize> {
        match self {
            Self::WrongSize { fed, given: Some(given), .. } => {
                UPSCALING_FACTORS.into_iter().find(|factor| fed.map(|side| side * factor) == *given)
            }
            _ => None,
        }
    }

    /// Message about the failure, to follow the file's name. For [`Self::NoMemory`], `out_of_memory` in `limits` adds
    /// figures and a remedy.
    pub(super) fn message(&self) -> String {
        match self {
            Self::WrongSize { fed, dims, given } => match self.upscaling_factor() {
                Some(factor) => format!(
                    "enlarges by {factor}: it gave {dims:?} for an image of {}; export it without the upsampling",
                    format_size(*fed)
                ),
                None => match given {
                    Some(given) => format!(
                        "gave an image of {} for one of {}, but both must have the same size: {}",
                        format_size(*given),
                        format_size(*fed),
                        wrong_size_remedy(*fed, *given)
                    ),
                    None => format!(
                        "gave a tensor of {dims:?} for an image of {}; export it so that it gives [1, 3, {}, {}]",
                        format_size(*fed),
                        fed[0],
                        fed[1]
                    ),
                },
            },
            Self::RuntimeError { fed, message } => {
                format!("failed on an image of {} ({message})", format_size(*fed))
            }
            Self::NoMemory { fed, .. } => {
                format!("ran out of memory on an image of {}", format_size(*fed))
            }
            Self::TimedOut(limit) => format!(
                "took longer than {} s for an image; allow more with --llie-options timeout=SECONDS (0: no limit)",
                limit.as_secs_f64()
            ),
            Self::MemoryExceeded(limit) => format!(
                "took more than {limit} GB of memory together with the program and was stopped; allow more with --llie-options max-memory=GB, or need less with \
                 --llie-options tile=N or max-side=N"
            ),
            Self::CannotTile(problem) => problem.clone(),
        }
    }
}

/// Message about input or output values that cannot be used, for an image of this size; it follows the file's name.
/// `range` is the expected range of the output.
pub(super) fn describe_invalid_values(values: InvalidValues, range: ValueRange, size: [usize; 2]) -> String {
    match values {
        InvalidValues::NonFiniteInput => format!(
            "is fed values that are not finite, from `input` or `from` in MODEL.onnx.toml on an image of {}; check their divisions and powers",
            format_size(size)
        ),
        InvalidValues::NanOutput => format!(
            "gave values that are not numbers (NaN) for an image of {}; check its weights, and divisions by zero in its graph and in `image` of MODEL.onnx.toml",
            format_size(size)
        ),
        InvalidValues::OutOfRange { min, max, likely } => format!(
            "gave values from {min} to {max}, expected {range}; its range seems to be {likely}. `darkqa-eval enhance doctor` finds it; {ADD}: `range_in = \"…\"` and `range_out = \"…\"`"
        ),
    }
}

/// Export advice for a model whose output of size `given` differs from its input of size `fed`.
fn wrong_size_remedy(fed: [usize; 2], given: [usize; 2]) -> &'static str {
    let lost = [0, 1].map(|side| fed[side].checked_sub(given[side]));
    match lost {
        [Some(rows), Some(columns)] if rows == columns && rows <= 64 => {
            "its convolutions cut off the edges; export it with padding that keeps the size"
        }
        [Some(_), Some(_)] => "it makes the image smaller; export it with the upsampling to the size of the input",
        _ => "export it so that it gives the size of the input",
    }
}

/// A size as text, width first: `640 × 480`.
pub(super) fn format_size([height, width]: [usize; 2]) -> String {
    format!("{width} × {height}")
}

/// Message about a file that ONNX Runtime `version` refuses to load; it follows the file's name.
pub(super) fn describe_load_failure(message: &str, version: &str) -> String {
    let ir = (
        parse_number_after(message, "Unsupported model IR version: "),
        parse_number_after(message, "max supported IR version: "),
    );
    let opset = (parse_number_after(message, "Opset "), parse_number_after(message, "is till opset "));
    match (ir, opset) {
        ((Some(needed), Some(most)), _) => describe_too_new("IR version", needed, most, PINNED_IR, version),
        (_, (Some(needed), Some(most))) => describe_too_new("operator set", needed, most, PINNED_OPSET, version),
        _ if message.contains("is not a registered function/op") || message.contains("No Op registered for") => {
            format!("has an operator that is not part of ONNX; export it with standard operators only ({message})")
        }
        _ => format!("ONNX Runtime cannot load it: {message}"),
    }
}

/// Message about a model that needs a newer ONNX Runtime than `version`: version `needed` of `what`, where `version`
/// reads up to `most` and [`PINNED`] up to `pinned`.
fn describe_too_new(what: &str, needed: u32, most: u32, pinned: u32, version: &str) -> String {
    let way_out = if needed <= pinned && version != PINNED {
        format!(
            "version {PINNED} reads it: name its library with --llie-options ort-lib=FILE, or leave out that flag and ORT_DYLIB_PATH"
        )
    } else {
        format!(
            "name the library of a newer one with --llie-options ort-lib=FILE, or export the model with {what} {most} or older"
        )
    };
    format!("needs {what} {needed}, but ONNX Runtime {version} reads up to {most}; {way_out}")
}

/// Parses the number directly after `words` in a message.
fn parse_number_after<T: std::str::FromStr>(message: &str, words: &str) -> Option<T> {
    let rest = message.split_once(words)?.1;
    let digits = rest.find(|c: char| !c.is_ascii_digit());
    rest[..digits.unwrap_or(rest.len())].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Failure of a run on an input of height 10 and width 20 that gave an output of size `given`.
    fn wrong_size(given: [usize; 2]) -> RunFailure {
        RunFailure::WrongSize { fed: [10, 20], dims: vec![1, 3, given[0] as i64, given[1] as i64], given: Some(given) }
    }

    #[test]
    fn messages_about_wrong_sizes_name_the_likely_cause() {
        let twice = wrong_size([20, 40]);
        assert!(!twice.may_depend_on_size());
        assert!(twice.message().starts_with("enlarges by 2: "), "{}", twice.message());
        let cut = wrong_size([6, 16]).message();
        assert!(cut.contains("16 × 6 for one of 20 × 10") && cut.contains("padding"), "{cut}");
        assert!(wrong_size([5, 10]).message().contains("upsampling"));
        for given in [[20, 60], [8, 16], [50, 100]] {
            let failure = wrong_size(given);
            assert!(failure.may_depend_on_size() && !failure.message().contains("enlarges"));
        }
    }

    #[test]
    fn allocation_failures_are_recognised_by_their_message() {
        let memory = "Failed to allocate memory for requested buffer of size 844424930131968";
        let failure = RunFailure::from_message([1, 1], memory.to_owned());
        let requested = Some(844_424_930_131_968);
        assert_eq!(failure, RunFailure::NoMemory { fed: [1, 1], requested });
        assert!(!failure.may_depend_on_size());
        assert!(RunFailure::from_message([1, 1], "shape mismatch".to_owned()).may_depend_on_size());
    }

    #[test]
    fn message_about_a_too_new_file_names_the_version_that_reads_it() {
        let ir = "model.cc:256 Unsupported model IR version: 13, max supported IR version: 10";
        let words = describe_load_failure(ir, "1.20.1");
        assert!(words.contains("IR version 13") && words.contains("1.31.1 reads it"), "{words}");
        let newest = ir.replace("13", "99");
        let words = describe_load_failure(&newest, "1.31.1");
        assert!(words.contains("a newer one") && words.contains("or older"), "{words}");
        let opset = "Opset 27 is under development and support for this is limited. The operator schemas may change. Current official support for domain ai.onnx is till opset 26.";
        let words = describe_load_failure(opset, "1.31.1");
        assert!(words.contains("operator set 27"), "{words}");
        let other = describe_load_failure("no such operator", "1.31.1");
        assert!(other.ends_with("cannot load it: no such operator"), "{other}");
    }
}
