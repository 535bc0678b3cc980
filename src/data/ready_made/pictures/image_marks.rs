//! Image marks in the texts of a row, such as `<image 2>`: [`ImageMarks`].

use std::sync::LazyLock;

use regex::{Captures, Regex};

use crate::types::text::excerpt;
use crate::types::text::image_mark::mark;

/// Mark with the space after it: `<image>`, `<image 2>` or `<image2>`.
static MARK: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"<image(?: ?(\d+))?>(\s*)").ok());

/// Normalizes the image marks of a row. With one image, marks are removed. With several, the texts of the row must be
/// read in order, because the k-th mark without a number refers to the k-th image.
#[derive(Debug)]
pub(crate) struct ImageMarks {
    /// Number of images.
    images: usize,
    /// Number of marks without a number so far.
    unnumbered: usize,
    has_numbers: bool,
}

impl ImageMarks {
    pub(crate) fn new(images: usize) -> Self {
        Self { images, unnumbered: 0, has_numbers: false }
    }

    /// Rewrites all marks of a text in one form.
    ///
    /// # Errors
    /// If a mark refers to an image that the row does not have, or only some marks have numbers.
    pub(crate) fn read(&mut self, text: &str) -> Result<String, String> {
        let Some(pattern) = &*MARK else {
            return Ok(text.to_owned());
        };
        if self.images == 1 {
            return Ok(pattern.replace_all(text, "").trim().to_owned());
        }
        let mut problem = None;
        let read = pattern.replace_all(text, |found: &Captures<'_>| {
            let number = if let Some(number) = found.get(1) {
                self.has_numbers = true;
                number.as_str().parse().unwrap_or(usize::MAX)
            } else {
                self.unnumbered += 1;
                self.unnumbered
            };
            if self.has_numbers && self.unnumbered > 0 {
                problem = Some("of the marks <image …> some have numbers and some have none".to_owned());
            } else if number == 0 || number > self.images {
                problem = Some(format!(
                    "{:?} is not an image of the row, which shows {}",
                    excerpt(found[0].trim(), 30),
                    self.images
                ));
            }
            format!("{}{}", mark(number.max(1) - 1), &found[2])
        });
        match problem {
            Some(problem) => Err(problem),
            None => Ok(read.trim().to_owned()),
        }
    }

    /// Rewrites all marks of an option in one form. With one image, the option is not changed.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn read_option(&mut self, option: &str) -> Result<String, String> {
        if self.images == 1 {
            return Ok(option.to_owned());
        }
        self.read(option)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_normalized() {
        for (images, texts, expected) in [
            (2, ["Is <image 1> like <image 2>?", ""], Ok(["Is <image 1> like <image 2>?", ""])),
            (2, ["<image1> <image2>\nWhich?", "<image 2>"], Ok(["<image 1> <image 2>\nWhich?", "<image 2>"])),
            (3, ["<image> <image>", "<image>"], Ok(["<image 1> <image 2>", "<image 3>"])),
            (2, ["Which is darker?", "the first"], Ok(["Which is darker?", "the first"])),
            (2, ["<image 3>", ""], Err("\"<image 3>\" is not an image of the row, which shows 2")),
            (2, ["<image 0>", ""], Err("not an image of the row")),
            (2, ["<image> <image>", "<image>"], Err("not an image of the row")),
            (2, ["<image 99999999999999999999>", ""], Err("not an image of the row")),
            (2, ["<image 1>", "<image>"], Err("some have none")),
        ] {
            let mut marks = ImageMarks::new(images);
            let read: Result<Vec<String>, String> = texts.iter().map(|text| marks.read(text)).collect();
            match (read, expected) {
                (Ok(read), Ok(expected)) => assert_eq!(read, expected),
                (Err(problem), Err(expected)) => assert!(problem.contains(expected), "{problem}"),
                (read, expected) => panic!("{read:?} {expected:?}"),
            }
        }
    }

    #[test]
    fn marks_of_a_single_image_are_removed() {
        let mut marks = ImageMarks::new(1);
        let read = marks.read("<image 1>\nWhat is <image> this?").unwrap();
        assert_eq!(read, "What is this?");
        assert_eq!(marks.read_option("<image 1>").unwrap(), "<image 1>");
    }
}
