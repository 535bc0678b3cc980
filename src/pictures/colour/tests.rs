use super::*;

fn is_srgb(tag: &ColourTag) -> bool {
    matches!(tag.meaning(CodeDepth::Eight), Ok(CodeMeaning::Srgb))
}

fn gamma(exponent: Option<u32>, primaries: Option<[u32; 8]>) -> ColourTag {
    ColourTag::Gamma(Gamma { exponent, primaries })
}

const SRGB: [u32; 8] = [31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000];
const P3: [u32; 8] = [31_270, 32_900, 68_000, 32_000, 26_500, 69_000, 15_000, 6_000];

const ADOBE_RGB: [u32; 8] = [31_270, 32_900, 64_000, 33_000, 21_000, 71_000, 15_000, 6_000];
const BT2020: [u32; 8] = [31_270, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600];
const SMPTE_170M: [u32; 8] = [31_270, 32_900, 63_000, 34_000, 31_000, 59_500, 15_500, 7_000];

#[test]
fn gamma_and_primaries_of_srgb_are_srgb() {
    let rounded = [31_269, 32_899, 63_999, 33_001, 30_000, 60_000, 15_000, 5_999];
    for (exponent, primaries) in [
        (Some(45_455), None),
        (Some(45_455), Some(SRGB)),
        (None, Some(SRGB)),
        (Some(45_405), None),
        (Some(45_505), Some(rounded)),
        // BT.709 and SMPTE 170M, as ffmpeg up to version 7 writes them.
        (Some(50_994), None),
        (Some(50_994), Some(SRGB)),
        (Some(50_994), Some(SMPTE_170M)),
        (None, Some(SMPTE_170M)),
    ] {
        assert!(is_srgb(&gamma(exponent, primaries)), "{exponent:?}");
    }
    for (exponent, primaries, expected) in [
        (Some(45_404), None, "is 0.45404; 0.45455 (sRGB) expected"),
        (Some(45_506), None, "is 0.45506"),
        (Some(55_556), Some(SRGB), "is 0.55556"),
        (Some(100_000), None, "linear light in 8 bits"),
        (Some(45_455), Some(ADOBE_RGB), "green 0.21, 0.71"),
        (None, Some(P3), "Display P3, but no transfer"),
        (None, Some(BT2020), "may be HDR"),
    ] {
        let problem = gamma(exponent, primaries).meaning(CodeDepth::Eight).unwrap_err();
        assert!(problem.contains(expected), "{problem}");
        assert!(problem.contains("--decode colour=ignore"), "{problem}");
    }
}

#[test]
fn linear_light_needs_16_bits() {
    let linear = gamma(Some(100_000), Some(SRGB));
    assert!(matches!(linear.meaning(CodeDepth::Sixteen), Ok(CodeMeaning::Linear)));
    assert!(linear.meaning(CodeDepth::Eight).is_err());
    let of_p3 = gamma(Some(100_000), Some(P3));
    assert!(of_p3.meaning(CodeDepth::Sixteen).is_err());
}

/// The name and handling of a colour space that is converted.
fn space(tag: &ColourTag) -> (String, ColourHandling) {
    let Ok(CodeMeaning::Other(space)) = tag.meaning(CodeDepth::Eight) else { panic!("{tag:?}") };
    let note = space.note(space.handling);
    assert_eq!(note.profile, None);
    (note.from, note.handling)
}

#[test]
fn code_points_are_converted_or_refused_by_name() {
    for points in [[1, 13, 0, 1], [1, 1, 0, 1], [6, 6, 0, 1], [5, 1, 0, 1], [2, 2, 0, 1]] {
        assert!(is_srgb(&ColourTag::CodePoints(points)), "{points:?}");
    }
    for (points, name, handling) in [
        ([12, 13, 0, 1], "Display P3", ColourHandling::Converted),
        ([12, 1, 0, 1], "Display P3", ColourHandling::Video),
        ([9, 1, 0, 1], "BT.2020", ColourHandling::Video),
        ([9, 16, 0, 1], "PQ (HDR), BT.2020", ColourHandling::Clipped),
        ([9, 18, 0, 1], "HLG (HDR), BT.2020", ColourHandling::Clipped),
    ] {
        let found = space(&ColourTag::CodePoints(points));
        assert_eq!(found, (name.to_owned(), handling));
    }
    for (points, expected) in [
        ([1, 13, 0, 0], "narrow range"),
        ([12, 13, 0, 0], "narrow range"),
        ([9, 16, 9, 0], "narrow range"),
        ([9, 2, 0, 1], "may be HDR (cICP 9/2)"),
        ([1, 13, 1, 1], "1/13/1/1 (cICP)"),
    ] {
        let problem = ColourTag::CodePoints(points).meaning(CodeDepth::Eight).unwrap_err();
        assert!(problem.contains(expected) && problem.contains("--decode colour=ignore"), "{problem}");
    }
}

