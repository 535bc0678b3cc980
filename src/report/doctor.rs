//! The page of an examined enhancer: [`page`].

use serde::Serialize;

use crate::error::Result;
use crate::report::template::filled;

/// Template of the page.
const PAGE: &str = include_str!("doctor.html");

/// All that the page shows.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorPage {
    /// Name of the model's file.
    pub(crate) model: String,
    /// The conclusion from the images.
    pub(crate) conclusion: String,
    /// Whether there is one plausible convention.
    pub(crate) is_settled: bool,
    /// The lines of the proposed sidecar.
    pub(crate) sidecar: String,
    /// The dark frames, as data URLs.
    pub(crate) frames: Vec<String>,
    pub(crate) columns: Vec<DoctorColumn>,
    /// How the model is fed and read now.
    pub(crate) description: String,
    /// Changes because of the sizes of the frames.
    pub(crate) sizes: String,
}

/// The images of one convention.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorColumn {
    pub(crate) title: String,
    /// The fault; `None` if the images are plausible.
    pub(crate) problem: Option<String>,
    /// The image of each frame.
    pub(crate) cells: Vec<DoctorCell>,
}

/// One image with its figures.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorCell {
    /// The image as a data URL.
    pub(crate) image: String,
    /// Its brightness and what clamping cuts off.
    pub(crate) facts: String,
    pub(crate) problem: Option<String>,
}

/// The page as one HTML file.
///
/// # Errors
/// If the template cannot be filled.
pub(crate) fn page(page: &DoctorPage) -> Result<String> {
    filled(PAGE, page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts_are_escaped() {
        let text = page(&DoctorPage {
            model: "<b>.onnx".to_owned(),
            conclusion: "a & b".to_owned(),
            is_settled: false,
            sidecar: String::new(),
            frames: vec!["data:image/png;base64,AAAA".to_owned()],
            columns: vec![DoctorColumn {
                title: "0..1 in and 0..1 out".to_owned(),
                problem: Some("\"><script>".to_owned()),
                cells: vec![DoctorCell {
                    image: "data:image/png;base64,BBBB".to_owned(),
                    facts: "mean 3".to_owned(),
                    problem: None,
                }],
            }],
            description: String::new(),
            sizes: String::new(),
        })
        .unwrap();
        assert!(text.contains("&lt;b&gt;.onnx") && text.contains("a &amp; b"));
        assert!(!text.contains("<script>") && text.contains("BBBB"));
    }
}
