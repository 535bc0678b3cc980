//! LeRobot data sets as the tests write them: two cameras, and tasks for each episode.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use image::{Rgb, RgbImage};
use serde_json::{Value, json};

use super::image_files::png;
use super::parquet_file::{Column, table, tables};

pub const FRONT: &str = "observation.images.front";
pub const WRIST: &str = "observation.images.wrist";

/// Frames per second of all sets.
const FPS: u32 = 10;

/// A set that [`Set::write`] writes.
#[derive(Debug, Clone)]
pub struct Set {
    /// `v3.0`, or `v2.1` or `v2.0`.
    pub version: &'static str,
    /// Frames of each episode.
    pub lengths: Vec<u32>,
    /// True for cameras in video files, false for images in Parquet.
    pub videos: bool,
    /// Name of the column with the texts of the tasks in version 3.0.
    pub task_column: &'static str,
    /// Frames per second of the camera at the wrist, in videos.
    pub wrist_fps: u32,
}

impl Default for Set {
    fn default() -> Self {
        Self { version: "v3.0", lengths: vec![3, 4], videos: false, task_column: "task", wrist_fps: FPS }
    }
}

/// The task of an episode.
pub fn task(episode: u32) -> String {
    format!("pick up cup {episode}")
}

/// Grey level of a frame. In the first episodes, all frames of a camera differ by 10 codes or more.
pub fn grey(camera: &str, episode: u32, frame: u32) -> u8 {
    (20 + 40 * (episode % 3) + 10 * frame + if camera == FRONT { 0 } else { 100 }) as u8
}

/// The image of a frame.
pub fn picture(camera: &str, episode: u32, frame: u32) -> RgbImage {
    let code = grey(camera, episode, frame);
    RgbImage::from_pixel(32, 16, Rgb([code; 3]))
}

impl Set {
    fn is_v3(&self) -> bool {
        self.version.starts_with("v3")
    }

    /// Writes the set into a folder.
    pub fn write(&self, folder: &Path) {
        self.write_tables(folder);
        for camera in [FRONT, WRIST].into_iter().filter(|_| self.videos) {
            let episodes: Vec<u32> = (0..self.lengths.len() as u32).collect();
            if self.is_v3() {
                let path = folder.join(format!("videos/{camera}/chunk-000/file-000.mp4"));
                write_file(&path, &self.video(camera, &episodes));
                continue;
            }
            for episode in &episodes {
                let name = format!("videos/chunk-000/{camera}/episode_{episode:06}.mp4");
                write_file(&folder.join(name), &self.video(camera, &[*episode]));
            }
        }
    }

    /// Writes all files but the videos.
    pub fn write_tables(&self, folder: &Path) {
        let file = |name: &str, bytes: Vec<u8>| write_file(&folder.join(name), &bytes);
        file("meta/info.json", self.info().to_string().into_bytes());
        let episodes: Vec<u32> = (0..self.lengths.len() as u32).collect();
        if self.is_v3() {
            let texts = episodes.iter().map(|episode| task(*episode)).collect();
            let tasks =
                [("task_index", Column::Integers(integers(&episodes))), (self.task_column, Column::Texts(texts))];
            file("meta/tasks.parquet", table(tasks));
            file("meta/episodes/chunk-000/file-000.parquet", self.episode_table());
            file("data/chunk-000/file-000.parquet", self.data(&episodes));
        } else {
            let lines = |line: fn(&Self, u32) -> Value| {
                let lines = episodes.iter().map(|episode| line(self, *episode));
                let text: String = lines.map(|line| format!("{line}\n")).collect();
                text.into_bytes()
            };
            let tasks = |_: &Self, episode| json!({"task_index": episode, "task": task(episode)});
            file("meta/tasks.jsonl", lines(tasks));
            let line = |set: &Self, episode: u32| {
                let length = set.lengths[episode as usize];
                json!({"episode_index": episode, "tasks": [task(episode)], "length": length})
            };
            file("meta/episodes.jsonl", lines(line));
            for episode in &episodes {
                let name = format!("data/chunk-000/episode_{episode:06}.parquet");
                file(&name, self.data(&[*episode]));
            }
        }
    }

