//! Robustness: hostile, damaged and strange input, and faults of the machine.

mod damaged_files;
mod hostile;
mod machine_faults;
mod mutations;
mod open_files;
mod signals;
mod strange_runs;
mod strange_texts;