/// ffmpeg 5.1 writes `gAMA` and `cHRM`, ffmpeg 7 also `cICP`.
#[test]
fn gamma_and_primaries_are_what_code_points_are() {
    for (exponent, primaries, points) in [
        (50_994, BT2020, [9, 1, 0, 1]),
        (50_994, P3, [12, 1, 0, 1]),
        (45_455, P3, [12, 13, 0, 1]),
        (35_714, SRGB, [1, 5, 0, 1]),
        (35_714, BT2020, [9, 5, 0, 1]),
    ] {
        let stated = gamma(Some(exponent), Some(primaries));
        assert_eq!(space(&stated), space(&ColourTag::CodePoints(points)));
    }
}

/// An ICC profile with this colour space, connection space and one empty tag.
fn profile_header([space, connection, tag]: [&[u8; 4]; 3]) -> Vec<u8> {
    let mut profile = vec![0; 128];
    profile[16..20].copy_from_slice(space);
    profile[20..24].copy_from_slice(connection);
    profile.extend(1_u32.to_be_bytes());
    profile.extend(tag);
    profile.extend([0; 8]);
    profile
}

#[test]
fn unsupported_profiles_are_refused_by_name() {
    for (profile, expected) in [
        (profile_header([b"CMYK", b"Lab ", b"A2B0"]), "for CMYK"),
        (profile_header([b"Lab ", b"XYZ ", b"desc"]), "for Lab"),
        (profile_header([b"HSV ", b"XYZ ", b"desc"]), "of the kind \"HSV\""),
        (profile_header([b"RGB ", b"XYZ ", b"A2B1"]), "by tables (A2B)"),
        (profile_header([b"RGB ", b"Lab ", b"rXYZ"]), "connection space of the ICC profile"),
        (profile_header([b"RGB ", b"XYZ ", b"rXYZ"]), "broken"),
        (vec![0; 100], "ends too early"),
    ] {
        let problem = ColourTag::Profile(profile).meaning(CodeDepth::Eight).unwrap_err();
        assert!(problem.contains(expected), "{expected}: {problem}");
        assert!(problem.contains("ICC profile") && problem.contains("--decode colour=ignore"));
    }
    for chunk in [&b"no end of the name"[..], b"name\0", b"name\0\0no deflate"] {
        let problem = ColourTag::DeflatedProfile(chunk.to_vec()).meaning(CodeDepth::Eight).unwrap_err();
        assert!(problem.contains("cannot be decompressed"), "{problem}");
    }
}

/// A profile of tables with the code points of PQ, as programs write it for HDR.
#[test]
fn an_hdr_profile_counts_by_its_code_points() {
    let mut profile = profile_header([b"RGB ", b"Lab ", b"cicp"]);
    let start = profile.len() as u32;
    profile[136..140].copy_from_slice(&start.to_be_bytes());
    profile.extend(b"cicp\0\0\0\0");
    let with = |points: [u8; 4]| ColourTag::Profile([&profile[..], &points].concat());
    let found = space(&with([9, 16, 0, 1]));
    assert_eq!(found.0, "PQ (HDR), BT.2020");
    // Other profiles count by their curves.
    assert!(with([1, 13, 0, 1]).meaning(CodeDepth::Eight).is_err());
    assert!(ColourTag::Profile(profile).meaning(CodeDepth::Eight).is_err());
}

fn conversion(primaries: u8, transfer: u8) -> Option<FrameConversion> {
    StatedColours { primaries, transfer }.conversion().unwrap()
}

#[test]
fn frames_have_the_codes_of_images() {
    let samples: Vec<u16> = (0..3000_u32).map(|i| (i * 7919 % 65_536) as u16).collect();
    for (primaries, transfer) in [(9, 16), (9, 18), (9, 1), (12, 13), (1, 5)] {
        let (frame, _) = conversion(primaries, transfer).unwrap().convert(&samples);
        let points = CodePoints { primaries, transfer };
        let Ok(CodeMeaning::Other(space)) = points.meaning(CodeDepth::Sixteen) else {
            panic!("{primaries}/{transfer}")
        };
        let mut image = samples.clone();
        space.conversion.convert_16(&mut image);
        for (code, deep) in frame.iter().zip(&image) {
            assert!((f64::from(*code) - f64::from(*deep) / 257.0).abs() < 0.51);
        }
    }
}

#[test]
fn pixels_above_white_are_counted() {
    let hlg = conversion(9, 18).unwrap();
    assert!(hlg.is_hdr());
    let [grey, white, above] = [0.5, 0.749, 0.8].map(|value| [(value * 65_535.0) as u16; 3]);
    let (codes, clipped) = hlg.convert(&[grey, white, above].concat());
    assert_eq!((clipped, codes[6]), (1, 255));
    assert!(codes[0] < 200 && codes[3] < 255, "{codes:?}");
    assert!(!conversion(9, 1).unwrap().is_hdr());
}

#[test]
fn codes_of_sdr_video_are_kept() {
    assert!(conversion(1, 1).is_none());
    assert!(conversion(2, 2).is_none());
}
