//! Frames of the episodes of a LeRobot data set: [`EpisodeImport`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::num::NonZeroUsize;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::frame_writer::{ChosenFrame, FrameSource, FrameWriter};
use super::mcap_files::slug;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;
use darkqa_base::types::text::counted;
use darkqa_data::ParquetColumns;
use darkqa_data::import::lerobot::{Camera, CameraImages, DataRow, Episode, FilePlace, LeRobotSet};
use darkqa_data::import::recording::video::Video;
use darkqa_data::import::recording::{GreyBlocks, Nanoseconds, Place, Sampler, SamplingArgs, seconds};
use darkqa_engine::images::progress::{Progress, StepBar};
use darkqa_engine::images::workers::pool;
use darkqa_pictures::ImageFile;
use darkqa_pictures::decode_rule::DecodeRule;

/// Maximum number of frames of an import (chosen).
const MAX_FRAMES: usize = 5_000_000;

/// State of the import of a data set.
pub(super) struct EpisodeImport<'a> {
    pub(super) set: &'a LeRobotSet,
    pub(super) cameras: Vec<&'a Camera>,
    pub(super) writer: FrameWriter<'a>,
    pub(super) problems: Problems,
    /// Number of frames in the set, of all cameras.
    pub(super) seen: usize,
    sampling: &'a SamplingArgs,
    episodes: Vec<Episode>,
    /// Seconds from the first row of each episode to its last.
    durations: Vec<f64>,
    tasks: BTreeMap<u32, String>,
}

/// Messages about damaged and missing files.
#[derive(Debug, Default)]
pub(super) struct Problems {
    /// The first ones.
    shown: Vec<String>,
    count: usize,
}

/// Maximum number of problems that are shown (chosen).
const MAX_SHOWN: usize = 20;

