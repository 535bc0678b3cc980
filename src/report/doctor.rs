//! HTML page of an examined enhancer: [`page`].

use serde::Serialize;

use crate::error::Result;
use crate::report::template::render;

/// Template of the page.
const PAGE: &str = include_str!("doctor.html");

/// Values of the page.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorPage {
    /// Name of the model's file.
    pub(crate) model: String,
    /// The conclusion from the images.
    pub(crate) conclusion: String,
    /// True if exactly one convention is plausible.
    pub(crate) is_settled: bool,
    /// The lines of the proposed sidecar.
    pub(crate) sidecar: String,
    /// The dark frames, as data URLs.
    pub(crate) frames: Vec<String>,
    pub(crate) columns: Vec<DoctorColumn>,
    /// Current input and output conventions of the model.
    pub(crate) description: String,
    /// Resizing or padding that the sizes of the frames require.
    pub(crate) sizes: String,
}

/// Images made with one convention of the model's input and output.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorColumn {
    pub(crate) title: String,
    /// Reason why the images are implausible; `None` if they are plausible.
    pub(crate) problem: Option<String>,
    /// One image for each frame.
    pub(crate) cells: Vec<DoctorCell>,
}

/// One image with its numbers.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorCell {
    /// The image as a data URL.
    pub(crate) image: String,
    /// Brightness, and share of values that clamping changes.
    pub(crate) facts: String,
    /// Reason why the image is implausible; `None` if it is plausible.
    pub(crate) problem: Option<String>,
}

/// Renders the page as one HTML file.
///
/// # Errors
/// If the template cannot be rendered.
pub(crate) fn page(page: &DoctorPage) -> Result<String> {
    render(PAGE, page)
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
