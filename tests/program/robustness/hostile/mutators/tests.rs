//! The mutators themselves.

use std::path::Path;

use super::{Form, step};
use crate::support::frames::png;
use crate::support::onnx;

#[test]
fn mutation_step_is_deterministic() {
    let files = [
        ("a.png", png(20)),
        ("a.onnx", onnx::gain(0.5).model()),
        ("a.jsonl", b"{\"a\":[1,2,{\"b\":\"c\"}]}\n{\"a\":null}\n".to_vec()),
        ("a.toml", b"[a]\nb = 17\nc = \"d\"\n".to_vec()),
        ("a.jpg", vec![7; 300]),
        ("a.parquet", [&b"PAR1"[..], &[9; 60], &[40, 0, 0, 0], b"PAR1"].concat()),
    ];
    for (name, file) in files {
        let form = Form::of(Path::new(name));
        let mut changed = 0;
        for seed in 0..400 {
            let (mut one, mut other) = (file.clone(), file.clone());
            step(form, &mut one, seed);
            step(form, &mut other, seed);
            assert!(one == other, "{name}, {seed}");
            changed += usize::from(one != file);
        }
        assert!(changed > 340, "{name}: {changed}");
    }
}

#[test]
fn model_message_round_trips() {
    let model = onnx::external_gain("x.bin").model();
    let mut all_lie = model.clone();
    // Most steps keep the lengths true, so that the damage is reached.
    let still_read = (0..100).filter(|seed| {
        all_lie.clone_from(&model);
        super::protobuf::mutate(&mut all_lie, &mut crate::robustness::hostile::random::Random::new(*seed))
    });
    assert_eq!(still_read.count(), 100);
}
