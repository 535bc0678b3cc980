//! Models: files of models, the built-in models, and models that see no image.

mod image_ignored;
mod models_changed;
mod models_file;
mod models_listing;
mod models_trust;
mod models_wires;
mod observer;
mod room_net;
