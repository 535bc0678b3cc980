//! darkqa-eval
//!
//! # Who may import whom
//!
//! | module | may use |
//! |---|---|
//! | `error` | nothing |
//! | `types` | `error` |
//! | `score` | `types`, `error` |
//! | `main` | nothing |

pub mod error;
pub mod score;
pub mod types;
