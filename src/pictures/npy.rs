//! Two-dimensional arrays in the `.npy` format of NumPy: [`Npy`]. A third dimension of 1, as sensors of habitat-lab
//! give it, is dropped.
//!
//! A file (`numpy.lib.format`) consists of `\x93NUMPY`, a version, the length of the header, the header, and the
//! numbers row by row. The header is a Python dictionary with `descr`, `fortran_order` and `shape`. Versions 1 to 3
//! differ only in the width of the length field and the encoding of the header.
//!
//! The numbers are not copied, so a header that states too large a shape allocates nothing. The crate `ndarray-npy` was
//! not used because it parses headers as arbitrary Python literals and adds eight more crates.

use std::sync::LazyLock;

use regex::Regex;

/// The first six bytes of every `.npy` file.
const MAGIC: &[u8] = b"\x93NUMPY";

/// Pattern of the dictionary in the header, with its keys in any order. Strings with escapes do not match.
static HEADER: LazyLock<Option<Regex>> = LazyLock::new(|| {
    let pattern = r#"(?x) ^ \s* \{ (?: \s* ['"] (?:
            descr ['"] \s* : \s* ['"] (?<descr> [^'"]*) ['"]
            | fortran_order ['"] \s* : \s* (?<fortran> True | False)
            | shape ['"] \s* : \s* \( (?<shape> [0-9,\s]*) \)
        ) \s* ,? )* \s* \} \s* $"#;
    Regex::new(pattern).ok()
});

/// Type of the numbers of a file, with a function that converts the bytes of one number.
#[derive(Debug, Clone, Copy)]
enum NumberForm {
    Floats(fn(&[u8]) -> f64),
    Integers(fn(&[u8]) -> i128),
}

impl NumberForm {
    /// The size of one number in bytes, and its type; `None` unless `descr` is a little-endian or one-byte type.
    fn from_descr(descr: &str) -> Option<(usize, Self)> {
        Some(match descr {
            "<f2" => (2, Self::Floats(|b| half::f16::from_le_bytes(sized(b)).into())),
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

/// The bytes of one number as an array. A chunk always has the size of its type.
fn sized<const N: usize>(chunk: &[u8]) -> [u8; N] {
    chunk.first_chunk().copied().unwrap_or([0; N])
}

/// A two-dimensional array in the bytes of a file.
#[derive(Debug, Clone, Copy)]
pub struct Npy<'a> {
    numbers: NumberForm,
    /// Size of a number, in bytes.
    number_size: usize,
    /// Height and width of the array (rows, columns).
    pub size: (usize, usize),
    data: &'a [u8],
}

impl<'a> Npy<'a> {
    /// Reads the header and checks that no number is missing.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let rest = bytes.strip_prefix(MAGIC).ok_or("not a .npy file: it does not begin with \\x93NUMPY")?;
        let (header, data) = split_header(rest)?;
        let header = String::from_utf8_lossy(header);
        let (descr, fortran, shape) = fields(&header).ok_or_else(|| {
            let header = header.trim_end();
            format!("its header is not that of a .npy array: {header:.200}")
        })?;
        if fortran == "True" {
            return Err("it is in Fortran order; save numpy.ascontiguousarray(array) instead".to_owned());
        }
        let ([rows, columns] | [rows, columns, 1] | [1, rows, columns]) = shape[..] else {
            return Err(format!(
                "its shape is {shape:?}; [height, width] expected, or one channel: [height, width, 1]"
            ));
        };
        Self::new(descr, rows, columns, data)
    }

    /// An array of this size in `data`, row by row. `descr` is the type of the numbers.
    ///
    /// # Errors
    /// If the type is not supported, or `data` has another length than the array.
    pub(crate) fn new(descr: &str, rows: usize, columns: usize, data: &'a [u8]) -> Result<Self, String> {
        let (number_size, numbers) = NumberForm::from_descr(descr).ok_or_else(|| {
            format!("its numbers are {descr:?}; little-endian integers or floats of 2, 4 or 8 bytes expected")
        })?;
        let length = rows.checked_mul(columns).and_then(|count| count.checked_mul(number_size));
        if length != Some(data.len()) {
            return Err(format!(
                "not a whole .npy file: {} bytes follow its header, which do not make {rows} × {columns} {descr:?}",
                data.len()
            ));
        }
        Ok(Self { numbers, number_size, size: (rows, columns), data })
    }

    /// The floating-point numbers, row by row; an error for integers.
    pub fn floats(self) -> Result<impl Iterator<Item = f64>, String> {
        match self.numbers {
            NumberForm::Floats(read) => Ok(self.data.chunks_exact(self.number_size).map(read)),
            NumberForm::Integers(_) => Err("it holds integers; floats of 2, 4 or 8 bytes expected".to_owned()),
        }
    }

    /// The numbers, row by row, whatever their type.
    pub fn numbers(self) -> impl Iterator<Item = f64> {
        self.data.chunks_exact(self.number_size).map(move |bytes| match self.numbers {
            NumberForm::Floats(read) => read(bytes),
            NumberForm::Integers(read) => read(bytes) as f64,
        })
    }

    /// The integers, row by row; an error for floating-point numbers.
    pub fn integers(self) -> Result<impl Iterator<Item = i128>, String> {
        match self.numbers {
            NumberForm::Integers(read) => Ok(self.data.chunks_exact(self.number_size).map(read)),
            NumberForm::Floats(_) => Err("it holds floats; integers expected".to_owned()),
        }
    }
}

/// Splits the bytes after the magic number into header and data.
fn split_header(rest: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let (&[major, _minor], rest) = rest.split_first_chunk().ok_or_else(truncated)?;
    let (length, rest) = match major {
        1 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(truncated)?;
            (u16::from_le_bytes(*length).into(), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk().ok_or_else(truncated)?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        _ => {
            return Err(format!("its format is version {major}; versions 1 to 3 of .npy are read"));
        }
    };
    rest.split_at_checked(length).ok_or_else(truncated)
}

/// The fields of a header: `descr`, `fortran_order` and `shape`.
fn fields(header: &str) -> Option<(&str, &str, Vec<usize>)> {
    let found = HEADER.as_ref()?.captures(header)?;
    let descr = found.name("descr")?.as_str();
    let fortran = found.name("fortran")?.as_str();
    let shape = found
        .name("shape")?
        .as_str()
        .trim()
        .split_terminator(',')
        .map(|side| side.trim().parse().ok())
        .collect::<Option<Vec<usize>>>()?;
    Some((descr, fortran, shape))
}

fn truncated() -> String {
    "not a whole .npy file: it ends within its header".to_owned()
}

#[cfg(test)]
mod tests;
