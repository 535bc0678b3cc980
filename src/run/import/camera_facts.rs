//! Facts about cameras that a recording has beside its images: [`Cameras`] and [`Exposures`].

use std::collections::{BTreeSet, HashMap, VecDeque};

use serde_json::{Map, Value};

use crate::import::recording::{CameraInfo, Exposure, Nanoseconds};
use crate::types::Intrinsics;

/// Exposures that wait for their image (chosen); drivers send both within a few frames.
const WAITING_EXPOSURES: usize = 1000;

/// The cameras of a recording by their names, each with the times from which its facts hold.
#[derive(Default)]
pub(super) struct Cameras(HashMap<String, Vec<(Nanoseconds, CameraInfo)>>);

impl Cameras {
    /// Adds facts that differ from those before.
    pub(super) fn add(&mut self, camera: &str, time: Nanoseconds, info: CameraInfo) {
        let infos = self.0.entry(camera.to_owned()).or_default();
        if infos.last().is_none_or(|(_, last)| *last != info) {
            infos.push((time, info));
        }
    }

    /// The intrinsics of a frame: the last ones before it, or else the first.
    pub(super) fn intrinsics(
        &self,
        camera: &str,
        topic: &str,
        time: Nanoseconds,
        size: (usize, usize),
    ) -> Option<Intrinsics> {
        let infos = self.0.get(camera)?;
        let after = infos.partition_point(|(from, _)| *from <= time);
        let (_, info) = &infos[after.saturating_sub(1)];
        info.intrinsics_for(topic, size)
    }
}

/// Exposures of chosen frames, which come before or after their images.
#[derive(Default)]
pub(super) struct Exposures {
    recent: VecDeque<(String, Exposure)>,
    wanted: BTreeSet<(String, Nanoseconds)>,
    pub(super) found: HashMap<(String, Nanoseconds), Map<String, Value>>,
}

impl Exposures {
    pub(super) fn add(&mut self, camera: &str, exposure: Exposure) {
        let key = (camera.to_owned(), exposure.stamp);
        if self.wanted.remove(&key) {
            self.found.insert(key, exposure.values);
            return;
        }
        self.recent.push_back((camera.to_owned(), exposure));
        if self.recent.len() > WAITING_EXPOSURES {
            self.recent.pop_front();
        }
    }

    /// Notes that the exposure of a frame is needed.
    pub(super) fn want(&mut self, camera: &str, stamp: Nanoseconds) {
        let key = (camera.to_owned(), stamp);
        let is_of_frame =
            |(name, exposure): &&(String, Exposure)| name == camera && exposure.stamp == stamp;
        match self.recent.iter().find(is_of_frame) {
            Some((_, exposure)) => drop(self.found.insert(key, exposure.values.clone())),
            None => drop(self.wanted.insert(key)),
        }
    }
}
