//! Why a model did not give an image of the input's size: [`RunFailure`]; why ONNX Runtime refuses a file: [`load_problem`].
//!
//! The words of ONNX Runtime that are recognised are those of 1.17 to 1.31.1.

use std::time::Duration;

use super::conventions::ValueRange;
use super::conventions::sidecar::ADD;
use super::libraries::PINNED;
use super::limits::MemoryLimit;
use super::outputs::OutOfRange;

/// Newest IR version of ONNX that ONNX Runtime 1.31.1 reads; measured with models of each version.
const PINNED_IR: u32 = 13;
/// Newest operator set that ONNX Runtime 1.31.1 reads; measured likewise.
const PINNED_OPSET: u32 = 26;

/// Ratios of sizes that super-resolution has.
const ENLARGED: std::ops::RangeInclusive<usize> = 2..=4;

/// Reason why a run gave no image.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RunFailure {
    /// The output is no image of the input's size.
    OtherSize {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Dimensions of the output.
        dims: Vec<i64>,
        /// Height and width of the output; `None` if it is no image.
        given: Option<[usize; 2]>,
    },
    /// ONNX Runtime stopped with an error.
    Refused {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Its words, in one line.
        message: String,
    },
    /// It could not allocate memory.
    NoMemory {
        /// Height and width of the input.
        fed: [usize; 2],
        /// Bytes of the allocation that failed, if ONNX Runtime reports them.
        requested: Option<u64>,
    },
    /// The image took longer than the limit.
    TooLong(Duration),
    /// The process took more memory than the limit.
    TooLarge(MemoryLimit),
    /// A further input cannot be cut into tiles; the message follows the file's name.
    NotCut(String),
}

impl RunFailure {
    /// The failure of a run that ended with an error of ONNX Runtime.
    pub(super) fn from_message(fed: [usize; 2], message: String) -> Self {
        const MEMORY: [&str; 4] = [
            "Failed to allocate memory",
            "bad_alloc",
            "bad allocation",
            "Available memory of",
        ];
        if MEMORY.iter().any(|words| message.contains(words)) {
            let requested = number_after(&message, "requested buffer of size ");
            return Self::NoMemory { fed, requested };
        }
        Self::Refused { fed, message }
    }

    /// Whether another size may help.
    pub(super) fn is_of_size(&self) -> bool {
        match self {
            Self::OtherSize { .. } => self.enlarges_by().is_none(),
            Self::Refused { .. } => true,
            Self::NoMemory { .. } | Self::TooLong(_) | Self::TooLarge(_) | Self::NotCut(_) => false,
        }
    }

    /// Factor by which both sides grow; `None` if they do not grow by the same one.
    fn enlarges_by(&self) -> Option<usize> {
        match self {
            Self::OtherSize {
                fed,
                given: Some(given),
                ..
            } => ENLARGED
                .into_iter()
                .find(|factor| fed.map(|side| side * factor) == *given),
            _ => None,
        }
    }

    /// Description of the failure without a remedy, to follow the file's name. Lack of memory is described elsewhere.
    pub(super) fn words(&self) -> String {
        match self {
            Self::OtherSize { fed, dims, given } => match self.enlarges_by() {
                Some(factor) => format!(
                    "enlarges by {factor}: it gave {dims:?} for an image of {}; export it without the upsampling",
                    by(*fed)
                ),
                None => match given {
                    Some(given) => format!(
                        "gave an image of {} for one of {}, but both must have the same size: {}",
                        by(*given),
                        by(*fed),
                        other_size_remedy(*fed, *given)
                    ),
                    None => format!(
                        "gave a tensor of {dims:?} for an image of {}; export it so that it gives [1, 3, {}, {}]",
                        by(*fed),
                        fed[0],
                        fed[1]
                    ),
                },
            },
            Self::Refused { fed, message } => {
                format!("failed on an image of {} ({message})", by(*fed))
            }
            Self::NoMemory { fed, .. } => {
                format!("ran out of memory on an image of {}", by(*fed))
            }
            Self::TooLong(limit) => format!(
                "took longer than {} s for an image; allow more with --llie-options timeout=SECONDS (0: no limit)",
                limit.as_secs_f64()
            ),
            Self::TooLarge(limit) => format!(
                "took more than {limit} GB of memory together with the program and was stopped; allow more with --llie-options max-memory=GB, or need less with \
                 --llie-options tile=N or max-side=N"
            ),
            Self::NotCut(problem) => problem.clone(),
        }
    }
}

