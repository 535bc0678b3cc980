//! The settings that decide the pixels of sent images: [`Recipe`].
//!
//! Software versions and enhancer settings that decide images besides their recipes: [`Maker`].

use std::collections::BTreeSet;
use std::num::NonZeroU32;

use serde::Serialize;

use crate::images::enhancement::{DarkImage, EnhancedImages};
use crate::images::frames::{CameraScope, DegradeStage, Source, SourceFrame, WalkArgs};
use crate::images::recipes::image_recipe::ImageRecipe;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Condition, Degradation, Digest, EnhancerName, ExposureFacts, FrameId, Severity};
use darkqa_enhance::{EnhancedFolder, ModelFile, SizeArgs};
use darkqa_light::{AppliedDegradation, FrameView, KindSettings, NoiseKey, Synthesis};
use darkqa_pictures::{PayloadFormat, Scaling};

/// All settings that decide an image, except its frame and its condition.
#[derive(Debug)]
pub struct Recipe {
    pub seed: u64,
    pub kinds: KindSettings,
    pub format: PayloadFormat,
    pub scaling: Scaling,
    /// When frames are degraded: before or after scaling.
    pub degraded_at: DegradeStage,
    /// The frames that share one camera state.
    pub camera_scope: CameraScope,
    /// Enhancement models to run, with the digests of their files.
    pub enhancers: Vec<(EnhancerName, Digest)>,
    /// Images that were enhanced by other programs (`--enhanced`), one entry per folder.
    pub enhanced_images: Vec<EnhancedImages>,
}

impl Recipe {
    pub fn new(kinds: &KindSettings, format: PayloadFormat, max_side: Option<NonZeroU32>, files: &[ModelFile]) -> Self {
        Self { format, scaling: max_side.map_or(Scaling::Never, Scaling::MaxSide), ..Self::lossless(kinds, files) }
    }

    /// The recipe for PNG images in the size of their frames.
    pub fn lossless(kinds: &KindSettings, files: &[ModelFile]) -> Self {
        Self {
            seed: kinds.sensor.seed,
            kinds: kinds.clone(),
            format: PayloadFormat::Png,
            scaling: Scaling::Never,
            degraded_at: DegradeStage::Native,
            camera_scope: CameraScope::Frame,
            enhancers: files.iter().map(|file| (file.name().clone(), file.digest())).collect(),
            enhanced_images: Vec::new(),
        }
    }

    /// Adds folders of images that were enhanced by other programs.
    ///
    /// # Errors
    /// If a folder cannot be read, or two enhancers have the same name.
    pub fn with_enhanced_images(self, folders: &[EnhancedFolder]) -> Result<Self> {
        let models = self.enhancers.iter().map(|(name, _)| name);
        Ok(Self { enhanced_images: EnhancedImages::open_all(folders, models)?, ..self })
    }

    /// The names of all enhancers: first the models to run, then the folders of enhanced images.
    pub fn enhancer_names(&self) -> Vec<EnhancerName> {
        let models = self.enhancers.iter().map(|(name, _)| name);
        let folders = self.enhanced_images.iter().map(EnhancedImages::name);
        models.chain(folders).cloned().collect()
    }

    /// The folder of enhanced images with this name; `None` if the enhancer is a model to run.
    pub fn enhanced_images(&self, name: &EnhancerName) -> Option<&EnhancedImages> {
        self.enhanced_images.iter().find(|images| images.name() == name)
    }

    /// The recipe for frames of walks.
    #[must_use]
    pub fn for_walks(self, walk: &WalkArgs) -> Self {
        Self { scaling: walk.side, degraded_at: walk.degraded_at, camera_scope: walk.camera, ..self }
    }

    /// The seed of a draw of the noise, so that draw `n` has the images of a run whose seed is larger by `n`.
    pub fn seed(&self, draw: u16) -> u64 {
        self.seed.wrapping_add(u64::from(draw))
    }

    /// The key of a draw of the noise of a frame.
    pub fn noise_key(&self, source: &FrameId, frame: &FrameId, draw: u16) -> NoiseKey {
        let seed = self.seed(draw);
        let own = NoiseKey::new(seed, frame);
        match self.camera_scope {
            CameraScope::Frame => own,
            CameraScope::Episode => own.with_camera_of(&NoiseKey::new(seed, source)),
        }
    }

