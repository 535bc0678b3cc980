//! Figures: a [`chart`] is what a figure shows, [`paper`] draws it as SVG and PDF, and [`sheet`] arranges images that are handed in.

pub(crate) mod chart;
pub(crate) mod figures;
pub(crate) mod paper;
pub(crate) mod samples;
pub(crate) mod sheet;
pub(crate) mod views;