/// Message about output values outside the expected `range`, for an image of this size; it follows the file's name.
pub(super) fn unusable(values: OutOfRange, range: ValueRange, size: [usize; 2]) -> String {
    match values {
        OutOfRange::NotFed => format!(
            "is fed values that are not finite, from `input` or `from` in MODEL.onnx.toml on an image of {}; check their divisions and powers",
            by(size)
        ),
        OutOfRange::NotNumbers => format!(
            "gave values that are not numbers (NaN) for an image of {}; check its weights, and divisions by zero in its graph and in `image` of MODEL.onnx.toml",
            by(size)
        ),
        OutOfRange::Beyond { min, max, likely } => format!(
            "gave values from {min} to {max}, expected {range}; its range seems to be {likely}. `darkqa-eval enhance doctor` finds it; {ADD}: `range_in = \"…\"` and `range_out = \"…\"`"
        ),
    }
}

/// Advice on the export of a model whose output differs in size from its input.
fn other_size_remedy(fed: [usize; 2], given: [usize; 2]) -> &'static str {
    let lost = [0, 1].map(|side| fed[side].checked_sub(given[side]));
    match lost {
        [Some(rows), Some(columns)] if rows == columns && rows <= 64 => {
            "its convolutions cut off the edges; export it with padding that keeps the size"
        }
        [Some(_), Some(_)] => {
            "it makes the image smaller; export it with the upsampling to the size of the input"
        }
        _ => "export it so that it gives the size of the input",
    }
}

/// Width × height, as users write sizes.
pub(super) fn by([height, width]: [usize; 2]) -> String {
    format!("{width} × {height}")
}

/// Message about a file that ONNX Runtime `version` refuses to load; it follows the file's name.
pub(super) fn load_problem(message: &str, version: &str) -> String {
    let newer = |what: &str, needed: u32, most: u32, pinned: u32| {
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
    };
    let ir = (
        number_after(message, "Unsupported model IR version: "),
        number_after(message, "max supported IR version: "),
    );
    let opset = (
        number_after(message, "Opset "),
        number_after(message, "is till opset "),
    );
    match (ir, opset) {
        ((Some(needed), Some(most)), _) => newer("IR version", needed, most, PINNED_IR),
        (_, (Some(needed), Some(most))) => newer("operator set", needed, most, PINNED_OPSET),
        _ if message.contains("is not a registered function/op")
            || message.contains("No Op registered for") =>
        {
            format!(
                "has an operator that is not part of ONNX; export it with standard operators only ({message})"
            )
        }
        _ => format!("ONNX Runtime cannot load it: {message}"),
    }
}

/// The number behind some words of a message.
fn number_after<T: std::str::FromStr>(message: &str, words: &str) -> Option<T> {
    let rest = message.split_once(words)?.1;
    let digits = rest.find(|c: char| !c.is_ascii_digit());
    rest[..digits.unwrap_or(rest.len())].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_say_what_happened() {
        let other = |given: [usize; 2]| RunFailure::OtherSize {
            fed: [10, 20],
            dims: vec![1, 3, given[0] as i64, given[1] as i64],
            given: Some(given),
        };
        let twice = other([20, 40]);
        assert!(!twice.is_of_size());
        assert!(
            twice.words().starts_with("enlarges by 2: "),
            "{}",
            twice.words()
        );
        let cut = other([6, 16]).words();
        assert!(
            cut.contains("16 × 6 for one of 20 × 10") && cut.contains("padding"),
            "{cut}"
        );
        assert!(other([5, 10]).words().contains("upsampling"));
        for given in [[20, 60], [8, 16], [50, 100]] {
            let failure = other(given);
            assert!(failure.is_of_size() && !failure.words().contains("enlarges"));
        }
        let memory = "Failed to allocate memory for requested buffer of size 844424930131968";
        let failure = RunFailure::from_message([1, 1], memory.to_owned());
        let requested = Some(844_424_930_131_968);
        assert_eq!(
            failure,
            RunFailure::NoMemory {
                fed: [1, 1],
                requested
            }
        );
        assert!(!failure.is_of_size());
        assert!(RunFailure::from_message([1, 1], "shape mismatch".to_owned()).is_of_size());
    }

    #[test]
    fn a_file_that_is_too_new_names_the_version_that_reads_it() {
        let ir = "model.cc:256 Unsupported model IR version: 13, max supported IR version: 10";
        let words = load_problem(ir, "1.20.1");
        assert!(
            words.contains("IR version 13") && words.contains("1.31.1 reads it"),
            "{words}"
        );
        let newest = ir.replace("13", "99");
        let words = load_problem(&newest, "1.31.1");
        assert!(
            words.contains("a newer one") && words.contains("or older"),
            "{words}"
        );
        let opset = "Opset 27 is under development and support for this is limited. The operator schemas may change. Current official support for domain ai.onnx is till opset 26.";
        let words = load_problem(opset, "1.31.1");
        assert!(words.contains("operator set 27"), "{words}");
        let other = load_problem("no such operator", "1.31.1");
        assert!(
            other.ends_with("cannot load it: no such operator"),
            "{other}"
        );
    }
}
