//! The enhancer that a word names: [`built_in`].

use std::path::Path;

use darkqa_models::{BUILT_IN, BuiltIn};

use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::text::near_name::nearest;

/// The built-in enhancer of this name; `None` if the word is the path of a file, that is, has an extension or a folder. A file named `lift`
/// is therefore never confused with the enhancer.
///
/// # Errors
/// If the word is neither.
pub(super) fn built_in(word: &Path) -> Result<Option<&'static BuiltIn>> {
    let Some(text) = word.to_str() else {
        return Ok(None);
    };
    if word.extension().is_some() || text.contains(['/', '\\', ':']) {
        return Ok(None);
    }
    BUILT_IN.iter().find(|enhancer| enhancer.name == text).map(Some).ok_or_else(|| {
        let names = BUILT_IN.map(|enhancer| enhancer.name);
        let near = nearest(text, &names);
        let near = near.map_or_else(String::new, |name| format!("; did you mean {name}?"));
        let names = names.join(", ");
        let problem = format_args!(
            "{text:?} is not a built-in enhancer ({names}); a file is named with extension or folder, {text}.onnx or ./{text}, and a \
             preset with its file, zero-dce:FILE.onnx{near}"
        );
        Error::usage("--llie", problem)
    })
}

#[cfg(test)]
mod tests {
    use super::super::file::ModelFile;
    use super::*;

    #[test]
    fn a_built_in_enhancer_is_its_file() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        let read = |word: &Path| ModelFile::read(word).unwrap();
        for BuiltIn { name, .. } in BUILT_IN {
            let carried = read(Path::new(name));
            let file = read(&folder.join(format!("{name}.onnx")));
            assert_eq!(carried.name(), file.name());
            assert_eq!(carried.digest(), file.digest(), "{name}");
            assert!(carried.weights.external.is_empty(), "{name}");
        }
    }

    #[test]
    fn a_word_with_an_extension_or_a_folder_is_a_file() {
        for file in ["lift.onnx", "./lift", "models/lift", "C:lift", "lift.ort"] {
            assert!(built_in(Path::new(file)).unwrap().is_none(), "{file}");
        }
        let typo = built_in(Path::new("lfit")).err().unwrap().to_string();
        assert!(typo.contains("did you mean lift?"), "{typo}");
        for wrong in ["lfit", "zerodce", "Lift", ""] {
            let message = built_in(Path::new(wrong)).err().unwrap().to_string();
            assert!(
                message.contains("lift, gray-gain") && message.contains("--llie"),
                "{message}"
            );
        }
    }
}
