//! Ready-made sets of multiple-choice questions about images.
//!
//! Three forms are read: a `.tsv` file (`table.rs`), a `.jsonl` file ([`questions`], with `image`), and a folder of images
//! with `metadata.jsonl`, as Hugging Face's `imagefolder` has it. Paths are relative to the file. The name of a frame is
//! the normalised path of its image (`sibling_files.rs`).

use std::collections::BTreeMap;
use std::path::Path;

use super::sibling_files::SiblingFiles;
use super::{Dataset, ImageSource, questions, stem, table};
use crate::error::{Error, Result};
use crate::types::{FrameId, Question};

/// The file of the questions of a folder of images.
const METADATA: &str = "metadata.jsonl";

/// Whether a folder holds images with questions, and not frames.
pub(super) fn is_image_folder(path: &Path) -> bool {
    path.join(METADATA).is_file() && !path.join("frames.jsonl").exists()
}

/// The data set of a folder of images with their questions.
pub(super) fn open_image_folder(folder: &Path) -> Result<Dataset> {
    let (sources, questions) = jsonl(&folder.join(METADATA))?;
    Ok(Dataset::new(stem(folder), sources, questions))
}

pub(super) fn open(path: &Path) -> Result<Dataset> {
    if !path.is_file() {
        return Err(Error::usage(
            "--data",
            format_args!("{}: no such file or folder", path.display()),
        ));
    }
    let (sources, questions) = match path.extension().and_then(|ending| ending.to_str()) {
        Some("tsv") => table::read(path)?,
        Some("jsonl") => jsonl(path)?,
        _ => {
            let problem = format_args!(
                "{}: a folder of frames, a .tsv or a .jsonl file expected",
                path.display()
            );
            return Err(Error::usage("--data", problem));
        }
    };
    Ok(Dataset::new(stem(path), sources, questions))
}