    /// The content of `info.json`.
    pub fn info(&self) -> Value {
        let form = if self.videos { "video" } else { "image" };
        let camera = |fps: u32| {
            json!({
                "dtype": form, "shape": [16, 32, 3], "names": ["height", "width", "channels"],
                "info": {"video.codec": "mpeg4", "video.fps": fps, "is_depth_map": false},
            })
        };
        let depth = json!({"dtype": form, "shape": [16, 32, 1], "names": null, "info": {"is_depth_map": true}});
        let number = json!({"dtype": "int64", "shape": [1], "names": null});
        let [data, video] = if self.is_v3() {
            [
                "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
                "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
            ]
        } else {
            [
                "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
                "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
            ]
        };
        json!({
            "codebase_version": self.version, "robot_type": "so101_follower", "fps": FPS, "chunks_size": 1000,
            "total_episodes": self.lengths.len(), "data_path": data, "video_path": video,
            "features": {
                FRONT: camera(FPS), WRIST: camera(self.wrist_fps), "observation.images.depth": depth,
                "timestamp": number, "frame_index": number, "episode_index": number, "index": number, "task_index": number,
            },
        })
    }

    /// `meta/episodes` of version 3.0.
    fn episode_table(&self) -> Vec<u8> {
        let count = self.lengths.len();
        let zeros = || Column::Integers(vec![0; count]);
        let mut start = 0.0;
        let starts: Vec<f64> = self
            .lengths
            .iter()
            .map(|length| {
                let from = start;
                start += f64::from(*length) / f64::from(FPS);
                from
            })
            .collect();
        let mut columns: Vec<(String, Column)> = vec![
            ("episode_index".to_owned(), Column::Integers((0..count as i64).collect())),
            ("length".to_owned(), Column::Integers(integers(&self.lengths))),
            ("data/chunk_index".to_owned(), zeros()),
            ("data/file_index".to_owned(), zeros()),
        ];
        for camera in [FRONT, WRIST].into_iter().filter(|_| self.videos) {
            let name = |column: &str| format!("videos/{camera}/{column}");
            columns.push((name("chunk_index"), zeros()));
            columns.push((name("file_index"), zeros()));
            columns.push((name("from_timestamp"), Column::Doubles(starts.clone())));
        }
        table(columns)
    }

    /// A data file with these episodes, a row group each.
    fn data(&self, episodes: &[u32]) -> Vec<u8> {
        let groups = episodes.iter().map(|episode| {
            let length = self.lengths[*episode as usize];
            let frames: Vec<u32> = (0..length).collect();
            let times = frames.iter().map(|frame| *frame as f32 / FPS as f32);
            let mut columns = vec![
                ("timestamp", Column::Floats(times.collect())),
                ("frame_index", Column::Integers(integers(&frames))),
                ("episode_index", Column::Integers(vec![i64::from(*episode); frames.len()])),
                ("task_index", Column::Integers(vec![i64::from(*episode); frames.len()])),
            ];
            for camera in [FRONT, WRIST].into_iter().filter(|_| !self.videos) {
                let images = frames.iter().map(|frame| png(&picture(camera, *episode, *frame)));
                columns.push((camera, Column::Images(images.collect())));
            }
            columns
        });
        tables(groups.collect())
    }

    /// A video of these episodes, encoded by ffmpeg.
    fn video(&self, camera: &str, episodes: &[u32]) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("video.mp4");
        let fps = if camera == WRIST { self.wrist_fps } else { FPS };
        let mut ffmpeg = Command::new("ffmpeg")
            .args(["-v", "error", "-f", "image2pipe", "-c:v", "png"])
            .args(["-framerate", &fps.to_string(), "-i", "-"])
            .args(["-c:v", "mpeg4", "-q:v", "2", "-pix_fmt", "yuv420p"])
            .arg(&path)
            .stdin(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = ffmpeg.stdin.take().unwrap();
        for episode in episodes {
            let length = self.lengths[*episode as usize] * fps / FPS;
            for frame in 0..length {
                let picture = picture(camera, *episode, frame * FPS / fps);
                input.write_all(&png(&picture)).unwrap();
            }
        }
        drop(input);
        assert!(ffmpeg.wait().unwrap().success());
        fs::read(path).unwrap()
    }
}

fn write_file(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn integers(numbers: &[u32]) -> Vec<i64> {
    numbers.iter().map(|number| i64::from(*number)).collect()
}
