//! Intrinsics and exposures in a recording: [`Cameras`] and [`Exposures`].

use std::collections::{BTreeSet, HashMap, VecDeque};

use serde_json::{Map, Value};

use crate::data::import::recording::{CameraInfo, Exposure, Nanoseconds, intrinsics_names};
use crate::types::Intrinsics;

/// Maximum number of exposures kept until their image arrives (chosen); drivers send both within a few frames.
const MAX_WAITING: usize = 1000;

/// The cameras of a recording by name, each with its intrinsics and the times from which they apply.
#[derive(Default)]
pub(super) struct Cameras(HashMap<String, Vec<(Nanoseconds, CameraInfo)>>);

impl Cameras {
    /// Adds the intrinsics of a camera, if they differ from the last ones.
    pub(super) fn add(&mut self, camera: &str, time: Nanoseconds, info: CameraInfo) {
        let infos = self.0.entry(camera.to_owned()).or_default();
        if infos.last().is_none_or(|(_, last)| *last != info) {
            infos.push((time, info));
        }
    }

    /// The intrinsics of an image topic at a time: the last ones before it, or else the first. Of several cameras whose
    /// names match the topic, the first one with intrinsics for this size is used.
    pub(super) fn intrinsics(&self, topic: &str, time: Nanoseconds, size: (usize, usize)) -> Option<Intrinsics> {
        intrinsics_names(topic).into_iter().find_map(|camera| {
            let infos = self.0.get(camera)?;
            let after = infos.partition_point(|(from, _)| *from <= time);
            let (_, info) = &infos[after.saturating_sub(1)];
            info.intrinsics_for(topic, size)
        })
    }
}

/// Exposures of chosen frames. An exposure may arrive before or after its image.
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
        if self.recent.len() > MAX_WAITING {
            self.recent.pop_front();
        }
    }

    /// Requests the exposure of a frame.
    pub(super) fn want(&mut self, camera: &str, stamp: Nanoseconds) {
        let key = (camera.to_owned(), stamp);
        match self.recent.iter().find(|(name, exposure)| name == camera && exposure.stamp == stamp) {
            Some((_, exposure)) => drop(self.found.insert(key, exposure.values.clone())),
            None => drop(self.wanted.insert(key)),
        }
    }
}
