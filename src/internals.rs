//! Internal items that the tests and benchmarks of this crate use. They may change with any version.

pub mod ask {
    pub use crate::ask::{
        Access, AskError, BaseUrl, Call, Constrain, Endpoint, ExtraFields, ImageDetail, Message,
        Model, Parameters, Prompts, Query, Quota, Random, Reach, Remote, Script, Secret, Sending,
        Temperature, Thinking, TokenField, WireSetting,
    };
}

pub mod dataset {
    pub use crate::dataset::picture::Picture;
    pub use crate::dataset::{DataPlace, Dataset, SetArgs};
}

pub mod labels {
    pub use crate::labels::space;
}

pub mod picture {
    pub use crate::picture::reading_rule::{ColourRule, MOST_PIXELS, Transfer};
    pub use crate::picture::{
        ImageFile, Payload, PayloadFormat, ReadingRule, Scaling, bilinear, fit, png,
    };
}

pub mod questions {
    pub use crate::questions::balance::BalanceMode;
    pub use crate::questions::colors::Palette;
    pub use crate::questions::observer::controls::spoiled;
    pub use crate::questions::observer::{Observation, ObservedFrame};
    pub use crate::questions::room::RoomSource;
    pub use crate::questions::rule_context::RuleResult;
    pub use crate::questions::rules::{ClassFlag, Rules};
    pub use crate::questions::statistics::measure;
    pub use crate::types::Control;
}

pub mod report {
    pub use crate::report::choice_report::ChoiceReport;
    pub use crate::report::page::PageInputs;
    pub use crate::report::products::products;
}

pub mod rooms {
    pub use crate::rooms::{Room, RoomTruth, Rooms, ThingTruth, VERSION, labels};
}

pub mod score {
    pub use crate::score::agreement::{AgreementCounts, clustered_kappa};
    pub use crate::score::bootstrap::Resamples;
    pub use crate::score::calibration::{Calibration, calibrations};
    pub use crate::score::chance::OfferedChoices;
    pub use crate::score::cluster::{Clusters, FrameTies};
    pub use crate::score::curve::curves;
    pub use crate::score::estimate::ClusterCount;
    pub use crate::score::estimate::Estimate;
    pub use crate::score::fidelity::FidelityFindings;
    pub use crate::score::findings::Findings;
    pub use crate::score::grid::Grid;
    pub use crate::score::open::{
        AnswerOutcome, Baseline, Group, OpenSummary, QuestionGroups, ScoredAnswer, open_summary,
    };
    pub use crate::score::paired::{PairedComparison, difference};
    pub use crate::score::pooled::{PooledFinding, pooled};
    pub use crate::score::pooled_kind::PooledKind;
    pub use crate::score::realism::psnr;
    pub use crate::score::realism::ssim::ssim;
    pub use crate::score::significance::Significance;
    pub use crate::score::subject::Subject;
    pub use crate::score::threshold::{LevelCounts, NoThreshold};
}

pub mod synthesis {
    pub use crate::synthesis::bayer::Bayer;
    pub use crate::synthesis::blur::{blur, blurred_codes};
    pub use crate::synthesis::exposure::{expose, expose_into};
    pub use crate::synthesis::negative::{Negative, ladder};
    pub use crate::synthesis::noise::{Term, add as add_noise};
    pub use crate::synthesis::unprocess::unprocess;
}