impl Problems {
    fn push(&mut self, problem: String) {
        self.count += 1;
        if self.shown.len() < MAX_SHOWN {
            self.shown.push(problem);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Warns of the first ones, and of the number of the others.
    pub(super) fn warn(&self) {
        for problem in &self.shown {
            tracing::warn!("{problem}");
        }
        if self.count > self.shown.len() {
            let others = self.count - self.shown.len();
            tracing::warn!("{}", counted(others, "further problem"));
        }
    }
}

/// A row whose image is wanted, or may be if pixels decide.
#[derive(Debug, Clone, Copy)]
struct ChosenRow {
    /// Index in the list of episodes.
    episode: u32,
    row: DataRow,
}

/// Chosen rows of a camera by the file that has their images.
type RowsByFile = BTreeMap<FilePlace, Vec<ChosenRow>>;

impl<'a> EpisodeImport<'a> {
    pub(super) fn open(
        set: &'a LeRobotSet,
        cameras: Vec<&'a Camera>,
        sampling: &'a SamplingArgs,
        out: &'a Path,
        drive: &str,
        threads: Option<NonZeroUsize>,
    ) -> Result<Self> {
        let videos: Vec<&str> =
            cameras.iter().filter(|camera| camera.form == CameraImages::Video).map(|camera| &*camera.name).collect();
        let mut problems = Problems::default();
        let episodes = set.episodes(&videos)?;
        let tasks = set.tasks().unwrap_or_else(|e| {
            problems.push(format!("{e}; the frames have no task"));
            BTreeMap::new()
        });
        Ok(Self {
            set,
            cameras,
            writer: FrameWriter::new(out, drive.to_owned(), u16::MAX, pool(threads)?),
            problems,
            seen: 0,
            sampling,
            durations: vec![0.0; episodes.len()],
            episodes,
            tasks,
        })
    }

    pub(super) fn camera_names(&self) -> Vec<&'a str> {
        self.cameras.iter().map(|camera| &*camera.name).collect()
    }

    /// Reads all files. Damaged and missing files are added to the problems; the frames of the others are written.
    ///
    /// # Errors
    /// If ffmpeg cannot be used, or too many frames are chosen.
    pub(super) fn read(&mut self, progress: &Progress) -> Result<()> {
        let chosen = self.choose(progress)?;
        let count = chosen.iter().flat_map(RowsByFile::values).map(Vec::len);
        let bar = progress.bar("frames", count.sum());
        let mut videos = 0;
        for (camera, files) in self.cameras.clone().into_iter().zip(chosen) {
            for (place, mut rows) in files {
                let result = match camera.form {
                    CameraImages::Images => {
                        rows.sort_by_key(|row| (row.row.group, row.row.row));
                        self.read_images(camera, place, &rows, &bar)
                    }
                    CameraImages::Video => {
                        let time = |row: &ChosenRow| self.time_in_file(videos, row);
                        rows.sort_by(|a, b| time(a).total_cmp(&time(b)));
                        self.read_video(camera, videos, place, &rows, &bar)
                    }
                };
                match result {
                    Ok(()) => {}
                    Err(e @ Error::Usage { .. }) => return Err(e),
                    Err(e) => {
                        self.problems.push(format!(
                            "{e}; {} of {} left out",
                            counted(rows.len(), "frame"),
                            camera.name
                        ));
                    }
                }
            }
            videos += usize::from(camera.form == CameraImages::Video);
        }
        Ok(())
    }

    /// Chooses rows of each camera. If pixels decide, all rows are chosen here.
    fn choose(&mut self, progress: &Progress) -> Result<Vec<RowsByFile>> {
        let mut files: BTreeMap<FilePlace, Vec<usize>> = BTreeMap::new();
        for (position, episode) in self.episodes.iter().enumerate() {
            files.entry(episode.data).or_default().push(position);
        }
        let bar = progress.bar("data files", files.len());
        let mut chosen = vec![RowsByFile::new(); self.cameras.len()];
        let mut ended = 0;
        for (place, positions) in files {
            bar.inc();
            for (position, rows) in self.rows_by_episode(place, &positions)? {
                let is_ended = self.choose_in_episode(position, rows, &mut chosen);
                ended += usize::from(is_ended);
            }
            let count: usize = chosen.iter().flat_map(RowsByFile::values).map(Vec::len).sum();
            if count > MAX_FRAMES {
                let problem = format_args!("more than {MAX_FRAMES} frames; choose fewer, such as one every 10 seconds");
                return Err(Error::usage("--every", problem));
            }
        }
        if ended > 0 {
            let episodes = counted(ended, "episode");
            tracing::warn!("--at: no frame at one of its times in {episodes}");
        }
        Ok(chosen)
    }

    /// Reads the rows of a data file, which should have the episodes at these positions.
    fn rows_by_episode(&mut self, place: FilePlace, positions: &[usize]) -> Result<Vec<(usize, Vec<DataRow>)>> {
        let mut slots: Vec<(usize, Vec<DataRow>)> = positions.iter().map(|position| (*position, Vec::new())).collect();
        let by_index: HashMap<u32, usize> =
            (0..).zip(positions).map(|(slot, position)| (self.episodes[*position].index, slot)).collect();
        let mut others = 0;
        let read = self.set.rows(place, |row| match by_index.get(&row.episode) {
            Some(slot) => slots[*slot].1.push(row),
            None => others += 1,
        });
        match read {
            Ok(unread) if others + unread > 0 => {
                let path = self.set.data_file(place)?;
                self.problems.push(format!(
                    "{}: {} of no episode that meta has in this file, left out",
                    path.display(),
                    counted(others + unread, "row")
                ));
            }
            Ok(_) => {}
            // The rows in front of the damage are used.
            Err(e) => {
                slots.retain(|(_, rows)| !rows.is_empty());
                self.problems.push(e.to_string());
            }
        }
        Ok(slots)
    }

    /// Chooses the rows of an episode for each camera. Returns true if a time of `--at` is after its end.
    fn choose_in_episode(&mut self, position: usize, mut rows: Vec<DataRow>, chosen: &mut [RowsByFile]) -> bool {
        let episode = &self.episodes[position];
        let mut numbers = HashSet::new();
        rows.retain(|row| numbers.insert(row.frame));
        if rows.len() as u64 != episode.length {
            self.problems.push(format!(
                "episode {}: {}, but meta states {}",
                episode.index,
                counted(rows.len(), "frame"),
                episode.length
            ));
        }
        rows.sort_by(|a, b| a.time.total_cmp(&b.time));
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
            return false;
        };
        let (start, duration) = (first.time, last.time - first.time);
        self.durations[position] = duration;
        let (mut video, mut is_ended) = (0, false);
        for (camera, files) in self.cameras.iter().zip(chosen) {
            let part = match camera.form {
                CameraImages::Images => Some((episode.data, None)),
                CameraImages::Video => {
                    let part = episode.videos.get(video).copied().flatten();
                    video += 1;
                    part.map(|part| (part.place, Some(part.from)))
                }
            };
            let Some((place, from)) = part else {
                self.problems.push(format!("episode {}: meta states no video of {}", episode.index, camera.name));
                continue;
            };
            let own = rows
                .iter()
                .filter(|row| from.is_none_or(|from| has_own_frame(from + row.time, camera.fps, self.set.fps())));
            let mut sampler = self.sampling.sampler(duration);
            let takes_all = sampler.compares_pixels();
            let of_file = files.entry(place).or_default();
            for row in own {
                self.seen += 1;
                let since = nanoseconds(row.time - start);
                if takes_all || sampler.is_due(place_of(row, since, episode)) {
                    of_file.push(ChosenRow { episode: position as u32, row: *row });
                }
            }
            is_ended |= !takes_all && !sampler.missed().is_empty();
        }
        is_ended
    }

