//! The settings that decide the pixels that are sent: [`Recipe`].

use std::collections::BTreeSet;
use std::num::NonZeroU32;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::images::enhancement::{DarkImage, EnhancedImages};
use crate::images::frames::{CameraScope, DegradeStage, Source, SourceFrame, Walk};
use crate::images::recipes::image_recipe::ImageRecipe;
use crate::picture::PayloadFormat;
use crate::picture::Scaling;
use crate::types::degradations::Kind;
use crate::types::{
    Condition, Degradation, Digest, EnhancerName, ExposureFacts, FrameId, Severity,
};
use darkqa_enhance::{EnhancedFolder, ModelFile};
use darkqa_light::{self, AppliedDegradation, FrameView, KindSettings, NoiseKey, Synthesis};

/// All settings that decide an image, except its frame and its condition.
#[derive(Debug)]
pub(crate) struct Recipe {
    pub(crate) seed: u64,
    pub(crate) kinds: KindSettings,
    pub(crate) format: PayloadFormat,
    pub(crate) scaling: Scaling,
    /// Whether light is reduced before or after scaling.
    pub(crate) degraded_at: DegradeStage,
    /// The frames that share one state of the camera.
    pub(crate) camera_of: CameraScope,
    /// Enhancers that are run, with the digests of their files.
    pub(crate) enhancers: Vec<(EnhancerName, Digest)>,
    /// Images that were enhanced elsewhere.
    pub(crate) elsewhere: Vec<EnhancedImages>,
}

impl Recipe {
    pub(crate) fn new(
        kinds: &KindSettings,
        format: PayloadFormat,
        max_side: Option<NonZeroU32>,
        files: &[ModelFile],
    ) -> Self {
        Self {
            format,
            scaling: max_side.map_or(Scaling::Never, Scaling::MaxSide),
            ..Self::lossless(kinds, files)
        }
    }

    /// The recipe for PNG images in the size of their frames.
    pub(crate) fn lossless(kinds: &KindSettings, files: &[ModelFile]) -> Self {
        let enhancers = files.iter();
        Self {
            seed: kinds.sensor.seed,
            kinds: kinds.clone(),
            format: PayloadFormat::Png,
            scaling: Scaling::Never,
            degraded_at: DegradeStage::Native,
            camera_of: CameraScope::Frame,
            enhancers: enhancers
                .map(|file| (file.name().clone(), file.digest()))
                .collect(),
            elsewhere: Vec::new(),
        }
    }

    /// The recipe with the images of folders, too.
    ///
    /// # Errors
    /// If a folder cannot be read, or two enhancers have the same name.
    pub(crate) fn with_elsewhere(self, folders: &[EnhancedFolder]) -> Result<Self> {
        let models = self.enhancers.iter().map(|(name, _)| name);
        let elsewhere = EnhancedImages::open_all(folders, models)?;
        Ok(Self { elsewhere, ..self })
    }

    /// The names of all enhancers: those that are run, then those of folders.
    pub(crate) fn enhancer_names(&self) -> Vec<EnhancerName> {
        let run = self.enhancers.iter().map(|(name, _)| name);
        let elsewhere = self.elsewhere.iter().map(EnhancedImages::name);
        run.chain(elsewhere).cloned().collect()
    }

    /// The images of the enhancer of this name, if they were made elsewhere.
    pub(crate) fn elsewhere(&self, name: &EnhancerName) -> Option<&EnhancedImages> {
        self.elsewhere.iter().find(|images| images.name() == name)
    }

    /// The recipe for frames of walks.
    pub(crate) fn for_walks(self, walk: &Walk) -> Self {
        Self {
            scaling: walk.side,
            degraded_at: walk.degraded_at,
            camera_of: walk.camera,
            ..self
        }
    }

    /// The key that the noise of a frame is drawn from.
    pub(crate) fn noise(&self, source: &FrameId, frame: &FrameId) -> NoiseKey {
        let own = NoiseKey::new(self.seed, frame);
        match self.camera_of {
            CameraScope::Frame => own,
            CameraScope::Episode => own.with_camera_of(&NoiseKey::new(self.seed, source)),
        }
    }

    /// The digest of all that decides the images of a source in a condition, and of nothing else. For example, the seed enters only if
    /// the degradation is random, so exposure drops have the same digest in runs with different seeds.
    ///
    /// # Errors
    /// If the condition has a reading that the recipe lacks.
    pub(crate) fn stimulus(&self, source: &Source, condition: &Condition) -> Result<Digest> {
        let images: Vec<ImageKeyFacts<'_>> = source
            .frames
            .iter()
            .map(|frame| self.facts(&source.name, frame, condition))
            .collect::<Result<_>>()?;
        let in_order: Vec<&ImageKeyFacts<'_>> =
            source.order.iter().map(|index| &images[*index]).collect();
        Digest::canonical("darkqa.images/2", &in_order)
    }

    /// All that decides the image of a frame in a condition.
    ///
    /// # Errors
    /// If the condition has a reading that the recipe lacks.
    pub(crate) fn facts<'a>(
        &'a self,
        source: &'a FrameId,
        frame: &'a SourceFrame,
        condition: &Condition,
    ) -> Result<ImageKeyFacts<'a>> {
        let how = frame.degradation(condition)?;
        let degradation = how.map(|how| self.degradation(source, frame, &how));
        let enhancer = condition.enhancer.as_ref();
        let enhancer = enhancer.map(|name| self.enhancer_facts(name, frame, condition));
        Ok(ImageKeyFacts {
            picture: frame.picture(condition)?,
            degradation: degradation.transpose()?,
            enhancer: enhancer.transpose()?.flatten(),
            format: self.format.to_string(),
            scaling: self.scaling,
            scaled_before: (self.degraded_at == DegradeStage::Resized).then_some(true),
        })
    }

    /// All that an enhancer decides of the image of a frame; `None` if the recipe lacks it.
    fn enhancer_facts(
        &self,
        name: &EnhancerName,
        frame: &SourceFrame,
        condition: &Condition,
    ) -> Result<Option<EnhancerFacts>> {
        if let Some(images) = self.elsewhere(name) {
            return Ok(Some(EnhancerFacts {
                digest: images.digest_of(&frame.id, condition)?,
                version: None,
            }));
        }
        let model = self.enhancers.iter().find(|(known, _)| known == name);
        Ok(model.map(|(_, digest)| EnhancerFacts {
            digest: *digest,
            version: Some(darkqa_enhance::VERSION),
        }))
    }
}