fn jsonl(path: &Path) -> Result<(BTreeMap<FrameId, ImageSource>, Vec<Question>)> {
    let mut questions = questions::read(path)?;
    let siblings = SiblingFiles::of(path);
    let mut sources = BTreeMap::new();
    for question in &mut questions {
        let (frame, file) = siblings.image(&question.frame.0).map_err(|problem| {
            Error::data(
                path.display(),
                format_args!("question {:?}: {problem}", question.id.0),
            )
        })?;
        question.frame = frame.clone();
        sources.insert(frame, ImageSource::image(file));
    }
    Ok((sources, questions))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use image::RgbImage;

    use std::path::PathBuf;

    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;

    use super::*;

    /// A temporary set file, two images in a folder next to it, and one image outside.
    struct Scene(tempfile::TempDir);

    impl Scene {
        fn new(name: &str, text: &str) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let scene = Self(folder);
            fs::create_dir_all(scene.path("set/fr")).unwrap();
            for (file, sample) in [("set/fr/a.png", 1), ("set/fr/b.png", 2), ("out.png", 3)] {
                let image = RgbImage::from_pixel(2, 1, image::Rgb([sample; 3]));
                image.save(scene.path(file)).unwrap();
            }
            fs::write(scene.path("set").join(name), text).unwrap();
            scene
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn open(&self, name: &str) -> Result<Dataset> {
            open(&self.path("set").join(name))
        }
    }

    fn frames(set: &Dataset) -> Vec<&str> {
        let questions = set.questions().iter();
        questions
            .map(|question| question.frame.0.as_str())
            .collect()
    }

    #[test]
    fn one_file_is_one_frame_however_its_path_is_spelled() {
        let outside = Scene::new("x", "");
        let absolute = outside.path("out.png").display().to_string();
        let spellings = [
            "fr/a.png",
            "./fr/a.png",
            "fr//./a.png",
            "fr/../fr/a.png",
            "../set/fr/a.png",
            "HERE/fr/a.png",
            "HERE/../set/fr/a.png",
            "fr/b.png",
            "../out.png",
            "fr/../../out.png",
            &absolute,
        ];
        let expected = [
            &["fr/a.png"; 7][..],
            &["fr/b.png", "../out.png", "../out.png", &absolute],
        ]
        .concat();
        let scene = Scene::new("x", "");
        let here = scene.path("set").display().to_string();
        let spellings = spellings.map(|image| image.replace("HERE", &here));
        let lines: Vec<String> = (0..)
            .zip(&spellings)
            .map(|(i, image)| {
                serde_json::json!({"id": i, "image": image, "question": "?", "choices": ["x", "y"], "answer": "x"}).to_string()
            })
            .collect();
        let rows: Vec<String> = (0..)
            .zip(&spellings)
            .map(|(i, image)| format!("{i}\t{image}\t?\tx\ty\tA"))
            .collect();
        let header = "index\timage_path\tquestion\tA\tB\tanswer\n";
        for (name, text) in [
            ("a.jsonl", lines.join("\n")),
            ("a.tsv", format!("{header}{}", rows.join("\n"))),
        ] {
            fs::write(scene.path("set").join(name), text).unwrap();
            let set = scene.open(name).unwrap();
            assert_eq!(frames(&set), expected, "{name}");
            for (frame, sample) in [("fr/a.png", 1), ("../out.png", 3)] {
                let image = set.picture(&FrameId(frame.into())).unwrap();
                assert_eq!(image.decode().unwrap().samples()[0], sample);
            }
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_is_followed_before_its_parent() {
        let scene = Scene::new("a.tsv", "");
        fs::create_dir_all(scene.path("far/deep")).unwrap();
        let image = RgbImage::from_pixel(2, 1, image::Rgb([9; 3]));
        fs::create_dir_all(scene.path("far/fr")).unwrap();
        image.save(scene.path("far/fr/a.png")).unwrap();
        std::os::unix::fs::symlink(scene.path("far/deep"), scene.path("set/link")).unwrap();
        let table = "index\timage_path\tquestion\tA\tB\tanswer\n1\tlink/../fr/a.png\t?\tx\ty\tA\n2\tfr/a.png\t?\tx\ty\tA\n";
        fs::write(scene.path("set/a.tsv"), table).unwrap();
        let set = scene.open("a.tsv").unwrap();
        assert_eq!(frames(&set), ["link/../fr/a.png", "fr/a.png"]);
        let sample = |i: usize| {
            let picture = set.picture(&set.questions()[i].frame).unwrap();
            picture.decode().unwrap().samples()[0]
        };
        assert_eq!((sample(0), sample(1)), (9, 1));
    }

    #[test]
    fn rows_with_a_fault_are_named() {
        let header =
            "index\timage_path\tquestion\tA\tB\tanswer\tcategory\n1\tfr/a.png\t?\tx\ty\tA\tc\n";
        for (row, says) in [
            (
                " \tfr/a.png\t?\tx\ty\tA\tc",
                "the column \"index\" is empty",
            ),
            ("2\t \t?\tx\ty\tA\tc", "the column \"image_path\" is empty"),
            ("2", "the column \"image_path\" is empty"),
            (
                "2\tfr/a.png\t \tx\ty\tA\tc",
                "the column \"question\" is empty",
            ),
            ("2\tfr/c.png\t?\tx\ty\tA\tc", "no such image: "),
            ("2\tfr/a.png\t?\tx\ty\tC\tc", "the answer \"C\""),
            (
                "2\tfr/a.png\t?\tx\ty\tA\tall",
                "\"all\" is the name of the total",
            ),
        ] {
            let scene = Scene::new("a.tsv", &format!("{header}{row}\n"));
            let error = scene.open("a.tsv").unwrap_err().to_string();
            assert!(
                error.contains("a.tsv, line 3: ") && error.contains(says),
                "{error}"
            );
        }
        let empty = r#"{"id":1,"image":"","question":"?","choices":["x","y"],"answer":"x"}"#;
        let scene = Scene::new("a.jsonl", empty);
        let error = scene.open("a.jsonl").unwrap_err().to_string();
        assert!(
            error.ends_with("question \"1\": the path of the image is empty"),
            "{error}"
        );
    }

    #[test]
    fn a_broken_image_in_a_table_is_named() {
        let mut file = std::io::Cursor::new(Vec::new());
        RgbImage::new(40, 40)
            .write_to(&mut file, image::ImageFormat::Png)
            .unwrap();
        let whole = file.into_inner();
        let (mut flipped, cut) = (whole.clone(), &whole[..whole.len() - 12]);
        let data = whole.windows(4).position(|four| four == b"IDAT").unwrap() + 6;
        flipped[data] ^= 0x10;
        for (cell, says) in [
            (STANDARD.encode(&flipped), "not a "),
            (STANDARD.encode(cut), "not a whole image"),
            ("no base64!".repeat(9), "not base64"),
            (STANDARD.encode([7; 99]), "not an image"),
        ] {
            let header = "index\timage\tquestion\tA\tB\tanswer";
            let scene = Scene::new("a.tsv", &format!("{header}\n1\t{cell}\t?\tx\ty\tA\n"));
            let set = scene.open("a.tsv").unwrap();
            let picture = set.picture(&FrameId("1".into()));
            let error = picture
                .and_then(|picture| picture.decode())
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("a.tsv, line 2: ") && error.contains(says),
                "{error}"
            );
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
