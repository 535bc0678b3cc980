//! Figures: a [`chart`] has a figure's data, [`paper`] draws it as SVG and PDF, and [`sheet`] arranges given images as
//! one image.

pub(crate) mod chart;
pub(crate) mod figures;
pub(crate) mod paper;
pub(crate) mod samples;
pub(crate) mod sheet;
pub(crate) mod views;
