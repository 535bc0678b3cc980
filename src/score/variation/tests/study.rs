//! Coverage of the intervals over many simulated reports.

#![expect(clippy::print_stdout, reason = "the long tests print coverages")]

use super::simulated::{DESIGNS, Simulation};
use super::{holds, known, requests_of_half, simulated_error};
use crate::estimate::Estimate;
use crate::variation::{Components, Design, Facet, FacetedDifference, Observation, Source, facet_ranges, paired};

const REPORTS: u64 = 300;

/// Estimates of one number over all reports.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: u32,
    held: u32,
    squares: f64,
    error: f64,
    width: f64,
    /// Number of intervals that contain 0.
    zero: u32,
}

impl Tally {
    fn add(&mut self, estimate: Estimate, truth: f64) {
        self.count += 1;
        self.held += u32::from(holds(estimate, truth));
        self.squares += estimate.value.powi(2);
        self.error += estimate.value - truth;
        self.width += estimate.high - estimate.low;
        self.zero += u32::from(holds(estimate, 0.0));
    }

    fn print(&self, name: &str, truth: f64) {
        let n = f64::from(self.count);
        if self.count > 0 {
            println!(
                "  {name}: true {:.2}, root mean square {:.2}, bias {:+.2}, interval holds {:.1} %, width {:.1}, \
                 contains 0 {:.1} %",
                100.0 * truth,
                100.0 * (self.squares / n).sqrt(),
                100.0 * self.error / n,
                100.0 * f64::from(self.held) / n,
                100.0 * self.width / n,
                100.0 * f64::from(self.zero) / n,
            );
        }
    }
}

fn components(simulation: &Simulation, is_difference: bool) {
    let truth = simulation.truth(is_difference);
    let mut tallies = [Tally::default(); 10];
    let (mut ranges, mut sums) = ([Tally::default(); 3], [0.0; 3]);
    for report in 0..REPORTS {
        let ([first, second], true_ranges) = simulation.replies(report);
        let observations = if is_difference { paired(&first, &second) } else { first };
        let found = Components::new(&observations);
        for ((tally, source), truth) in tallies.iter_mut().zip(Source::ALL).zip(truth) {
            if let Some(deviation) = found.deviation(source) {
                tally.add(deviation, truth);
            }
        }
        if !is_difference {
            for (index, range) in facet_ranges(&observations).iter().enumerate() {
                ranges[index].add(range.range, true_ranges[index]);
                sums[index] += true_ranges[index] / REPORTS as f64;
            }
        }
    }
    for ((tally, source), truth) in tallies.iter().zip(Source::ALL).zip(truth) {
        tally.print(&format!("{source:?}"), truth);
    }
    for ((tally, facet), truth) in ranges.iter().zip(Facet::ALL).zip(sums) {
        tally.print(&format!("range of {facet:?}"), truth);
    }
}

/// The difference with its interval, and with that of scenes alone.
fn differences(simulation: &Simulation) {
    let truth = simulation.accuracies[0] - simulation.accuracies[1];
    let mut tallies = [Tally::default(); 2];
    for report in 0..REPORTS {
        let ([first, second], _) = simulation.replies(report);
        let pairs = paired(&first, &second);
        let under_one: Vec<Observation> =
            pairs.iter().map(|pair| Observation { wording: 0, order: 0, draw: 0, ..*pair }).collect();
        for (tally, pairs) in tallies.iter_mut().zip([pairs, under_one]) {
            tally.add(FacetedDifference::new(&pairs).unwrap().difference, truth);
        }
    }
    tallies[0].print("difference", truth);
    tallies[1].print("difference, by scenes alone", truth);
}

#[test]
#[ignore = "takes a minute; prints the coverage of components, ranges and differences"]
fn coverage_of_components_and_differences() {
    for simulation in &DESIGNS {
        println!("{}: replies", simulation.name);
        components(simulation, false);
        println!("{}: differences", simulation.name);
        components(simulation, true);
        differences(simulation);
    }
}

#[test]
#[ignore = "takes a minute; prints the coverage for few levels that differ much"]
fn coverage_of_differences_with_few_levels() {
    for (wordings, orders, draws) in [(2, 2, 2), (3, 3, 2), (5, 3, 3)] {
        for (scenes, questions) in [(8, 24), (20, 60), (60, 240)] {
            for own in [0.0, 0.003, 0.01, 0.04] {
                let base = &DESIGNS[1];
                let design = Design { scenes, questions, wordings, orders, draws, ..base.design };
                let mut simulation = Simulation { design, ..*base };
                simulation.own[2] = own;
                simulation.own[1] -= own;
                println!("{design:?}, {:.1} points between wordings", 100.0 * simulation.truth(true)[2]);
                differences(&simulation);
            }
        }
    }
}

#[test]
#[ignore = "takes a minute; prints the requests that half of the combinations need"]
fn requests_of_half_of_the_combinations() {
    for simulation in &DESIGNS {
        for is_difference in [false, true] {
            let components = known(simulation.truth(is_difference));
            for (wordings, orders, draws) in [(3, 3, 2), (3, 3, 1), (2, 2, 1), (3, 1, 1)] {
                let design = Design { wordings, orders, draws, repeats: 1, is_half: false, ..simulation.design };
                // Many questions, so that rounding does not matter.
                let many = Design { scenes: 40 * design.scenes, questions: 40 * design.questions, ..design };
                let share = requests_of_half(&components, many);
                println!(
                    "{}, difference {is_difference}, {wordings}×{orders}×{draws}: {share:.3?} of the requests",
                    simulation.name
                );
            }
        }
        for is_half in [false, true] {
            let simulation =
                Simulation { design: Design { is_half, ..simulation.design }, missing: 0.0, ..*simulation };
            let expected = known(simulation.truth(false)).spread(&simulation.design).error;
            println!(
                "half {is_half}: standard error {expected:.4}, simulated {:.4}",
                simulated_error(&simulation, REPORTS)
            );
        }
    }
}
