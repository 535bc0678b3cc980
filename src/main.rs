//! The command line of darkqa-eval.

fn main() {}
