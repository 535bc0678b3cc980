//! Column widths of papers: [`Width`].

use std::str::FromStr;

use crate::error::{Error, Result};

/// PDF points per millimetre (72 per inch).
const POINTS: f64 = 72.0 / 25.4;
/// TeX points (72.27 per inch) per PDF point.
pub(super) const TEX: f64 = 72.27 / 72.0;
/// Accepted widths in millimetres; chosen.
const MILLIMETRES: std::ops::RangeInclusive<f64> = 40.0..=600.0;

/// Width of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Width {
    Venue(&'static Venue),
    /// A custom width, in PDF points.
    Custom(f64),
}

/// Layout of a venue's papers.
#[derive(Debug, PartialEq)]
pub(crate) struct Venue {
    name: &'static str,
    /// Width of a column, in TeX points.
    column: f64,
    /// Width of the text of two columns, in TeX points; `None` if the text has one column.
    text: Option<f64>,
    /// Font size of captions, in points.
    font_size: f64,
}

/// `\columnwidth` and `\textwidth` of the LaTeX classes and style files of these venues.
const VENUES: [Venue; 4] = [
    Venue { name: "ieee", column: 252.0, text: Some(516.0), font_size: 8.0 },
    Venue { name: "cvpr", column: 237.1, text: Some(496.9), font_size: 8.0 },
    Venue { name: "acl", column: 219.1, text: Some(455.2), font_size: 8.0 },
    Venue { name: "neurips", column: 397.5, text: None, font_size: 9.0 },
];

impl FromStr for Width {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if let Some(venue) = VENUES.iter().find(|venue| venue.name == text) {
            return Ok(Self::Venue(venue));
        }
        match text.parse::<f64>() {
            Ok(millimetres) if MILLIMETRES.contains(&millimetres) => Ok(Self::Custom(millimetres * POINTS)),
            _ => Err(format!(
                "ieee, cvpr, acl, neurips, or a width from {} to {} in millimetres expected",
                MILLIMETRES.start(),
                MILLIMETRES.end()
            )),
        }
    }
}

impl Width {
    /// Width of a figure over `columns` columns (one by default), in PDF points.
    ///
    /// # Errors
    /// If the width is custom, or the paper has only one column.
    pub(super) fn points(self, columns: Option<u8>) -> Result<f64> {
        let problem = match (self, columns) {
            (Self::Custom(_), Some(_)) => "a width in millimetres is that of the figure: leave it out",
            (Self::Custom(width), None) => return Ok(width),
            (Self::Venue(Venue { text: None, .. }), Some(2)) => "this paper has one column: leave it out",
            (Self::Venue(_), Some(2)) => return Ok(self.text()),
            (Self::Venue(venue), _) => return Ok(venue.column / TEX),
        };
        Err(Error::usage("--columns", problem))
    }

    /// Width of the text, in PDF points.
    pub(super) fn text(self) -> f64 {
        match self {
            Self::Venue(venue) => venue.text.unwrap_or(venue.column) / TEX,
            Self::Custom(width) => width,
        }
    }

    /// Font size, in points.
    pub(super) fn font_size(self) -> f64 {
        match self {
            Self::Venue(venue) => venue.font_size,
            Self::Custom(_) => 8.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tex_points(text: &str, columns: Option<u8>) -> f64 {
        points(text, columns).unwrap() * 72.27 / 72.0
    }

    fn points(text: &str, columns: Option<u8>) -> Result<f64> {
        text.parse::<Width>().unwrap().points(columns)
    }

    #[test]
    fn widths_are_those_of_columns_or_millimetres() {
        assert!((tex_points("ieee", None) - 252.0).abs() < 1e-9);
        assert!((tex_points("ieee", Some(2)) - 516.0).abs() < 1e-9);
        assert!((tex_points("neurips", Some(1)) - 397.5).abs() < 1e-9);
        assert!(points("neurips", Some(2)).is_err() && points("85", Some(1)).is_err());
        assert!((points("254", None).unwrap() - 720.0).abs() < 1e-9);
        for wrong in ["", "nature", "-3", "39", "601", "nan", "inf"] {
            assert!(wrong.parse::<Width>().is_err(), "{wrong}");
        }
    }
}
