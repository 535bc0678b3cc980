//! Reports: their page, tables, figures and texts, and comparisons of runs.

mod apart;
mod bundle;
mod compared;
mod figures;
mod levels;
mod markdown;
mod page;
mod record_table;
mod report;
mod report_head;
mod report_of_parts;
mod sentences;
mod site;
mod spreadsheets;