    /// Time of a row in its video file, in seconds. `camera` counts the cameras with videos.
    fn time_in_file(&self, camera: usize, row: &ChosenRow) -> f64 {
        let episode = &self.episodes[row.episode as usize];
        let part = episode.videos.get(camera).copied().flatten();
        part.map_or(0.0, |part| part.from) + row.row.time
    }

    /// Takes images of a camera from a data file. The rows are in the order of the file.
    fn read_images(&mut self, camera: &Camera, place: FilePlace, rows: &[ChosenRow], bar: &StepBar) -> Result<()> {
        let table = ParquetColumns::open(&self.set.data_file(place)?)?;
        let mut samplers = Samplers::default();
        for chosen in rows {
            bar.inc();
            let DataRow { group, row, .. } = chosen.row;
            match table.image(&camera.name, group as usize, row as usize) {
                Ok(bytes) => {
                    let thumbnail = || {
                        let file = ImageFile::new(bytes.clone(), String::new(), DecodeRule::default());
                        file.decode().ok().map(|image| GreyBlocks::new(&image))
                    };
                    if self.is_wanted(&mut samplers, chosen, thumbnail) {
                        self.push(camera, chosen, FrameSource::File(bytes));
                    }
                }
                Err(e) => self.writer.fail(&camera.name, &e.to_string()),
            }
        }
        Ok(())
    }

    /// Takes frames of a camera from a video file. The rows are sorted by their time in the file; `number` counts the
    /// cameras with videos.
    fn read_video(
        &mut self,
        camera: &Camera,
        number: usize,
        place: FilePlace,
        rows: &[ChosenRow],
        bar: &StepBar,
    ) -> Result<()> {
        let path = self.set.video_file(place, &camera.name)?;
        let video = Video::open_mp4(&path)?;
        let times: Vec<f64> = rows.iter().map(|row| self.time_in_file(number, row)).collect();
        let tolerance = 0.5 / camera.fps.max(self.set.fps());
        let mut frames = video.frames_within(&spans(&times, tolerance))?;
        let mut samplers = Samplers::default();
        let (mut next, mut missing, mut first_missing) = (0, 0, None);
        let mut end = None;
        while next < rows.len() {
            let frame = match frames.next_frame() {
                Ok(Some(frame)) => frame,
                Ok(None) => break,
                Err(e @ Error::Usage { .. }) => return Err(e),
                Err(e) => {
                    end = Some(e.to_string());
                    break;
                }
            };
            let time = seconds(frame.time);
            while next < rows.len() && times[next] < time + tolerance {
                if times[next] < time - tolerance {
                    missing += 1;
                    first_missing.get_or_insert(next);
                } else {
                    self.take(camera, &mut samplers, &rows[next], &frame.image);
                }
                bar.inc();
                next += 1;
            }
        }
        if next < rows.len() {
            missing += rows.len() - next;
            first_missing.get_or_insert(next);
            bar.advance(rows.len() - next);
            end = end.or_else(|| frames.damage());
        }
        if let Some(first) = first_missing {
            let episode = self.episodes[rows[first].episode as usize].index;
            let reason = end.map_or(String::new(), |end| format!("; {end}"));
            self.problems.push(format!(
                "{}: no frame at {:.3} s, of episode {episode}; {} of {} left out{reason}",
                path.display(),
                times[first],
                counted(missing, "frame"),
                camera.name
            ));
        }
        Ok(())
    }

    fn take(&mut self, camera: &Camera, samplers: &mut Samplers, chosen: &ChosenRow, image: &Rgb) {
        if self.is_wanted(samplers, chosen, || Some(GreyBlocks::new(image))) {
            self.push(camera, chosen, FrameSource::Image(image.clone()));
        }
    }

