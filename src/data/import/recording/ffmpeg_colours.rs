//! Colours of the frames of a video, as ffmpeg states them: [`FrameColours`].

use std::path::Path;

use darkqa_base::types::text::shell_word;
use darkqa_pictures::{FrameConversion, StatedColours};

/// Colours of a frame in the words of ffmpeg.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FrameColours {
    matrix: String,
    primaries: String,
    transfer: String,
}

/// Number in H.273 of primaries and transfers that are not stated.
const UNSPECIFIED: u8 = 2;

/// Primaries of ffmpeg (`av_color_primaries_name`) with their numbers in H.273, table 2.
const PRIMARIES: [(&str, u8); 14] = [
    ("bt709", 1),
    ("unknown", UNSPECIFIED),
    ("bt470m", 4),
    ("bt470bg", 5),
    ("smpte170m", 6),
    ("smpte240m", 7),
    ("film", 8),
    ("bt2020", 9),
    ("smpte428", 10),
    ("smpte428_1", 10),
    ("smpte431", 11),
    ("smpte432", 12),
    ("ebu3213", 22),
    ("jedec-p22", 22),
];

/// Transfers of ffmpeg (`av_color_transfer_name`) with their numbers in H.273, table 3.
const TRANSFERS: [(&str, u8); 20] = [
    ("bt709", 1),
    ("unknown", UNSPECIFIED),
    ("gamma22", 4),
    ("bt470m", 4),
    ("gamma28", 5),
    ("bt470bg", 5),
    ("smpte170m", 6),
    ("smpte240m", 7),
    ("linear", 8),
    ("log100", 9),
    ("log316", 10),
    ("iec61966-2-4", 11),
    ("bt1361e", 12),
    ("iec61966-2-1", 13),
    ("bt2020-10", 14),
    ("bt2020-12", 15),
    ("smpte2084", 16),
    ("smpte428", 17),
    ("smpte428_1", 17),
    ("arib-std-b67", 18),
];

/// Matrices that the scaler of ffmpeg undoes (`sws_getCoefficients`). It takes any other as BT.601.
const MATRICES: [&str; 9] = ["gbr", "rgb", "bt709", "unknown", "fcc", "bt470bg", "smpte170m", "smpte240m", "bt2020nc"];

impl FrameColours {
    /// Parses the line of the filter `showinfo` about the colours of a frame.
    pub(super) fn parse(line: &str) -> Option<Self> {
        let (_, fields) = line.split_once("showinfo")?.1.split_once("] color_range:")?;
        let field = |name: &str| {
            let (_, rest) = fields.split_once(name)?;
            rest.split_whitespace().next().map(str::to_owned)
        };
        Some(Self {
            matrix: field(" color_space:")?,
            primaries: field(" color_primaries:")?,
            transfer: field(" color_trc:")?,
        })
    }

    /// The conversion of the frames to sRGB; `None` if their codes are taken as sRGB codes.
    ///
    /// # Errors
    /// If these colours are not converted. The error has the remedy for the video at `path`.
    pub(super) fn conversion(&self, path: &Path) -> Result<Option<FrameConversion>, String> {
        let filtered = |filter: &str| {
            let input = path.display().to_string();
            let input = shell_word(&input);
            format!("ffmpeg -i {input} -vf {filter} -c:v ffv1 converted.mkv")
        };
        if !MATRICES.contains(&&*self.matrix) {
            return Err(format!(
                "the frames have the colour matrix {}, which the scaler of ffmpeg does not undo; convert it first, by an ffmpeg with zscale: {}",
                self.matrix,
                filtered("zscale=matrix=709")
            ));
        }
        let number = |names: &[(&str, u8)], name: &str| {
            names.iter().find(|(known, _)| *known == name).map(|(_, number)| *number)
        };
        let (Some(primaries), Some(transfer)) =
            (number(&PRIMARIES, &self.primaries), number(&TRANSFERS, &self.transfer))
        else {
            return Err(format!(
                "the frames have colours that are not known here (primaries {}, transfer {}); convert the video to BT.709 first",
                self.primaries, self.transfer
            ));
        };
        let stated = StatedColours { primaries, transfer };
        stated.conversion().map_err(|problem| match transfer {
            UNSPECIFIED => format!(
                "{problem}; state it, arib-std-b67 for HLG, smpte2084 for PQ, bt709 for others: {}",
                filtered("setparams=color_trc=arib-std-b67")
            ),
            // Linear and logarithmic codes, which the filter knows.
            8..=10 => {
                // The filter converts only from colours that are stated.
                let mut filter = "zscale=transfer=709:primaries=709:matrix=709".to_owned();
                for (stated, key) in [(&self.primaries, "primariesin"), (&self.matrix, "matrixin")] {
                    if stated == "unknown" {
                        filter.extend([":", key, "=709"]);
                    }
                }
                format!("{problem}; convert the video first, by an ffmpeg with zscale: {}", filtered(&filter))
            }
            _ => format!("{problem}; convert the video to BT.709 first"),
        })
    }
}

