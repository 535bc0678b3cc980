//! Decoder of 16-bit binary PGM files (Netpbm, format P5): a text header, then big-endian samples.

use super::decoded::{Decoded, MosaicForm, developed, too_large};

/// Decodes a file that starts with `P` and a digit.
pub(super) fn decode(bytes: &[u8], most_pixels: u64) -> Result<Decoded, String> {
    let problem = match bytes[1] {
        b'5' => None,
        b'2' => Some("a PGM of text (P2); a binary one (P5) is read".to_owned()),
        b'3' | b'6' => Some(developed("a PPM of three channels")),
        _ => Some("a Netpbm file that is not a binary PGM (P5)".to_owned()),
    };
    if let Some(problem) = problem {
        return Err(problem);
    }
    let mut header = Header { bytes, at: 2 };
    let [width, height, maximum] = [header.number("width")?, header.number("height")?, header.number("maximum")?];
    if width == 0 || height == 0 {
        return Err(format!("{width} × {height} pixels are not an image"));
    }
    if let Some(problem) = too_large(width, height, most_pixels) {
        return Err(problem);
    }
    if maximum <= 255 {
        return Err(developed(&format!("a PGM of 8 bits (maximum {maximum})")));
    }
    let Ok(maximum) = u16::try_from(maximum) else {
        return Err(format!("the maximum {maximum} is above 65535, the largest of the format"));
    };
    // A single white-space character ends the header.
    let rest = bytes.get(header.at + 1..).unwrap_or_default();
    let expected = width * height * 2;
    if rest.len() != expected {
        let problem = if rest.len() < expected {
            "not a whole PGM: the file ends early"
        } else {
            "more than one image, or no PGM of 16 bits"
        };
        return Err(format!("{problem}: {} bytes of samples, {expected} expected", rest.len()));
    }
    let samples: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect();
    let largest = samples.iter().copied().max().unwrap_or(0);
    if largest > maximum {
        return Err(format!(
            "a sample of {largest} is above the maximum {maximum} of the header; samples are big-endian"
        ));
    }
    Ok(Decoded { height, width, samples, form: MosaicForm::Pgm(maximum), camera: None, taken: None })
}

/// Parser of the header of a file.
struct Header<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    at: usize,
}

impl Header<'_> {
    /// Parses the next number, after white space and comments.
    fn number(&mut self, name: &str) -> Result<usize, String> {
        let missing = || format!("not a readable PGM: no {name} in its header");
        loop {
            match self.bytes.get(self.at).ok_or_else(missing)? {
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    let end = rest.iter().position(|byte| *byte == b'\n');
                    self.at += end.ok_or_else(missing)?;
                }
                byte if byte.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let rest = &self.bytes[self.at..];
        // Ten digits are enough for any supported image.
        let length = rest.iter().take(10).take_while(|byte| byte.is_ascii_digit()).count();
        let number = std::str::from_utf8(&rest[..length]).ok().and_then(|digits| digits.parse().ok());
        self.at += length;
        let ends = self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace);
        number.filter(|_| ends).ok_or_else(missing)
    }
}
