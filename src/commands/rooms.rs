//! The `rooms` command: writes the built-in rooms as a folder of frames.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Decides, FrameId, Labels, SegmentName};
use darkqa_data::frame_folder::{self, FRAMES, FrameOutput};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::{ThreadArgs, pool};
use darkqa_pictures::{exr, png};
use darkqa_rooms::{Room, Rooms};
use darkqa_runs::Outcome;

/// The flags of `rooms`.
#[derive(Debug, Args)]
pub(crate) struct RoomsArgs {
    /// Where the frames go, in the common interface
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The rooms to make.
    #[command(flatten)]
    pub rooms: Rooms,
    /// Write into a folder that holds frames already
    #[arg(long, add = Decides::Nothing)]
    pub force: bool,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Writes the rooms as a folder of frames, in the program's common dataset format. Each thread keeps one frame in
/// memory.
///
/// # Errors
/// If the folder has frames already and `--force` is not set, a room cannot be rendered, or a file cannot be written.
pub(crate) fn rooms(args: &RoomsArgs, progress: &Progress) -> Result<Outcome> {
    let frames_file = args.out.join(FRAMES);
    if !args.force && frames_file.exists() {
        let problem = "the folder has frames already; --force overwrites them, another --out keeps both";
        return Err(Error::data(frames_file.display(), problem));
    }
    let workers = pool(args.threads.threads)?;
    let rooms: BTreeMap<FrameId, Room> = args.rooms.all().collect();
    let bar = progress.bar("rooms", rooms.len());
    let frames: Vec<WrittenFrame> = workers.install(|| {
        rooms
            .values()
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|room| {
                let frame = write_frame(args, room);
                bar.inc();
                frame
            })
            .collect::<Result<_>>()
    })?;
    drop(bar);
    // The frames of a scene share one file of segment names: write it once, after the threads have finished.
    let names_by_scene: BTreeMap<_, _> = frames.iter().map(|frame| (&*frame.scene, &frame.names)).collect();
    for (scene, names) in names_by_scene {
        frame_folder::write_segment_names(&args.out, scene, names)?;
    }
    let info = json!({
        "schema": "darkqa.dataset/1",
        "name": args.rooms.title(),
        "label_space": "mpcat40",
        "source": format!("darkqa-eval rooms {} {}", darkqa_rooms::VERSION, args.rooms),
    });
    let labels: Labels = darkqa_rooms::labels();
    let lines = frames.iter().map(|frame| &frame.line);
    frame_folder::write_folder_files(&args.out, &labels, &info, lines)?;
    Ok(Outcome::wrote(
        &args.out,
        Status::Complete,
        format!("{}: {}\n", args.out.display(), counted(frames.len(), "frame")),
    ))
}

/// Record of a frame whose files have been written.
struct WrittenFrame {
    /// JSON object in `frames.jsonl`.
    line: Map<String, Value>,
    scene: String,
    /// Segment names of the scene, by segment ID.
    names: Arc<BTreeMap<u32, SegmentName>>,
}

/// Renders a room and writes its files.
fn write_frame(args: &RoomsArgs, room: &Room) -> Result<WrittenFrame> {
    let frame = room.frame()?;
    let output = FrameOutput { out: &args.out, scene: &frame.scene, frame: room.view() };
    let mut line = output.line(frame.rgb.width(), frame.rgb.height());
    let png_file = output.write("rgb", "png", &png(&frame.rgb)?)?;
    // A room with linear light is read from its EXR file; its PNG file is only a preview.
    let rgb_file = match room.light() {
        Some(light) => output.write("rgb", "exr", &exr(&light)?)?,
        None => png_file,
    };
    line.insert("rgb".to_owned(), json!(rgb_file));
    if let Some(depth) = &frame.depth {
        output.write_depth(&mut line, depth, frame.depth_kind)?;
    }
    if let Some(semantic) = &frame.semantic {
        output.write_semantic(&mut line, semantic)?;
    }
    if let Some(segments) = &frame.segments {
        output.write_segments(&mut line, segments, frame.segmentation)?;
    }
    line.insert("intrinsics".to_owned(), json!(frame.intrinsics));
    line.insert("pose".to_owned(), json!(room.pose()));
    line.insert("room_gt".to_owned(), json!(frame.room));
    Ok(WrittenFrame { line, scene: frame.scene.clone(), names: Arc::clone(&frame.names) })
}
