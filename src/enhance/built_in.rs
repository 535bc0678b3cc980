//! The enhancers that the program carries: [`BuiltIn`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::types::near_name::nearest;

/// A model inside the program. `models/README.md` tells what each one does.
pub(super) struct BuiltIn {
    /// Name, as in `--llie lift` and in tables.
    pub(super) name: &'static str,
    /// Content of the ONNX file, whose weights are all inside.
    pub(super) model: &'static [u8],
    /// Text of its sidecar; empty if it needs none.
    pub(super) sidecar: &'static str,
}

/// All of them: the same bytes as the files in `models/`, so that they have the same digests.
const ALL: [BuiltIn; 2] = [
    BuiltIn {
        name: "lift",
        model: include_bytes!("../../models/lift.onnx"),
        sidecar: include_str!("../../models/lift.onnx.toml"),
    },
    BuiltIn {
        name: "gray-gain",
        model: include_bytes!("../../models/gray-gain.onnx"),
        sidecar: include_str!("../../models/gray-gain.onnx.toml"),
    },
];

impl BuiltIn {
    /// The enhancer that a word names; `None` if the word is the path of a file: one with an extension or a folder. So a file
    /// that happens to be named `lift` is never taken for the enhancer, nor the other way round.
    ///
    /// # Errors
    /// If the word is neither.
    pub(super) fn named(word: &Path) -> Result<Option<&'static Self>> {
        let Some(text) = word.to_str() else {
            return Ok(None);
        };
        if word.extension().is_some() || text.contains(['/', '\\', ':']) {
            return Ok(None);
        }
        let found = ALL.iter().find(|enhancer| enhancer.name == text);
        found.map(Some).ok_or_else(|| {
            let names = ALL.map(|enhancer| enhancer.name);
            let near = nearest(text, &names);
            let near = near.map_or_else(String::new, |name| format!("did you mean {name}? "));
            let names = names.join(", ");
            let problem = format_args!(
                "{near}{text:?} is not a built-in enhancer ({names}); name a file with its extension or its folder: {text}.onnx, \
                 ./{text}; a preset is written before its file: zero-dce:FILE.onnx"
            );
            Error::usage("--llie", problem)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::file::ModelFile;
    use super::*;

    #[test]
    fn a_built_in_enhancer_is_its_file() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
        let read = |word: &Path| ModelFile::read(word).unwrap();
        for BuiltIn { name, .. } in ALL {
            let built_in = read(Path::new(name));
            let file = read(&folder.join(format!("{name}.onnx")));
            assert_eq!(built_in.name(), file.name());
            assert_eq!(built_in.digest(), file.digest(), "{name}");
            assert!(built_in.weights.external.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_word_with_an_extension_or_a_folder_is_a_file() {
        for file in ["lift.onnx", "./lift", "models/lift", "C:lift", "lift.ort"] {
            assert!(BuiltIn::named(Path::new(file)).unwrap().is_none(), "{file}");
        }
        let typo = BuiltIn::named(Path::new("lfit")).err().unwrap().to_string();
        assert!(typo.contains("did you mean lift?"), "{typo}");
        for wrong in ["lfit", "zerodce", "Lift", ""] {
            let message = BuiltIn::named(Path::new(wrong)).err().unwrap().to_string();
            assert!(
                message.contains("lift, gray-gain") && message.contains("--llie"),
                "{message}"
            );
        }
    }
}
