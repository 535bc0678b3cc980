//! The flags of `import`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

/// The flags of `import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// What lies in --src: habitat (renders of HM3D-Sem, MP3D, Replica), scannet, nyu (PNG files), sunrgbd, thor (AI2-THOR,
    /// ProcTHOR), folder (images and maps by name, or frames.jsonl)
    #[arg(value_name = "KIND")]
    pub kind: String,
    /// The data set, laid out as src/dataset/import/README.md shows
    #[arg(long, value_name = "DIR")]
    pub src: PathBuf,
    /// Where the frames go, in the common interface
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The name the data set gives itself; questions are named by it; default: the kind
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// The label space of the class maps: nyu40, nyu40-1 (from 0, 255 for void; kind nyu), nyu13, mpcat40, ade150, or a
    /// classes.json
    #[arg(long, value_name = "NAME|FILE", help_heading = "Maps")]
    pub labels: Option<String>,
    /// The metres in one unit of depth PNG files: 0.001 for millimetres, 0.0002 for 1/5000 m; .npy files are in metres
    #[arg(long, value_name = "METRES", help_heading = "Maps")]
    pub depth_scale: Option<f64>,
    /// What depth is measured along: planar (the optical axis) or euclid (the ray); default: planar
    #[arg(long, value_name = "planar|euclid", help_heading = "Maps")]
    pub depth_kind: Option<String>,
    /// The horizontal field of view in degrees, where the data set does not say how its camera projects
    #[arg(long, value_name = "DEGREES", help_heading = "Maps")]
    pub hfov: Option<f64>,
    /// One frame for each so many seconds of a scene (DarkQA: 2); default: every frame
    #[arg(
        long,
        value_name = "SECONDS",
        help_heading = "Key frames",
        conflicts_with = "count"
    )]
    pub every: Option<f64>,
    /// So many frames of each scene, evenly spread
    #[arg(long, value_name = "N", help_heading = "Key frames")]
    pub count: Option<NonZeroUsize>,
    /// Frames a second, where frames have no time of their own
    #[arg(long, value_name = "N", help_heading = "Key frames")]
    pub fps: Option<f64>,
    /// Write into a folder that holds frames already
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub max_pixels: Option<NonZeroU64>,
    /// No progress
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub config: Option<PathBuf>,
}