    /// Digest of exactly the settings that decide the images of a source in a condition. For example, the seed is
    /// included only if the degradation is random, so that exposure drops have the same digest in runs with different
    /// seeds.
    ///
    /// # Errors
    /// If the recipe lacks the noise profile of the condition.
    pub fn stimulus_digest(&self, source: &Source, condition: &Condition) -> Result<Digest> {
        let images: Vec<ImageKeyFacts<'_>> =
            source.frames.iter().map(|frame| self.key_facts(&source.name, frame, condition)).collect::<Result<_>>()?;
        let in_order: Vec<&ImageKeyFacts<'_>> = source.order.iter().map(|index| &images[*index]).collect();
        Digest::canonical("darkqa.images/2", &in_order)
    }

    /// The facts that decide the image of a frame in a condition.
    ///
    /// # Errors
    /// If the recipe lacks the noise profile of the condition.
    pub fn key_facts<'a>(
        &'a self,
        source: &'a FrameId,
        frame: &'a SourceFrame,
        condition: &Condition,
    ) -> Result<ImageKeyFacts<'a>> {
        let degradation = frame.degradation(condition)?.map(|how| self.degradation_facts(source, frame, &how));
        let enhancer = condition.enhancer.as_ref().map(|name| self.enhancer_facts(name, frame, condition));
        Ok(ImageKeyFacts {
            picture: frame.picture_digest(condition)?,
            degradation: degradation.transpose()?,
            enhancer: enhancer.transpose()?.flatten(),
            format: self.format.to_string(),
            scaling: self.scaling,
            scaled_before: (self.degraded_at == DegradeStage::Resized).then_some(true),
        })
    }

    /// The facts about an enhancer that decide its image of a frame; `None` if the recipe does not have the enhancer.
    fn enhancer_facts(
        &self,
        name: &EnhancerName,
        frame: &SourceFrame,
        condition: &Condition,
    ) -> Result<Option<EnhancerFacts>> {
        if let Some(images) = self.enhanced_images(name) {
            return Ok(Some(EnhancerFacts { digest: images.image_digest(&frame.id, condition)?, version: None }));
        }
        let model = self.enhancers.iter().find(|(known, _)| known == name);
        Ok(model.map(|(_, digest)| EnhancerFacts { digest: *digest, version: Some(darkqa_enhance::VERSION) }))
    }
}

impl Recipe {
    /// Checks that motion blur fits into each frame, and that the folders of enhanced images are complete.
    ///
    /// # Errors
    /// If a frame would move too far during its exposure, or images of a folder cannot be used.
    pub fn check(&self, sources: &[Source], conditions: &[Condition]) -> Result<()> {
        for source in sources {
            for frame in &source.frames {
                let how = conditions
                    .iter()
                    .filter(|condition| frame.can_show(condition))
                    .map(|condition| frame.degradation(condition))
                    .collect::<Result<BTreeSet<Option<Degradation>>>>()?;
                for how in how.iter().flatten().filter(|how| how.kind().has_motion()) {
                    self.apply(&source.name, frame, how)?;
                }
            }
        }
        for images in &self.enhanced_images {
            images.check(&self.dark_images(images.name(), sources, conditions)?)?;
        }
        Ok(())
    }

