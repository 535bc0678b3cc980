//! Deployments: containers, clusters, Slurm and shared machines.

mod cluster;
mod container;
#[cfg(unix)]
mod shared_machines;
mod slurm;
