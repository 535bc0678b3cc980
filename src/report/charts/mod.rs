//! Figures: a [`chart`] has a figure's data, [`paper`] draws it as SVG and PDF, and [`sheet`] arranges given images as
//! one image.

pub mod chart;
pub mod figures;
pub mod paper;
pub mod samples;
pub mod sheet;
pub mod views;
