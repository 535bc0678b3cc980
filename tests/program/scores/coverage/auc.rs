//! The area under the ROC curve of fidelity, pooled over conditions that ask the same questions about the same scenes.

use super::*;
use crate::support::made::record;
use darkqa_base::types::{Condition, Digest, Family, ImageFacts, ImageFidelity, ParsedAnswer, Record};
use darkqa_score::cluster::Clusters;
use darkqa_score::cluster::FrameTies;
use darkqa_score::grid::Grid;
use darkqa_score::photographs::FidelityFindings;

/// Frames of a scene, and questions about a frame.
const FRAMES: usize = 2;
const QUESTIONS: usize = 5;

/// Effects that the replies of all conditions share.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shared {
    /// Effects of the frame and of the question, each with this standard deviation in logits.
    Effects(f64),
    /// Effects with a standard deviation of 1, and the luck of each question too: its reply changes only with the
    /// condition's mean.
    Luck,
}

impl Shared {
    fn spread(self) -> f64 {
        match self {
            Self::Effects(spread) => spread,
            Self::Luck => 1.0,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct AucDesign {
    conditions: usize,
    scenes: usize,
    shared: Shared,
    /// Effect of one standard deviation of PSNR on the logit of a right reply.
    slope: f64,
}

impl AucDesign {
    /// Conditions: five levels, each with noise, by exposure drop alone, and enhanced.
    fn names(&self) -> Vec<Condition> {
        let names = ["L{}-noise", "L{}-ev", "L{}-noise+e"]
            .into_iter()
            .flat_map(|variant| (1..=5).map(move |level| (variant, level)));
        let names = names.map(|(variant, level)| variant.replace("{}", &f64::to_string(&level.into())));
        let names = names.map(|name| name.parse().unwrap());
        names.take(self.conditions).collect()
    }

    /// The mean logit of each condition: from 1.5 to −0.5.
    fn means(&self) -> Vec<f64> {
        let last = self.conditions as f64 - 1.0;
        let mean = |condition: usize| 1.5 - 2.0 * condition as f64 / last;
        match self.conditions {
            1 => vec![0.5],
            conditions => (0..conditions).map(mean).collect(),
        }
    }

    fn seed(&self) -> u64 {
        let shared = match self.shared {
            Shared::Effects(spread) => (10.0 * spread) as u64,
            Shared::Luck => 99,
        };
        (self.conditions as u64) << 40 | (self.scenes as u64) << 30 | shared << 20 | (100.0 * self.slope) as u64
    }

    /// The true AUC, of pairs from different scenes: each condition's, weighted by its pairs. From a million replies.
    fn truth(&self) -> f64 {
        const REPLIES: usize = 1_000_000;
        if self.slope == 0.0 {
            return 0.5;
        }
        let mut random = StdRng::seed_from_u64(self.seed());
        // The effects of frame and question together.
        let spread = self.shared.spread() * 2_f64.sqrt();
        let draw = |_| {
            let [number, effect]: [f64; 2] = [(); 2].map(|()| StandardNormal.sample(&mut random));
            (number, self.slope * number + spread * effect)
        };
        let mut replies: Vec<(f64, f64)> = (0..REPLIES).map(draw).collect();
        replies.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut concordant, mut pairs) = (0.0, 0.0);
        for mean in self.means() {
            let (mut right, mut wrong) = (0.0, 0.0);
            for (_, logit) in &replies {
                let p = logistic(mean + logit);
                concordant += p * wrong;
                right += p;
                wrong += 1.0 - p;
            }
            pairs += right * wrong;
        }
        concordant / pairs
    }
}

fn logistic(logit: f64) -> f64 {
    1.0 / (1.0 + (-logit).exp())
}

/// Replies and the fidelity of their images, made once for a design and drawn anew for each run.
struct MadeRun {
    design: AucDesign,
    /// One condition after another, with the same questions in each.
    records: Vec<Record>,
    /// One condition after another, with the same frames in each.
    measured: Vec<ImageFidelity>,
    clusters: Clusters,
}

impl MadeRun {
    fn new(design: AucDesign) -> Self {
        let families = [Family::Color, Family::Presence, Family::RoomType];
        let (mut records, mut measured) = (Vec::new(), Vec::new());
        for condition in design.names() {
            for frame in 0..design.scenes * FRAMES {
                let image = Digest::from_bytes(format!("{condition} {frame}").as_bytes());
                for question in frame * QUESTIONS..(frame + 1) * QUESTIONS {
                    let mut reply = record("m", &condition, (question, frame), true);
                    reply.detail.family = families[question % families.len()].clone();
                    reply.detail.image = Some(ImageFacts {
                        digest: image,
                        bytes: 1,
                        width: 1,
                        height: 1,
                        format: "png".to_owned(),
                        orientation: None,
                        exposure: None,
                        pair: None,
                    });
                    records.push(reply);
                }
                measured.push(ImageFidelity {
                    frame: records[records.len() - 1].detail.frame.clone().into(),
                    condition: condition.clone().into(),
                    image,
                    psnr: None,
                    ssim: None,
                });
            }
        }
        let scenes = measured.iter().enumerate().map(|(index, image)| {
            let scene = index / FRAMES % design.scenes;
            ((*image.frame).clone(), format!("s{scene:03}"))
        });
        let ties = FrameTies { scenes: scenes.collect(), ..FrameTies::default() };
        let asked = records.iter().map(|record| (&record.question, &record.detail.frame));
        let clusters = Clusters::new(asked, &ties);
        assert_eq!(clusters.count(), design.scenes);
        Self { design, records, measured, clusters }
    }

    /// Draws all numbers and replies anew. The rank of a frame's PSNR is nearly the same in each condition; half of its
    /// variance is of the scene.
    fn draw(&mut self, random: &mut StdRng) {
        let AucDesign { scenes, shared, .. } = self.design;
        let (frames, questions) = (scenes * FRAMES, scenes * FRAMES * QUESTIONS);
        let mut normals = |n: usize| -> Vec<f64> { (0..n).map(|_| StandardNormal.sample(random)).collect() };
        let of_scene = normals(scenes);
        let psnr: Vec<f64> = normals(frames)
            .iter()
            .enumerate()
            .map(|(frame, own)| (own + of_scene[frame / FRAMES]) / 2_f64.sqrt())
            .collect();
        let (of_frame, of_question) = (normals(frames), normals(questions));
        let jitter = normals(self.measured.len());
        for (index, (image, jitter)) in self.measured.iter_mut().zip(jitter).enumerate() {
            let drop = (index / frames) as f64;
            image.psnr = Some(30.0 - drop + 4.0 * psnr[index % frames] + 0.1 * jitter);
        }
        let means = self.design.means();
        let luck: Vec<f64> = (0..questions).map(|_| random.random()).collect();
        for (index, record) in self.records.iter_mut().enumerate() {
            let question = index % questions;
            let frame = question / QUESTIONS;
            let effects = shared.spread() * (of_frame[frame] + of_question[question]);
            let logit = means[index / questions] + effects + self.design.slope * psnr[frame];
            let luck = match shared {
                Shared::Luck => luck[question],
                Shared::Effects(_) => random.random(),
            };
            let chosen = Some(usize::from(luck >= logistic(logit)));
            record.detail.strict = Some(ParsedAnswer { chosen, why: None });
        }
    }
}

/// Of the runs that have an AUC, in percent: those whose interval holds the truth, and those with p < 0.05.
#[derive(Debug)]
struct AucRates {
    truth: f64,
    held: f64,
    rejected: f64,
    mean: f64,
}

fn auc_rates(design: AucDesign, runs: usize) -> AucRates {
    let mut random = StdRng::seed_from_u64(design.seed());
    let (mut run, truth) = (MadeRun::new(design), design.truth());
    let (mut made, mut held, mut rejected, mut sum) = (0, 0, 0, 0.0);
    for _ in 0..runs {
        run.draw(&mut random);
        let trials = run.records.iter().cloned().collect();
        let grid = Grid::new(&trials, &run.clusters);
        let found = FidelityFindings::new(&grid, &run.measured).unwrap();
        assert_eq!(found.conditions.len(), design.conditions);
        let Some(auc) = found.within[0] else { continue };
        made += 1;
        held += usize::from(holds(auc.estimate, truth));
        rejected += usize::from(auc.p < 0.05);
        sum += auc.estimate.value;
    }
    assert!(2 * made > runs, "{design:?}: {made}");
    let percent = 100.0 / made as f64;
    AucRates { truth, held: percent * held as f64, rejected: percent * rejected as f64, mean: sum / made as f64 }
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
fn auc_coverage_over_conditions() {
    let shared = [0.0, 0.5, 1.0].map(Shared::Effects);
    let shared: Vec<Shared> = shared.into_iter().chain([Shared::Luck]).collect();
    let mut designs = Vec::new();
    for slope in [0.0, 0.3, 0.6] {
        for conditions in [1, 5, 15] {
            for scenes in [8, 24, 52] {
                designs.extend(shared.iter().map(|shared| AucDesign { conditions, scenes, shared: *shared, slope }));
            }
        }
    }
    let rates: Vec<AucRates> = designs.par_iter().map(|design| auc_rates(*design, 1000)).collect();
    println!(
        "\n| slope | conditions | scenes | shared | true AUC | mean AUC | interval holds the truth | p < 0.05 |\n|---|---|---|---|---|---|---|---|"
    );
    for (design, rates) in designs.iter().zip(rates) {
        println!(
            "| {} | {} | {} | {:?} | {:.3} | {:.3} | {:.1} | {:.1} |",
            design.slope,
            design.conditions,
            design.scenes,
            design.shared,
            rates.truth,
            rates.mean,
            rates.held,
            rates.rejected
        );
    }
}

#[test]
fn repeated_scenes_add_no_evidence() {
    let rates = auc_rates(AucDesign { conditions: 15, scenes: 24, shared: Shared::Effects(1.0), slope: 0.0 }, 150);
    // Replies of different conditions taken as independent would reject in every other run.
    assert!(rates.rejected < 9.0 && rates.held > 91.0, "{rates:?}");
}
