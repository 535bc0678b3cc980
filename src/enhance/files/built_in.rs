//! Lookup of built-in enhancers by name: [`find_built_in`].

use std::path::Path;

use darkqa_models::{BUILT_IN, BuiltIn};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::near_name::nearest;

/// Finds the built-in enhancer named by the argument of `--llie`. `None` if the argument is a path: it has an
/// extension, a folder or a colon. So a file in the current folder that is named `lift` is never confused with the
/// enhancer.
///
/// # Errors
/// If the argument is neither a path nor the name of a built-in enhancer.
pub(super) fn find_built_in(word: &Path) -> Result<Option<&'static BuiltIn>> {
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
    fn built_in_enhancers_equal_their_files() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        for BuiltIn { name, .. } in BUILT_IN {
            let built_in = ModelFile::read(Path::new(name)).unwrap();
            let file = ModelFile::read(&folder.join(format!("{name}.onnx"))).unwrap();
            assert_eq!(built_in.name(), file.name());
            assert_eq!(built_in.digest(), file.digest(), "{name}");
            assert!(built_in.weights.external.is_empty(), "{name}");
        }
    }

    #[test]
    fn argument_with_extension_or_folder_is_a_file() {
        for file in ["lift.onnx", "./lift", "models/lift", "C:lift", "lift.ort"] {
            assert!(find_built_in(Path::new(file)).unwrap().is_none(), "{file}");
        }
        let typo = find_built_in(Path::new("lfit")).err().unwrap().to_string();
        assert!(typo.contains("did you mean lift?"), "{typo}");
        for wrong in ["lfit", "zerodce", "Lift", ""] {
            let message = find_built_in(Path::new(wrong)).err().unwrap().to_string();
            assert!(message.contains("lift, gray-gain") && message.contains("--llie"), "{message}");
        }
    }
}
