//! The check that a PNG file contains nothing but plain 8-bit RGB pixels: [`plain_size`].

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Width and height of a PNG file that contains only plain 8-bit RGB pixels, in pixels; `None` for other files.
///
/// Besides header, image data and end, only chunks without effect are accepted (`sRGB`, and `pHYs` with square pixels).
/// Other chunks (transparency, gamma, profiles, orientation, frames, text) could change the display, or send more than
/// the pixels.
pub(super) fn plain_size(file: &[u8]) -> Option<(u32, u32)> {
    let mut rest = file.strip_prefix(SIGNATURE)?;
    let (first, header, after) = chunk(rest)?;
    if &first != b"IHDR" {
        return None;
    }
    let size = plain_header(header)?;
    rest = after;
    let mut has_data = false;
    loop {
        let (kind, content, after) = chunk(rest)?;
        match &kind {
            b"IDAT" => has_data = has_data || !content.is_empty(),
            b"sRGB" if content.len() == 1 => {}
            b"pHYs" if content.len() == 9 && content[..4] == content[4..8] => {}
            // Bytes after the end are not part of the image, so such a file is not plain.
            b"IEND" if content.is_empty() && after.is_empty() && has_data => return Some(size),
            _ => return None,
        }
        rest = after;
    }
}

/// Width and height in pixels, if the header states 8-bit RGB without interlacing.
fn plain_header(header: &[u8]) -> Option<(u32, u32)> {
    let (width, rest) = header.split_first_chunk::<4>()?;
    let (height, rest) = rest.split_first_chunk::<4>()?;
    let size = (u32::from_be_bytes(*width), u32::from_be_bytes(*height));
    // Bit depth 8, colour type 2 (RGB), the only compression and filter methods that exist, no interlacing.
    let is_plain = rest == [8, 2, 0, 0, 0] && size.0 > 0 && size.1 > 0;
    is_plain.then_some(size)
}

/// The type and content of the first chunk, and the bytes after it; `None` if the file ends too early. Checksums are
/// not verified, because the caller has decoded the file before.
fn chunk(bytes: &[u8]) -> Option<([u8; 4], &[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (kind, rest) = rest.split_first_chunk::<4>()?;
    let (content, rest) = rest.split_at_checked(u32::from_be_bytes(*length) as usize)?;
    let (_checksum, rest) = rest.split_first_chunk::<4>()?;
    Some((*kind, content, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(rest: [u8; 5]) -> Vec<u8> {
        let mut header = [6_u32.to_be_bytes(), 4_u32.to_be_bytes()].concat();
        header.extend(rest);
        header
    }

    fn png(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut file = SIGNATURE.to_vec();
        for (kind, content) in chunks {
            file.extend((content.len() as u32).to_be_bytes());
            file.extend_from_slice(*kind);
            file.extend_from_slice(content);
            file.extend([0; 4]);
        }
        file
    }

    #[test]
    fn plain_files_are_accepted() {
        let rgb = header([8, 2, 0, 0, 0]);
        let square = [1, 2, 3, 4, 1, 2, 3, 4, 1];
        let file = png(&[
            (b"IHDR", &rgb),
            (b"sRGB", &[0]),
            (b"pHYs", &square),
            (b"IDAT", &[1; 9]),
            (b"IDAT", &[2; 9]),
            (b"IEND", &[]),
        ]);
        assert_eq!(plain_size(&file), Some((6, 4)));
        for length in 0..file.len() {
            assert_eq!(plain_size(&file[..length]), None, "cut at {length}");
        }
        assert_eq!(plain_size(&[&file[..], b"x"].concat()), None);
    }

    #[test]
    fn everything_else_is_refused() {
        for other in [[16, 2, 0, 0, 0], [8, 6, 0, 0, 0], [8, 0, 0, 0, 0], [8, 3, 0, 0, 0], [8, 2, 0, 0, 1]] {
            let file = png(&[(b"IHDR", &header(other)), (b"IDAT", &[1; 9]), (b"IEND", &[])]);
            assert_eq!(plain_size(&file), None, "{other:?}");
        }
        let rgb = header([8, 2, 0, 0, 0]);
        for kind in
            [b"tRNS", b"gAMA", b"cHRM", b"iCCP", b"sBIT", b"eXIf", b"acTL", b"cICP", b"PLTE", b"tEXt", b"fcTL", b"IHDR"]
        {
            let file = png(&[(b"IHDR", &rgb), (kind, &[1, 2, 3]), (b"IDAT", &[1; 9]), (b"IEND", &[])]);
            assert_eq!(plain_size(&file), None, "{}", String::from_utf8_lossy(kind));
        }
        assert_eq!(plain_size(&png(&[(b"IHDR", &rgb), (b"IEND", &[])])), None);
        assert_eq!(plain_size(&png(&[(b"IDAT", &[1]), (b"IEND", &[])])), None);
        let mut endless = png(&[(b"IHDR", &rgb)]);
        endless.extend(b"\xff\xff\xff\xffIDAT");
        assert_eq!(plain_size(&endless), None);
    }
}