    /// The input images of the enhancer of this name, as `synthesize` would write them.
    fn dark_images<'a>(
        &self,
        name: &EnhancerName,
        sources: &'a [Source],
        conditions: &'a [Condition],
    ) -> Result<Vec<DarkImage<'a>>> {
        let mut images = Vec::new();
        for source in sources {
            for frame in &source.frames {
                let enhanced = conditions
                    .iter()
                    .filter(|condition| condition.enhancer.as_ref() == Some(name) && frame.can_show(condition));
                for condition in enhanced {
                    let how = frame.degradation(condition)?;
                    let applied = how.as_ref().map(|how| self.apply(&source.name, frame, how)).transpose()?;
                    let draw = how.as_ref().map_or(0, Degradation::draw);
                    let key = self.noise_key(&source.name, &frame.id, draw);
                    images.push(DarkImage {
                        frame,
                        condition,
                        recipe: ImageRecipe::new(
                            &frame.id,
                            frame.digest,
                            frame.note.clone(),
                            how.as_ref(),
                            applied.as_ref(),
                            &key,
                            self.seed(draw),
                        ),
                    });
                }
            }
        }
        Ok(images)
    }

    fn apply(&self, source: &FrameId, frame: &SourceFrame, how: &Degradation) -> Result<AppliedDegradation> {
        let key = self.noise_key(source, &frame.id, how.draw());
        let view = self.view(frame.size, frame.focal);
        self.kinds.apply(how, view, &key).map_err(|e| Error::data(format_args!("{} at {how}", frame.id), e))
    }

    fn degradation_facts<'a>(
        &'a self,
        source: &'a FrameId,
        frame: &'a SourceFrame,
        how: &Degradation,
    ) -> Result<DegradationFacts<'a>> {
        let kind = how.kind();
        let applied = self.apply(source, frame, how)?;
        let is_random = kind.has_noise();
        let shares_camera = is_random && self.camera_scope == CameraScope::Episode;
        Ok(DegradationFacts {
            kind,
            severity: how.severity(),
            version: darkqa_light::version(kind),
            reading: applied.synthesis().cloned(),
            seed: is_random.then(|| self.seed(how.draw())),
            frame: is_random.then_some(&frame.id),
            camera_of: shares_camera.then_some(source),
            exposure: applied.exposure(),
        })
    }

    /// Width and focal length of a frame of this width and height, in pixels of the size in which it is degraded.
    /// `focal` is in pixels of the frame.
    pub fn view(&self, size: (u32, u32), focal: Option<f64>) -> FrameView {
        let native_width = size.0 as usize;
        let width = match self.degraded_at {
            DegradeStage::Native => native_width,
            DegradeStage::Resized => self.scaling.size(size.0, size.1).0,
        };
        let scale = width as f64 / native_width as f64;
        FrameView { width, focal: focal.map(|focal| focal * scale) }
    }
}

/// The facts that decide an image, as they enter its digest.
#[derive(Serialize)]
pub struct ImageKeyFacts<'a> {
    picture: Digest,
    degradation: Option<DegradationFacts<'a>>,
    enhancer: Option<EnhancerFacts>,
    format: String,
    scaling: Scaling,
    /// `Some(true)` if the frame is scaled before it is degraded; else `None`.
    scaled_before: Option<bool>,
}

/// The facts that decide a degraded frame, except its content. Seed and frame are `None` if the kind is not random.
#[derive(Serialize)]
struct DegradationFacts<'a> {
    kind: Kind,
    severity: Severity,
    version: u32,
    reading: Option<Synthesis>,
    seed: Option<u64>,
    frame: Option<&'a FrameId>,
    /// Source whose frames share one camera state; `None` if each frame has its own.
    camera_of: Option<&'a FrameId>,
    /// The camera's exposure of this frame, which decides the motion blur.
    exposure: Option<ExposureFacts>,
}

#[derive(Serialize)]
struct EnhancerFacts {
    /// Digest of the model with its sidecar; for images enhanced by other programs, the digest of the image.
    digest: Digest,
    /// `None` for images enhanced by other programs.
    #[serde(skip_serializing_if = "Option::is_none")]
    version: Option<u32>,
}

/// Program, machine and enhancer settings that decide the bytes of an image besides its recipe. The number of threads
/// is not included: six models (Zero-DCE, RUAS, SCI, Retinexformer, DarkIR, `lift`) gave the same bytes with 1, 2 and 3
/// threads, and a graph that may give others runs on one.
#[derive(Debug, Serialize)]
pub struct Maker {
    /// Version of this program, because encoders may change with it.
    program: &'static str,
    /// Processor and operating system, because results of ONNX Runtime may depend on them.
    machine: [&'static str; 2],
    /// Name and version of ONNX Runtime; `None` if no enhancer is open.
    runtime: Option<(String, String)>,
    tile: String,
    max_side: Option<usize>,
    resize: bool,
}

impl Maker {
    /// This program, with this version of ONNX Runtime and these sizes of enhanced images.
    pub fn new(runtime: Option<(String, String)>, sizes: &SizeArgs) -> Self {
        Self {
            program: env!("CARGO_PKG_VERSION"),
            machine: [std::env::consts::ARCH, std::env::consts::OS],
            runtime,
            tile: sizes.tile.to_string(),
            max_side: sizes.llie_max_side.map(std::num::NonZeroUsize::get),
            resize: sizes.llie_resize,
        }
    }

    /// Version of this program.
    pub fn program(&self) -> &'static str {
        self.program
    }
}
