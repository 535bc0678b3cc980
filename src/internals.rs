//! Internal items that the tests and benchmarks of this crate use. They may change with any version.

pub mod ask {
    pub use darkqa_ask::{
        Access, AskError, BaseUrl, Call, Constrain, Endpoint, ExtraFields, ImageDetail, Message, Model, Parameters,
        Prompts, Query, Quota, Random, Reach, Remote, Script, Secret, Sending, SettingsOrigin, Temperature, Thinking,
        TokenField, WireSetting,
    };
}

pub mod dataset {
    pub use darkqa_data::maps::Picture;
    pub use darkqa_data::{DataSource, Dataset, SetArgs, open_frames};
}

pub mod report {
    pub use darkqa_report::content::Report;
    pub use darkqa_report::outputs::products;
    pub use darkqa_report::page::PageInputs;
}
