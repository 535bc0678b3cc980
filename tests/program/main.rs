//! The tests of the program and the library as a whole, a module a subject. They are one program, because each test program links the
//! library anew: `cargo test --test program report::` runs one module.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../support/mod.rs"]
mod support;

mod apart;
mod architecture;
mod ask;
mod batch;
mod batch_run;
mod bundle;
mod calibrate;
mod camera;
mod cli;
mod cluster;
mod compared;
mod confidence;
mod container;
mod coverage;
mod damaged_files;
mod documentation;
mod enhance;
mod evaluate;
mod export;
mod fair;
mod faults;
mod fidelity;
mod figures;
mod golden;
mod hm3d;
mod hostile;
mod identity;
mod image_ignored;
mod image_store;
mod import;
mod inputs;
mod levels;
mod machine_faults;
mod markdown;
mod models_changed;
mod models_file;
mod models_listing;
mod models_trust;
mod models_wires;
mod money;
mod money_simulation;
mod mutations;
mod observer;
mod open_files;
mod openeqa;
mod own_requests;
mod page;
mod parts_of_commands;
mod pauses;
mod photographs;
mod pins;
mod plan;
mod questions;
mod ready_made;
mod realism;
mod record_table;
mod replicas;
mod report;
mod report_head;
mod report_of_parts;
mod rooms;
mod same_bytes;
mod scenes;
mod sentences;
mod serve;
mod several_images;
mod shards;
#[cfg(unix)]
mod shared_machines;
mod site;
mod slurm;
mod spreadsheets;
mod statistics;
mod strange_runs;
mod strange_texts;
mod synthesize;
mod truncated;
mod unlabelled;
mod walks;
mod walks_in_parts;
