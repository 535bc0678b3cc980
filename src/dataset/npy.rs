//! Arrays as NumPy saves them: [`Npy`].
//!
//! The format is that of `numpy.lib.format`: `\x93NUMPY`, a version, the header's length, and as header a Python
//! dictionary with `descr`, `fortran_order` and `shape`; then the numbers, row by row. Versions 1 to 3 differ only in
//! the width of the length and the header's encoding.
//!
//! This is code of ours because the libraries for it (npyz, ndarray-npy) read into memory what is only passed on here, take every
//! type of numbers by a branch of ours all the same, and cost 34 and 45 CPU seconds of building for their parser of Python.

use std::sync::LazyLock;

use regex::Regex;

/// What every such file begins with.
const MAGIC: &[u8] = b"\x93NUMPY";

/// The dictionary before the numbers, its keys in any order. None of its strings that matters here has an escape in it.
static HEADER: LazyLock<Option<Regex>> = LazyLock::new(|| {
    let pattern = r#"(?x) ^ \s* \{ (?: \s* ['"] (?:
            descr ['"] \s* : \s* ['"] (?<descr> [^'"]*) ['"]
            | fortran_order ['"] \s* : \s* (?<fortran> True | False)
            | shape ['"] \s* : \s* \( (?<shape> [0-9,\s]*) \)
        ) \s* ,? )* \s* \} \s* $"#;
    Regex::new(pattern).ok()
});

/// How the numbers of a file are read, each from its bytes.
#[derive(Debug, Clone, Copy)]
enum NumberForm {
    Floats(fn(&[u8]) -> f64),
    Integers(fn(&[u8]) -> i128),
}

impl NumberForm {
    /// Those of one byte, and the little-endian ones: the size of one, and how it is read.
    fn of(descr: &str) -> Option<(usize, Self)> {
        Some(match descr {
            "<f4" => (4, Self::Floats(|b| f32::from_le_bytes(sized(b)).into())),
            "<f8" => (8, Self::Floats(|b| f64::from_le_bytes(sized(b)))),
            "|i1" => (1, Self::Integers(|b| i8::from_le_bytes(sized(b)).into())),
            "<i2" => (2, Self::Integers(|b| i16::from_le_bytes(sized(b)).into())),
            "<i4" => (4, Self::Integers(|b| i32::from_le_bytes(sized(b)).into())),
            "<i8" => (8, Self::Integers(|b| i64::from_le_bytes(sized(b)).into())),
            "|u1" => (1, Self::Integers(|b| u8::from_le_bytes(sized(b)).into())),
            "<u2" => (2, Self::Integers(|b| u16::from_le_bytes(sized(b)).into())),
            "<u4" => (4, Self::Integers(|b| u32::from_le_bytes(sized(b)).into())),
            "<u8" => (8, Self::Integers(|b| u64::from_le_bytes(sized(b)).into())),
            _ => return None,
        })
    }
}

/// The bytes of one number; a chunk always has as many as its type.
fn sized<const N: usize>(chunk: &[u8]) -> [u8; N] {
    chunk.first_chunk().copied().unwrap_or([0; N])
}

/// A two-dimensional array in a file's bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Npy<'a> {
    numbers: NumberForm,
    /// The size of a number in bytes.
    width: usize,
    /// Height and width.
    pub(crate) size: (usize, usize),
    data: &'a [u8],
}

impl<'a> Npy<'a> {
    /// Reads the header and checks that the numbers are all there.
    pub(crate) fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let rest = bytes
            .strip_prefix(MAGIC)
            .ok_or("not a .npy file: it does not begin as numpy.save begins one")?;
        let (header, data) = split(rest)?;
        let header = String::from_utf8_lossy(header);
        let (descr, fortran, shape) = fields(&header).ok_or_else(|| {
            let header = header.trim_end();
            format!("its header is not that of one .npy array: {header:.200}")
        })?;
        let (width, numbers) = NumberForm::of(descr).ok_or_else(|| {
            format!("its numbers are {descr:?}; little-endian integers or floats of 4 or 8 bytes expected")
        })?;
        if fortran == "True" {
            return Err(
                "it is in Fortran order; save numpy.ascontiguousarray(array) instead".to_owned(),
            );
        }
        let [rows, columns] = shape[..] else {
            return Err(format!("its shape is {shape:?}; [height, width] expected"));
        };
        let count = rows.checked_mul(columns);
        if count.and_then(|count| count.checked_mul(width)) != Some(data.len()) {
            return Err(format!(
                "not a whole .npy file: {} bytes follow its header, which do not make {rows} × {columns} {descr:?}",
                data.len()
            ));
        }
        Ok(Self {
            numbers,
            width,
            size: (rows, columns),
            data,
        })
    }

    /// The numbers, row by row, where they are floating-point.
    pub(crate) fn floats(self) -> Result<impl Iterator<Item = f64>, String> {
        match self.numbers {
            NumberForm::Floats(read) => Ok(self.data.chunks_exact(self.width).map(read)),
            NumberForm::Integers(_) => {
                Err("it holds integers; floats of 4 or 8 bytes expected".to_owned())
            }
        }
    }

    /// The numbers, row by row, where they are integers.
    pub(crate) fn integers(self) -> Result<impl Iterator<Item = i128>, String> {
        match self.numbers {
            NumberForm::Integers(read) => Ok(self.data.chunks_exact(self.width).map(read)),
            NumberForm::Floats(_) => Err("it holds floats; integers expected".to_owned()),
        }
    }
}

/// Splits what follows the magic into the header and the data.
fn split(rest: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let cut = || "not a whole .npy file: it ends within its header".to_owned();
    let (&[major, _minor], rest) = rest.split_first_chunk().ok_or_else(cut)?;
    let (length, rest) = match major {
        1 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(cut)?;
            (u16::from_le_bytes(*length).into(), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(cut)?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        _ => {
            return Err(format!(
                "its format is version {major}; versions 1 to 3 of .npy are read"
            ));
        }
    };
    rest.split_at_checked(length).ok_or_else(cut)
}

/// What a header says: the type of the numbers, whether columns go first, and the shape.
fn fields(header: &str) -> Option<(&str, &str, Vec<usize>)> {
    let found = HEADER.as_ref()?.captures(header)?;
    let field = |name| Some(found.name(name)?.as_str());
    let sides = field("shape")?.trim().split_terminator(',');
    let shape: Option<Vec<usize>> = sides.map(|side| side.trim().parse().ok()).collect();
    Some((field("descr")?, field("fortran")?, shape?))
}

#[cfg(test)]
pub(crate) mod tests;
