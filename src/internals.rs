//! Internal items that the tests and benchmarks of this crate use. They may change with any version.

pub mod ask {
    pub use crate::ask::{
        Access, AskError, BaseUrl, Call, Constrain, Endpoint, ExtraFields, ImageDetail, Message, Model, Parameters,
        Prompts, Query, Quota, Random, Reach, Remote, Script, Secret, Sending, SettingsOrigin, Temperature, Thinking,
        TokenField, WireSetting,
    };
}

pub mod dataset {
    pub use crate::data::maps::Picture;
    pub use crate::data::{DataSource, Dataset, SetArgs, open_frames};
}

pub mod report {
    pub use crate::report::content::Report;
    pub use crate::report::outputs::products;
    pub use crate::report::page::PageInputs;
}