impl Recipe {
    /// Checks that the camera can make each image, which depends on the sizes of the frames, and that all images that were enhanced
    /// elsewhere are there.
    ///
    /// # Errors
    /// If a picture would move too far during an exposure; names the frame. If images of a folder cannot be used; names them.
    pub(crate) fn check(&self, sources: &[Source], conditions: &[Condition]) -> Result<()> {
        for source in sources {
            for frame in &source.frames {
                let how = conditions
                    .iter()
                    .filter(|of| frame.can_show(of))
                    .map(|condition| frame.degradation(condition))
                    .collect::<Result<BTreeSet<Option<Degradation>>>>()?;
                for how in how.iter().flatten().filter(|how| how.kind().has_motion()) {
                    self.applied(&source.name, frame, how)?;
                }
            }
        }
        for images in &self.elsewhere {
            images.check(&self.dark_images(images.name(), sources, conditions)?)?;
        }
        Ok(())
    }

    /// The dark images that the enhancer of this name gets, as `synthesize` would write them.
    fn dark_images<'a>(
        &self,
        name: &EnhancerName,
        sources: &'a [Source],
        conditions: &'a [Condition],
    ) -> Result<Vec<DarkImage<'a>>> {
        let mut images = Vec::new();
        for source in sources {
            for frame in &source.frames {
                let enhanced = conditions.iter().filter(|condition| {
                    condition.enhancer.as_ref() == Some(name) && frame.can_show(condition)
                });
                for condition in enhanced {
                    let how = frame.degradation(condition)?;
                    let applied = how.as_ref();
                    let applied = applied.map(|how| self.applied(&source.name, frame, how));
                    let applied = applied.transpose()?;
                    let file = (frame.digest, frame.note.clone());
                    let key = self.noise(&source.name, &frame.id);
                    images.push(DarkImage {
                        frame,
                        condition,
                        recipe: ImageRecipe::new(
                            &frame.id,
                            file,
                            how.as_ref(),
                            applied.as_ref(),
                            &key,
                            self.seed,
                        ),
                    });
                }
            }
        }
        Ok(images)
    }

    fn applied(
        &self,
        source: &FrameId,
        frame: &SourceFrame,
        how: &Degradation,
    ) -> Result<AppliedDegradation> {
        let key = self.noise(source, &frame.id);
        let view = self.view(frame.size, frame.focal);
        let applied = self.kinds.apply(how, view, &key);
        applied.map_err(|e| Error::data(format_args!("{} at {how}", frame.id), e))
    }

    fn degradation<'a>(
        &'a self,
        source: &'a FrameId,
        frame: &'a SourceFrame,
        how: &Degradation,
    ) -> Result<DegradationFacts<'a>> {
        let kind = how.kind();
        let applied = self.applied(source, frame, how)?;
        let random = kind.has_noise();
        let of_source = random && self.camera_of == CameraScope::Episode;
        Ok(DegradationFacts {
            kind,
            severity: how.severity(),
            version: darkqa_light::version(kind),
            reading: applied.synthesis().cloned(),
            seed: random.then_some(self.seed),
            frame: random.then_some(&frame.id),
            camera_of: of_source.then_some(source),
            exposure: applied.exposure(),
        })
    }

    /// A frame of this width and height as the camera saw it, in the size in which it is degraded. `focal` is in pixels of the
    /// frame.
    pub(crate) fn view(&self, size: (u32, u32), focal: Option<f64>) -> FrameView {
        let own = size.0 as usize;
        let width = match self.degraded_at {
            DegradeStage::Native => own,
            DegradeStage::Resized => self.scaling.size(size).0,
        };
        let scale = width as f64 / own as f64;
        FrameView {
            width,
            focal: focal.map(|focal| focal * scale),
        }
    }
}

/// All that decides an image, as it enters the digest.
#[derive(Serialize)]
pub(crate) struct ImageKeyFacts<'a> {
    picture: Digest,
    degradation: Option<DegradationFacts<'a>>,
    enhancer: Option<EnhancerFacts>,
    format: String,
    scaling: Scaling,
    /// `Some(true)` if the frame is scaled before its light is reduced; else `None`.
    scaled_before: Option<bool>,
}

/// All that decides a degraded frame, except the frame's content. Seed and frame are set only if the kind is random.
#[derive(Serialize)]
struct DegradationFacts<'a> {
    kind: Kind,
    severity: Severity,
    version: u32,
    reading: Option<Synthesis>,
    seed: Option<u64>,
    frame: Option<&'a FrameId>,
    /// Source whose frames share one state of the camera; `None` if each frame has its own.
    camera_of: Option<&'a FrameId>,
    /// The camera's exposure for this frame: it determines the pixels of kinds with motion blur.
    exposure: Option<ExposureFacts>,
}

#[derive(Serialize)]
struct EnhancerFacts {
    /// Digest of the model with its sidecar; of the image itself if it was enhanced elsewhere.
    digest: Digest,
    /// `None` for images that were enhanced elsewhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    version: Option<u32>,
}
