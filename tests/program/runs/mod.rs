//! Runs: evaluations and OpenEQA, their identity, plans and parts.

mod evaluate;
mod golden;
mod identity;
mod openeqa;
mod parts_of_commands;
mod pins;
mod plan;
mod png_form;
mod remedies;
mod shards;
#[cfg(unix)]
mod slurm_jobs;
mod walks;
mod walks_in_parts;
