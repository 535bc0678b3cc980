//! Arrays as NumPy saves them: [`Npy`].
//!
//! The format is that of `numpy.lib.format`: `\x93NUMPY`, a version, the header's length, and as header a Python
//! dictionary with `descr`, `fortran_order` and `shape`; then the numbers, row by row. Versions 1 to 3 differ only in
//! the width of the length and the header's encoding.

/// What every such file begins with.
const MAGIC: &[u8] = b"\x93NUMPY";

/// The type of an array's numbers: those of one byte, and the little-endian ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    F4,
    F8,
    I1,
    I2,
    I4,
    I8,
    U1,
    U2,
    U4,
    U8,
}

impl Number {
    fn of(descr: &str) -> Option<Self> {
        Some(match descr {
            "<f4" => Self::F4,
            "<f8" => Self::F8,
            "|i1" => Self::I1,
            "<i2" => Self::I2,
            "<i4" => Self::I4,
            "<i8" => Self::I8,
            "|u1" => Self::U1,
            "<u2" => Self::U2,
            "<u4" => Self::U4,
            "<u8" => Self::U8,
            _ => return None,
        })
    }

    /// The size of one in bytes.
    fn bytes(self) -> usize {
        match self {
            Self::I1 | Self::U1 => 1,
            Self::I2 | Self::U2 => 2,
            Self::F4 | Self::I4 | Self::U4 => 4,
            Self::F8 | Self::I8 | Self::U8 => 8,
        }
    }
}

/// A two-dimensional array in a file's bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Npy<'a> {
    number: Number,
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
        let (header, data) = header(rest)?;
        let Header {
            descr,
            fortran_order,
            shape,
        } = Header::parse(header).ok_or_else(|| {
            let header = String::from_utf8_lossy(header);
            format!(
                "its header is not that of one .npy array: {:.200}",
                header.trim_end()
            )
        })?;
        let number = Number::of(descr).ok_or_else(|| {
            format!("its numbers are {descr:?}; little-endian integers or floats of 4 or 8 bytes expected")
        })?;
        if fortran_order {
            return Err(
                "it is in Fortran order; save numpy.ascontiguousarray(array) instead".to_owned(),
            );
        }
        let [height, width] = shape[..] else {
            return Err(format!("its shape is {shape:?}; [height, width] expected"));
        };
        let expected = height
            .checked_mul(width)
            .and_then(|count| count.checked_mul(number.bytes()));
        if expected != Some(data.len()) {
            return Err(format!(
                "not a whole .npy file: {} bytes follow its header, which do not make {height} × {width} {descr:?}",
                data.len()
            ));
        }
        Ok(Self {
            number,
            size: (height, width),
            data,
        })
    }

    /// The numbers, row by row, where they are floating-point.
    pub(super) fn floats(self) -> Result<impl Iterator<Item = f64>, String> {
        let read: fn(&[u8]) -> f64 = match self.number {
            Number::F4 => |bytes| f32::from_le_bytes(sized(bytes)).into(),
            Number::F8 => |bytes| f64::from_le_bytes(sized(bytes)),
            _ => {
                return Err("it holds integers; floats of 4 or 8 bytes expected".to_owned());
            }
        };
        Ok(self.data.chunks_exact(self.number.bytes()).map(read))
    }

    /// The numbers, row by row, where they are integers.
    pub(super) fn integers(self) -> Result<impl Iterator<Item = i128>, String> {
        let read: fn(&[u8]) -> i128 = match self.number {
            Number::I1 => |bytes| i8::from_le_bytes(sized(bytes)).into(),
            Number::I2 => |bytes| i16::from_le_bytes(sized(bytes)).into(),
            Number::I4 => |bytes| i32::from_le_bytes(sized(bytes)).into(),
            Number::I8 => |bytes| i64::from_le_bytes(sized(bytes)).into(),
            Number::U1 => |bytes| u8::from_le_bytes(sized(bytes)).into(),
            Number::U2 => |bytes| u16::from_le_bytes(sized(bytes)).into(),
            Number::U4 => |bytes| u32::from_le_bytes(sized(bytes)).into(),
            Number::U8 => |bytes| u64::from_le_bytes(sized(bytes)).into(),
            Number::F4 | Number::F8 => {
                return Err("it holds floats; integers expected".to_owned());
            }
        };
        Ok(self.data.chunks_exact(self.number.bytes()).map(read))
    }
}

/// The bytes of one number; a chunk always has as many as its type.
fn sized<const N: usize>(chunk: &[u8]) -> [u8; N] {
    chunk.first_chunk().copied().unwrap_or([0; N])
}

/// Splits what follows the magic into the header and the data.
fn header(rest: &[u8]) -> Result<(&[u8], &[u8]), String> {
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

/// The dictionary before the numbers.
#[derive(Debug, PartialEq, Eq)]
struct Header<'a> {
    descr: &'a str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'a> Header<'a> {
    fn parse(header: &'a [u8]) -> Option<Self> {
        let mut text = Text(str::from_utf8(header).ok()?);
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        text.sign("{")?;
        while text.sign("}").is_none() {
            let key = text.quoted()?;
            text.sign(":")?;
            match key {
                "descr" => descr = Some(text.quoted()?),
                "fortran_order" => fortran_order = Some(text.boolean()?),
                "shape" => shape = Some(text.tuple()?),
                _ => return None,
            }
            if text.sign(",").is_none() {
                text.sign("}")?;
                break;
            }
        }
        text.0.trim_ascii().is_empty().then_some(())?;
        Some(Self {
            descr: descr?,
            fortran_order: fortran_order?,
            shape: shape?,
        })
    }
}

/// What is still to be read of a Python literal.
struct Text<'a>(&'a str);

impl<'a> Text<'a> {
    /// Takes a sign or word; `None`, and nothing taken, where another stands there.
    fn sign(&mut self, sign: &str) -> Option<()> {
        self.0 = self.0.trim_ascii_start().strip_prefix(sign)?;
        Some(())
    }

    /// Takes a string. None that matters here has an escape in it.
    fn quoted(&mut self) -> Option<&'a str> {
        let text = self.0.trim_ascii_start();
        let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (inside, rest) = text.get(1..)?.split_once(quote)?;
        self.0 = rest;
        Some(inside)
    }

    fn boolean(&mut self) -> Option<bool> {
        let truth = self.sign("True").map(|()| true);
        truth.or_else(|| self.sign("False").map(|()| false))
    }

    fn tuple(&mut self) -> Option<Vec<usize>> {
        let mut items = Vec::new();
        self.sign("(")?;
        while self.sign(")").is_none() {
            let text = self.0.trim_ascii_start();
            let end = text.find(|c: char| !c.is_ascii_digit())?;
            let (digits, rest) = text.split_at(end);
            items.push(digits.parse().ok()?);
            self.0 = rest;
            if self.sign(",").is_none() {
                self.sign(")")?;
                break;
            }
        }
        Some(items)
    }
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
