//! Decision tree over CIELAB that names colours. It generates the table of [`super::colors`].
//!
//! The bounds were set by eye on photographs of rooms. A colour has no name if people disagree about it.

use super::colors::Color;

/// Name of an sRGB colour; `None` if people do not agree on one.
pub(super) fn name(rgb: [u8; 3]) -> Option<Color> {
    let [lightness, a, b] = lab(rgb);
    let chroma = libm::hypot(a, b);
    let hue = libm::atan2(b, a).to_degrees().rem_euclid(360.0);
    if lightness < 16.0 {
        return Some(Color::Black);
    }
    let achromatic = chroma < 9.0 || lightness < 50.0 && chroma < 12.0 || lightness > 88.0 && chroma < 11.0;
    if achromatic {
        return match lightness {
            l if l < 22.0 => Some(Color::Black),
            // Dark grey to some, black to others.
            l if l < 34.0 => None,
            l if l < 76.0 => Some(Color::Grey),
            l if l < 82.0 => None,
            _ => Some(Color::White),
        };
    }
    chromatic(lightness, chroma, hue)
}

/// Name of a colour that is not black, grey or white.
fn chromatic(lightness: f64, chroma: f64, hue: f64) -> Option<Color> {
    // Beige, cream, ivory.
    if chroma < 16.0 && (75.0..110.0).contains(&hue) && lightness >= 55.0 {
        return None;
    }
    match hue {
        h if !(22.0..345.0).contains(&h) => match () {
            () if lightness >= 60.0 => Some(Color::Pink),
            () if chroma >= 22.0 => Some(Color::Red),
            () => Some(Color::Brown),
        },
        h if h < 42.0 => match () {
            () if lightness >= 68.0 && chroma < 45.0 => Some(Color::Pink),
            () if chroma >= 45.0 && lightness < 60.0 => Some(Color::Red),
            () if chroma >= 45.0 => Some(Color::Orange),
            () if chroma >= 26.0 && lightness < 42.0 => Some(Color::Red),
            () if lightness < 62.0 => Some(Color::Brown),
            () => None,
        },
        h if h < 72.0 => match () {
            () if lightness >= 55.0 && chroma >= 45.0 => Some(Color::Orange),
            () if lightness < 62.0 && chroma >= 12.0 => Some(Color::Brown),
            () => None,
        },
        h if h < 105.0 => match () {
            () if lightness >= 62.0 && chroma >= 38.0 => Some(Color::Yellow),
            () if lightness < 56.0 && chroma >= 12.0 => Some(Color::Brown),
            () => None,
        },
        h if h < 185.0 => (chroma >= 12.0).then_some(Color::Green),
        // Teal.
        h if h < 218.0 => None,
        h if h < 296.0 => (chroma >= 12.0).then_some(Color::Blue),
        h if h < 330.0 => (chroma >= 14.0).then_some(Color::Purple),
        _ if chroma < 14.0 => None,
        _ if lightness >= 55.0 => Some(Color::Pink),
        _ => Some(Color::Purple),
    }
}

/// CIELAB of an sRGB colour with white point D65 (CIE 15; matrix of the primaries of ITU-R BT.709).
fn lab(rgb: [u8; 3]) -> [f64; 3] {
    let [red, green, blue] = rgb.map(|code| {
        let value = f64::from(code) / 255.0;
        if value > 0.04045 { libm::pow((value + 0.055) / 1.055, 2.4) } else { value / 12.92 }
    });
    let x = (0.412453 * red + 0.357580 * green + 0.180423 * blue) / 0.95047;
    let y = 0.212671 * red + 0.715160 * green + 0.072169 * blue;
    let z = (0.019334 * red + 0.119193 * green + 0.950227 * blue) / 1.08883;
    let [x, y, z] =
        [x, y, z].map(|value| if value > 0.008856 { libm::cbrt(value) } else { 7.787 * value + 16.0 / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}
