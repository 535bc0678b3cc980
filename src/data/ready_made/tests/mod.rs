//! Tests of the reader with the layouts of published benchmarks.

mod broken;
mod columns;
mod fixture;
mod gaps;
mod groups;
mod joined;
mod limits;
mod marks;
mod refusals;
mod scenes;
mod several;
mod shapes;
mod user_shapes;

use std::path::Path;

use super::SetArgs;
use crate::{DataSource, Dataset, Picture};
use darkqa_base::error::Result;

/// Opens the set at a path with these flags.
fn open(path: &Path, args: &SetArgs) -> Result<Dataset> {
    DataSource::Path(path.to_owned()).open(None, args)
}

/// Flags with this map.
fn map(text: &str) -> SetArgs {
    SetArgs { map: vec![text.parse().unwrap()], ..SetArgs::default() }
}

/// Error message for a set that is refused.
fn refusal(path: &Path, args: &SetArgs) -> String {
    open(path, args).err().map_or_else(|| "it was read".to_owned(), |e| e.to_string())
}

/// Compared parts of a question: id, family, text, choices, true choice, and the first sample of its image.
type Read = (String, String, String, Vec<String>, String, u8);

/// All questions of a set, with the red values of their images.
fn read(dataset: &Dataset) -> Vec<Read> {
    dataset
        .questions()
        .iter()
        .map(|question| {
            let picture = dataset.picture(&question.frame).unwrap();
            let texts = question.choices.texts();
            (
                question.id.0.clone(),
                question.family.name().to_owned(),
                question.text.clone(),
                texts.to_vec(),
                texts[question.choices.truth().unwrap()].clone(),
                picture.decode().unwrap().samples()[0],
            )
        })
        .collect()
}

/// Digests of the images by frame.
fn digests(dataset: &Dataset) -> Vec<(String, String)> {
    let frames = dataset.frames();
    frames
        .map(|frame| match dataset.picture(frame).unwrap() {
            picture @ Picture::Encoded(_) => (frame.0.clone(), picture.digest().to_string()),
            Picture::Drawn(..) => panic!("a room"),
        })
        .collect()
}

fn expected(id: &str, family: &str, text: &str, choices: &[&str], truth: &str, red: u8) -> Read {
    let choices = choices.iter().map(ToString::to_string).collect();
    (id.into(), family.into(), text.into(), choices, truth.into(), red)
}
