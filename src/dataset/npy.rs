//! Arrays as NumPy saves them: [`Npy`].
//!
//! The format is that of `numpy.lib.format`: `\x93NUMPY`, a version, the header's length, and as header a Python
//! dictionary with `descr`, `fortran_order` and `shape`; then the numbers, row by row. Versions 1 to 3 differ only in
//! the width of the length and the header's encoding.

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
enum Numbers {
    Floats(fn(&[u8]) -> f64),
    Integers(fn(&[u8]) -> i128),
}

impl Numbers {
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
pub(super) struct Npy<'a> {
    numbers: Numbers,
    /// The size of a number in bytes.
    width: usize,
    /// Height and width.
    pub(super) size: (usize, usize),
    data: &'a [u8],
}

impl<'a> Npy<'a> {
    /// Reads the header and checks that the numbers are all there.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let rest = bytes
            .strip_prefix(MAGIC)
            .ok_or("not a .npy file: it does not begin as numpy.save begins one")?;
        let (header, data) = split(rest)?;
        let header = String::from_utf8_lossy(header);
        let (descr, fortran, shape) = fields(&header).ok_or_else(|| {
            let header = header.trim_end();
            format!("its header is not that of one .npy array: {header:.200}")
        })?;
        let (width, numbers) = Numbers::of(descr).ok_or_else(|| {
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
    pub(super) fn floats(self) -> Result<impl Iterator<Item = f64>, String> {
        match self.numbers {
            Numbers::Floats(read) => Ok(self.data.chunks_exact(self.width).map(read)),
            Numbers::Integers(_) => {
                Err("it holds integers; floats of 4 or 8 bytes expected".to_owned())
            }
        }
    }

    /// The numbers, row by row, where they are integers.
    pub(super) fn integers(self) -> Result<impl Iterator<Item = i128>, String> {
        match self.numbers {
            Numbers::Integers(read) => Ok(self.data.chunks_exact(self.width).map(read)),
            Numbers::Floats(_) => Err("it holds floats; integers expected".to_owned()),
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
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A file as `numpy.save` writes it, in the given version.
    pub(crate) fn file(major: u8, header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([major, 0]);
        if major == 1 {
            bytes.extend((header.len() as u16).to_le_bytes());
        } else {
            bytes.extend((header.len() as u32).to_le_bytes());
        }
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    pub(crate) fn array(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}   \n");
        file(1, &header, data)
    }

    #[test]
    fn every_version_is_read() {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }  \n";
        let data = [1.5_f32, -2.0].map(f32::to_le_bytes).concat();
        for major in 1..=3 {
            let bytes = file(major, header, &data);
            let npy = Npy::parse(&bytes).unwrap();
            assert_eq!(npy.size, (1, 2));
            assert_eq!(npy.floats().unwrap().collect::<Vec<_>>(), [1.5, -2.0]);
            assert!(npy.integers().is_err());
        }
        let problem = Npy::parse(&file(4, header, &data)).unwrap_err();
        assert!(problem.contains("version 4"), "{problem}");
    }

    #[test]
    fn every_integer_is_read() {
        for (descr, data, expected) in [
            ("|i1", vec![0xff, 2], [-1, 2]),
            ("|u1", vec![0xff, 2], [255, 2]),
            ("<i2", vec![0xfe, 0xff, 2, 1], [-2, 258]),
            ("<u2", vec![0xfe, 0xff, 2, 1], [65_534, 258]),
            ("<i4", [[0xff; 4], [1, 0, 1, 0]].concat(), [-1, 65_537]),
            (
                "<u4",
                [[0xff; 4], [1, 0, 1, 0]].concat(),
                [4_294_967_295, 65_537],
            ),
            (
                "<i8",
                [[0xff; 8], [9, 0, 0, 0, 0, 0, 0, 0]].concat(),
                [-1, 9],
            ),
            (
                "<u8",
                [[0xff; 8], [9, 0, 0, 0, 0, 0, 0, 0]].concat(),
                [u64::MAX.into(), 9],
            ),
        ] {
            let bytes = array(descr, "(2, 1)", &data);
            let npy = Npy::parse(&bytes).unwrap();
            assert_eq!(
                npy.integers().unwrap().collect::<Vec<_>>(),
                expected,
                "{descr}"
            );
            assert!(npy.floats().is_err());
        }
    }

    #[test]
    fn other_arrays_are_refused_by_what_they_are() {
        let fortran = "{'descr': '|u1', 'fortran_order': True, 'shape': (1, 1), }\n";
        let twice_open = "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 1)} }\n";
        let record = "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1, 1), }\n";
        for (bytes, says) in [
            (b"\x89PNG".to_vec(), "not a .npy file"),
            (file(1, fortran, &[1]), "Fortran order"),
            (file(1, record, &[0; 4]), "its header is not"),
            (file(1, twice_open, &[1]), "its header is not"),
            (file(1, "{}", &[1]), "its header is not"),
            (array(">f4", "(1, 1)", &[0; 4]), "\">f4\""),
            (array("|b1", "(1, 1)", &[0]), "\"|b1\""),
            (array("<c8", "(1, 1)", &[0; 8]), "\"<c8\""),
            (array("|u1", "(1, 1, 1)", &[0]), "[1, 1, 1]"),
            (array("|u1", "(1,)", &[0]), "[1]"),
            (array("|u1", "()", &[0]), "[]"),
            (array("|u1", "(1 1)", &[0]), "its header is not"),
            (array("|u1", "(1, -1)", &[0]), "its header is not"),
            (
                array("|u1", "(99999999999999999999, 1)", &[0]),
                "its header is not",
            ),
            (array("<u8", "(4611686018427387904, 4)", &[]), "not a whole"),
            (array("|u1", "(2, 2)", &[0; 3]), "not a whole"),
            (array("|u1", "(2, 2)", &[0; 5]), "not a whole"),
        ] {
            let problem = Npy::parse(&bytes).unwrap_err();
            assert!(problem.contains(says), "{says}: {problem}");
        }
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let whole = array("<u2", "(2, 2)", &[0; 8]);
        assert!(Npy::parse(&whole).is_ok());
        for end in 0..whole.len() {
            assert!(Npy::parse(&whole[..end]).is_err(), "{end}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_panic(
            version in 0_u8..5,
            header in "\\PC{0,40}|\\{('(descr|shape|fortran_order)': ?('<u2'|True|\\([0-9]{0,21},? ?[0-9]{0,3}\\)|[\\[(x]),? ?){0,4}\\}?",
            bytes in prop::collection::vec(any::<u8>(), 0..40),
        ) {
            let _ = Npy::parse(&bytes);
            let _ = Npy::parse(&[MAGIC, &bytes].concat());
            let whole = file(version, &header, &bytes);
            if let Ok(npy) = Npy::parse(&whole) {
                let count = npy.integers().map_or(0, Iterator::count);
                prop_assert_eq!(count, npy.size.0 * npy.size.1);
            }
        }
    }
}
