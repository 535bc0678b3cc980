use proptest::prelude::*;

use super::*;

/// A `.npy` file of the given version, as `numpy.save` writes it.
fn file(major: u8, header: &str, data: &[u8]) -> Vec<u8> {
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

fn array(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}   \n");
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
fn one_channel_is_dropped() {
    for shape in ["(2, 3, 1)", "(1, 2, 3)", "(2, 3)"] {
        let bytes = array("|u1", shape, &[1, 2, 3, 4, 5, 6]);
        let npy = Npy::parse(&bytes).unwrap();
        assert_eq!(npy.size, (2, 3), "{shape}");
        assert_eq!(npy.numbers().last(), Some(6.0));
    }
    for shape in ["(2, 1, 3)", "(1, 2, 3, 1)", "(6,)"] {
        let problem = Npy::parse(&array("|u1", shape, &[0; 6])).unwrap_err();
        assert!(problem.contains("[height, width, 1]"), "{problem}");
    }
}

#[test]
fn every_integer_is_read() {
    for (descr, data, expected) in [
        ("|i1", vec![0xff, 2], [-1, 2]),
        ("|u1", vec![0xff, 2], [255, 2]),
        ("<i2", vec![0xfe, 0xff, 2, 1], [-2, 258]),
        ("<u2", vec![0xfe, 0xff, 2, 1], [65_534, 258]),
        ("<i4", [[0xff; 4], [1, 0, 1, 0]].concat(), [-1, 65_537]),
        ("<u4", [[0xff; 4], [1, 0, 1, 0]].concat(), [4_294_967_295, 65_537]),
        ("<i8", [[0xff; 8], [9, 0, 0, 0, 0, 0, 0, 0]].concat(), [-1, 9]),
        ("<u8", [[0xff; 8], [9, 0, 0, 0, 0, 0, 0, 0]].concat(), [u64::MAX.into(), 9]),
    ] {
        let bytes = array(descr, "(2, 1)", &data);
        let npy = Npy::parse(&bytes).unwrap();
        assert_eq!(npy.integers().unwrap().collect::<Vec<_>>(), expected, "{descr}");
        assert!(npy.floats().is_err());
    }
}

#[test]
fn errors_name_the_unsupported_property() {
    let fortran = "{'descr': '|u1', 'fortran_order': True, 'shape': (1, 1), }\n";
    let twice_open = "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 1)} }\n";
    let record = "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1, 1), }\n";
    for (bytes, expected) in [
        (b"\x89PNG".to_vec(), "not a .npy file"),
        (file(1, fortran, &[1]), "Fortran order"),
        (file(1, record, &[0; 4]), "its header is not"),
        (file(1, twice_open, &[1]), "its header is not"),
        (file(1, "{}", &[1]), "its header is not"),
        (array(">f4", "(1, 1)", &[0; 4]), "\">f4\""),
        (array("|b1", "(1, 1)", &[0]), "\"|b1\""),
        (array("<c8", "(1, 1)", &[0; 8]), "\"<c8\""),
        (array("|u1", "(2, 1, 2)", &[0; 4]), "[2, 1, 2]"),
        (array("|u1", "(1,)", &[0]), "[1]"),
        (array("|u1", "()", &[0]), "[]"),
        (array("|u1", "(1 1)", &[0]), "its header is not"),
        (array("|u1", "(1, -1)", &[0]), "its header is not"),
        (array("|u1", "(99999999999999999999, 1)", &[0]), "its header is not"),
        (array("<u8", "(4611686018427387904, 4)", &[]), "not a whole"),
        (array("|u1", "(2, 2)", &[0; 3]), "not a whole"),
        (array("|u1", "(2, 2)", &[0; 5]), "not a whole"),
    ] {
        let problem = Npy::parse(&bytes).unwrap_err();
        assert!(problem.contains(expected), "{expected}: {problem}");
    }
}

#[test]
fn a_file_truncated_anywhere_is_refused() {
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
