//! ICC profiles, written tag by tag (ICC.1, version 2.4).

/// A signed number with 16 bits behind the point.
fn fixed(number: f64) -> [u8; 4] {
    ((number * 65536.0).round() as i32).to_be_bytes()
}

/// A tag of three numbers.
pub fn xyz(numbers: [f64; 3]) -> Vec<u8> {
    let numbers = numbers.map(fixed);
    [&b"XYZ \0\0\0\0"[..], numbers.as_flattened()].concat()
}

/// A curve in segments, by its type and its parameters.
pub fn segments(kind: u16, numbers: &[f64]) -> Vec<u8> {
    let numbers: Vec<[u8; 4]> = numbers.iter().map(|number| fixed(*number)).collect();
    let head = [&b"para\0\0\0\0"[..], &kind.to_be_bytes(), &[0, 0]].concat();
    [&head, numbers.as_flattened()].concat()
}

/// A curve as a table; one value is an exponent with 8 bits behind the point.
pub fn table(values: &[u16]) -> Vec<u8> {
    let count = (values.len() as u32).to_be_bytes();
    let values: Vec<[u8; 2]> = values.iter().map(|value| value.to_be_bytes()).collect();
    [&b"curv\0\0\0\0"[..], &count, values.as_flattened()].concat()
}

fn description(text: &str) -> Vec<u8> {
    let length = (text.len() as u32 + 1).to_be_bytes();
    // The text, its end, and empty texts in Unicode and in Mac script.
    [&b"desc\0\0\0\0"[..], &length, text.as_bytes(), &[0; 1 + 78]].concat()
}

/// A profile with these tags, for colours of a space.
pub fn profile(space: [u8; 4], tags: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let (mut directory, mut data) = (Vec::new(), Vec::new());
    let start = 132 + 12 * tags.len();
    for (tag, content) in tags {
        directory.extend(tag);
        directory.extend(((start + data.len()) as u32).to_be_bytes());
        directory.extend((content.len() as u32).to_be_bytes());
        data.extend(content);
        data.resize(data.len().next_multiple_of(4), 0);
    }
    let mut file = ((start + data.len()) as u32).to_be_bytes().to_vec();
    file.extend([0, 0, 0, 0, 2, 0x40, 0, 0]);
    file.extend([b"mntr", &space[..], b"XYZ "].concat());
    file.extend([7, 0xEA, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0]);
    file.extend(b"acsp");
    file.resize(68, 0);
    file.extend([0.9642, 1.0, 0.8249].map(fixed).as_flattened());
    file.resize(128, 0);
    file.extend((tags.len() as u32).to_be_bytes());
    [file, directory, data].concat()
}

/// A profile of RGB colours, by the XYZ of its red, green and blue, and one curve.
pub fn rgb_profile(name: &str, colorants: [[f64; 3]; 3], curve: &[u8]) -> Vec<u8> {
    let [red, green, blue] = colorants.map(xyz);
    profile(
        *b"RGB ",
        &[
            (*b"desc", description(name)),
            (*b"wtpt", xyz([0.9642, 1.0, 0.8249])),
            (*b"rXYZ", red),
            (*b"gXYZ", green),
            (*b"bXYZ", blue),
            (*b"rTRC", curve.to_vec()),
            (*b"gTRC", curve.to_vec()),
            (*b"bTRC", curve.to_vec()),
        ],
    )
}

/// A profile of shades of grey.
pub fn grey_profile(name: &str, curve: &[u8]) -> Vec<u8> {
    profile(
        *b"GRAY",
        &[(*b"desc", description(name)), (*b"wtpt", xyz([0.9642, 1.0, 0.8249])), (*b"kTRC", curve.to_vec())],
    )
}

/// The curve of sRGB.
pub fn srgb_curve() -> Vec<u8> {
    segments(3, &[2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045])
}

/// The XYZ of the colours of sRGB.
pub const SRGB: [[f64; 3]; 3] = [[0.43607, 0.22249, 0.01392], [0.38515, 0.71687, 0.09708], [0.14307, 0.06061, 0.7141]];

/// The XYZ of the colours of Display P3.
pub const DISPLAY_P3: [[f64; 3]; 3] =
    [[0.51512, 0.2412, -0.00105], [0.29198, 0.69225, 0.04189], [0.1571, 0.06657, 0.78407]];
