//! Dark photographs, and the fidelity of images.

mod fidelity;
pub mod pair_darkness;
mod photographed_set;
pub mod realism;

pub use fidelity::{ConditionFidelity, FidelityFindings, Prediction};
pub use photographed_set::PhotographedSet;

/// Scalar product.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