/// True if the description of a stream names colours that are not taken as sRGB. Needed for versions of ffmpeg that do
/// not state the colours of frames.
pub(super) fn needs_colours(stream: &str) -> bool {
    ["bt2020", "smpte2084", "arib-std-b67", "smpte43", "linear", "log100", "log316"]
        .iter()
        .any(|name| stream.contains(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colours(matrix: &str, primaries: &str, transfer: &str) -> FrameColours {
        let line = format!(
            "[Parsed_showinfo_1 @ 0x1] color_range:tv color_space:{matrix} color_primaries:{primaries} color_trc:{transfer}"
        );
        FrameColours::parse(&line).unwrap()
    }

    /// The name of the colours that are converted; an empty text if the codes are kept.
    fn converted(matrix: &str, primaries: &str, transfer: &str) -> Result<String, String> {
        let found = colours(matrix, primaries, transfer).conversion(Path::new("my video.mp4"))?;
        Ok(found.map_or(String::new(), |conversion| conversion.name().to_owned()))
    }

    #[test]
    fn colours_of_frames_are_parsed() {
        let line = "[Parsed_showinfo_0 @ 0x5] color_range:unknown color_space:bt709 color_primaries:unknown color_trc:unknown\n";
        let expected = FrameColours {
            matrix: "bt709".to_owned(),
            primaries: "unknown".to_owned(),
            transfer: "unknown".to_owned(),
        };
        assert_eq!(FrameColours::parse(line), Some(expected));
        for line in [
            "[Parsed_showinfo_0 @ 0x5] n: 0 pts: 0 pts_time:0 fmt:yuv420p",
            "    comment : color_range:tv color_space:bt709 color_primaries:bt709 color_trc:bt709",
        ] {
            assert_eq!(FrameColours::parse(line), None, "{line}");
        }
    }

    #[test]
    fn codes_of_ordinary_video_are_kept() {
        for matrix in MATRICES {
            for primaries in ["bt709", "unknown", "bt470bg", "smpte170m", "smpte240m", "ebu3213"] {
                for transfer in [
                    "bt709",
                    "unknown",
                    "gamma22",
                    "smpte170m",
                    "smpte240m",
                    "iec61966-2-1",
                    "iec61966-2-4",
                    "bt1361e",
                    "bt2020-10",
                ] {
                    assert_eq!(converted(matrix, primaries, transfer), Ok(String::new()));
                }
            }
        }
    }

    #[test]
    fn other_colours_are_converted_by_name() {
        for (primaries, transfer, expected) in [
            ("bt2020", "arib-std-b67", "HLG (HDR), BT.2020"),
            ("bt2020", "smpte2084", "PQ (HDR), BT.2020"),
            ("unknown", "smpte2084", "PQ (HDR), BT.2020"),
            ("bt2020", "bt2020-10", "BT.2020"),
            ("smpte432", "bt709", "Display P3"),
            ("bt470bg", "gamma28", "gamma 2.8"),
        ] {
            let found = converted("bt2020nc", primaries, transfer);
            assert_eq!(found.as_deref(), Ok(expected));
        }
    }

    #[test]
    fn colours_that_are_not_converted_have_a_remedy() {
        for (matrix, primaries, transfer, expected) in [
            ("ycgco", "bt709", "bt709", "-i 'my video.mp4' -vf zscale=matrix=709 "),
            ("ictcp", "bt2020", "smpte2084", "matrix ictcp"),
            ("bt709", "bt2020", "unknown", "setparams=color_trc=arib-std-b67"),
            ("bt709", "bt709", "log100", "zscale=transfer=709"),
            ("gbr", "bt709", "linear", "linear light in 8 bits"),
            ("bt709", "bt709", "vlog", "transfer vlog"),
            ("bt709", "bt709", "smpte428", "digital cinema (SMPTE ST 428); convert"),
            ("bt709", "reserved", "bt709", "primaries reserved"),
        ] {
            let problem = converted(matrix, primaries, transfer).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }
}