    /// False if pixels decide and the frame has not changed enough. An image that cannot be decoded goes to the writer,
    /// which counts the problem.
    fn is_wanted(
        &self,
        samplers: &mut Samplers,
        chosen: &ChosenRow,
        thumbnail: impl FnOnce() -> Option<GreyBlocks>,
    ) -> bool {
        if self.sampling.changed.is_none() {
            return true;
        }
        let position = chosen.episode as usize;
        let (start, sampler) = samplers.0.entry(chosen.episode).or_insert_with(|| {
            let sampler = self.sampling.sampler(self.durations[position]);
            (chosen.row.time, sampler)
        });
        let since = nanoseconds(chosen.row.time - *start);
        sampler.is_due(place_of(&chosen.row, since, &self.episodes[position]))
            && thumbnail().is_none_or(|thumbnail| sampler.has_changed(thumbnail))
    }

    /// Gives a frame to the writer.
    fn push(&mut self, camera: &Camera, chosen: &ChosenRow, source: FrameSource) {
        let episode = &self.episodes[chosen.episode as usize];
        let row = &chosen.row;
        let prefix = if self.cameras.len() > 1 { slug(&camera.name) + "-" } else { String::new() };
        let time = nanoseconds(row.time);
        let mut facts: Map<String, Value> =
            [("episode", json!(episode.index)), ("frame_index", json!(row.frame)), ("fps", json!(self.set.fps()))]
                .map(|(key, value)| (key.to_owned(), value))
                .into_iter()
                .collect();
        if let Some(task) = row.task.and_then(|task| self.tasks.get(&task)) {
            facts.insert("task".to_owned(), json!(task));
        }
        let frame = ChosenFrame {
            topic: camera.name.clone(),
            name: format!("{prefix}{:06}", row.frame),
            place: place_of(row, time, episode),
            time,
            log_time: time,
            facts,
            source,
        };
        self.writer.push(frame, true);
    }
}

/// Samplers of episodes with the time of their first row, if pixels decide.
#[derive(Default)]
struct Samplers(HashMap<u32, (f64, Sampler)>);

/// Position of a row: each episode is one scene. `since` is the time since its first row.
fn place_of(row: &DataRow, since: Nanoseconds, episode: &Episode) -> Place {
    Place { time: nanoseconds(row.time), since, stretch: u64::from(episode.index) }
}

fn nanoseconds(seconds: f64) -> Nanoseconds {
    (seconds * 1e9).round() as Nanoseconds
}

/// True if a frame of a slower camera belongs to this row and to no other: the next frame is less than half a row away.
/// `time` is that of the row in the video, `camera` and `rows` are frames and rows per second.
fn has_own_frame(time: f64, camera: f64, rows: f64) -> bool {
    if camera >= rows {
        return true;
    }
    let nearest = (time * camera).round() / camera;
    let distance = (time - nearest) * rows;
    // A frame in the middle between two rows belongs to the first; the small number is for rounding.
    (-0.5 - 1e-6..0.5 - 1e-6).contains(&distance)
}

/// Spans of time with the frames at these times, which are sorted: from half a frame in front to half a frame after.
/// Spans that meet are joined.
fn spans(times: &[f64], tolerance: f64) -> Vec<[f64; 2]> {
    let mut spans: Vec<[f64; 2]> = Vec::new();
    for time in times {
        let [from, to] = [time - tolerance, time + tolerance];
        match spans.last_mut() {
            Some(last) if from <= last[1] + tolerance => last[1] = to,
            _ => spans.push([from, to]),
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_slower_camera_are_those_with_a_frame() {
        let own = |camera: f64| -> Vec<usize> {
            (0..12).filter(|row| has_own_frame(*row as f64 / 10.0, camera, 10.0)).collect()
        };
        assert_eq!(own(10.0).len(), 12);
        assert_eq!(own(30.0).len(), 12);
        assert_eq!(own(5.0), [0, 2, 4, 6, 8, 10]);
        // Frames at 0, 0.333, 0.667 and 1 s.
        assert_eq!(own(3.0), [0, 3, 7, 10]);
        // A frame at 0.25 s is in the middle between two rows.
        assert_eq!(own(4.0), [0, 2, 5, 7, 10]);
    }

    #[test]
    fn spans_that_meet_are_joined() {
        assert_eq!(spans(&[0.0, 0.1, 1.0], 0.05), [[-0.05, 0.1 + 0.05], [1.0 - 0.05, 1.0 + 0.05]]);
        assert!(spans(&[], 0.05).is_empty());
    }
}
