//! Endpoints: requests, replies, faults, replicas and costs.

mod ask;
mod early_ends;
mod faults;
mod gateways;
mod money;
mod money_simulation;
mod other_fields;
mod own_requests;
mod pauses;
mod replicas;
mod serve;
mod several_images;
mod shrunk_images;
mod stated_costs;
mod truncated;
