//! Vendors that host models: the built-in table and the user's own.

mod vendor;
mod vendor_batch;
mod vendor_table;

pub(super) use vendor::Vendor;
pub(super) use vendor_batch::{BatchForm, VendorBatch};
pub(super) use vendor_table::VendorTable;
