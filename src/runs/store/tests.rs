use super::*;
use std::collections::BTreeMap;
use std::fs;

use darkqa_base::types::manifests::{Counts, PngForm, Status};
use darkqa_base::types::{Digest, Family, FrameId, QuestionId, StoredDetail as _, TrialOutcome};

type Store = super::Store;

fn manifest(seed: u64) -> RunManifest {
    RunManifest {
        schema: ChoiceDetail::SCHEMA.into(),
        status: Status::Started,
        version: "0".into(),
        created: String::new(),
        updated: String::new(),
        platform: BTreeMap::new(),
        identity: BTreeMap::from([("--seed".to_owned(), seed.into())]),
        settings: BTreeMap::new(),
        images: BTreeMap::new(),
        columns: BTreeMap::new(),
        models: Vec::new(),
        enhancers: BTreeMap::new(),
        inputs: None,
        shard: None,
        part: None,
        png: PngForm::NEWEST,
        reply_reading: None,
        counts: Counts::default(),
    }
}

fn record(name: &str, outcome: TrialOutcome) -> Record {
    let detail = ChoiceDetail {
        frame: FrameId("f".into()),
        family: Family::Color,
        choices: vec!["a".into(), "b".into()],
        truth: Some(0),
        repeat: 0,
        wording: None,
        order: 0,
        strict: None,
        lenient: None,
        outcome,
        image: None,
        more_images: Vec::new(),
        shown_frame: None,
        observed: None,
        options: None,
    };
    let key = Digest::from_bytes(name.as_bytes()).into();
    Record {
        reply: Some("A\u{2028}\n".into()),
        attempts: 1,
        ..Record::blank(key, QuestionId(name.into()), "m", None, detail)
    }
}

#[test]
fn runs_with_another_schema_are_refused() {
    let base = tempfile::tempdir().unwrap();
    for (schema, expected) in [
        ("darkqa.run/1", "made by an earlier version of darkqa-eval (0"),
        ("darkqa.openeqa/1", "run it again"),
        ("darkqa.openeqa/2", "\"darkqa.run/2\" is expected here"),
        ("darkqa.run/9", "is not known to this version"),
        ("something", "is not known to this version"),
    ] {
        let manifest = RunManifest { schema: schema.into(), ..manifest(0) };
        write_manifest(base.path(), &manifest).unwrap();
        let error = read_manifest(base.path(), ChoiceDetail::SCHEMA).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn only_the_last_record_of_each_trial_is_read() {
    let base = tempfile::tempdir().unwrap();
    let folder = base.path().join("run");
    let mut store = Store::open(&folder, &manifest(0), AddressChange::Refused).unwrap();
    assert!(store.records().unwrap().is_empty());
    for (name, outcome) in [("a", TrialOutcome::Failed), ("b", TrialOutcome::Right), ("a", TrialOutcome::Wrong)] {
        store.append(&record(name, outcome)).unwrap();
    }
    drop(store);
    let records = Store::open(&folder, &manifest(0), AddressChange::Refused).unwrap().records().unwrap();
    assert_eq!(records, [record("a", TrialOutcome::Wrong), record("b", TrialOutcome::Right)]);
}

#[test]
fn damaged_lines_are_removed_or_set_aside() {
    let base = tempfile::tempdir().unwrap();
    let mut store = Store::open(base.path(), &manifest(0), AddressChange::Refused).unwrap();
    store.append(&record("a", TrialOutcome::Right)).unwrap();
    store.records.write_all(b"{\"key\":\"12").unwrap();
    drop(store);
    let mut store = Store::open(base.path(), &manifest(0), AddressChange::Refused).unwrap();
    assert_eq!(store.records().unwrap().len(), 1);
    store.append(&record("b", TrialOutcome::Right)).unwrap();
    drop(store);
    let records = Store::open(base.path(), &manifest(0), AddressChange::Refused).unwrap().records();
    assert_eq!(records.unwrap().len(), 2);
    let path = base.path().join(RECORDS);
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("{\"key\"", "{\"kex\"", 1)).unwrap();
    // A reader gets an error.
    let error = read_records::<ChoiceDetail>(base.path()).unwrap_err().to_string();
    assert!(error.contains("records.jsonl, line 1: not a record"), "{error}");
    // The run continues without the line, which is moved to another file and blanked.
    let mut store = reopen(base.path()).unwrap();
    assert_eq!(store.records().unwrap().len(), 1);
    let aside = fs::read_to_string(base.path().join(SET_ASIDE)).unwrap();
    assert!(aside.starts_with("{\"kex\"") && aside.lines().count() == 1, "{aside}");
    store.append(&record("a", TrialOutcome::Right)).unwrap();
    drop(store);
    assert_eq!(reopen(base.path()).unwrap().records().unwrap().len(), 2);
    assert_eq!(fs::read_to_string(base.path().join(SET_ASIDE)).unwrap(), aside);
    assert_eq!(read_records::<ChoiceDetail>(base.path()).unwrap().len(), 2);
    // A file without any record is another file, not a damaged run.
    fs::write(&path, "{}\n[]\n").unwrap();
    let error = reopen(base.path()).unwrap_err().to_string();
    assert!(error.contains("records.jsonl, line 1: not a record"), "{error}");
}

fn reopen(folder: &Path) -> Result<Store> {
    Store::open(folder, &manifest(0), AddressChange::Refused)
}

#[test]
fn other_runs_are_refused_by_the_differing_flag() {
    let base = tempfile::tempdir().unwrap();
    drop(Store::open(base.path(), &manifest(0), AddressChange::Refused).unwrap());
    let error = Store::open(base.path(), &manifest(7), AddressChange::Refused).unwrap_err().to_string();
    assert!(error.contains("another --seed: it was 0, now it is 7"), "{error}");
}

#[test]
fn locked_runs_and_folders_with_files_are_refused() {
    let base = tempfile::tempdir().unwrap();
    let _lock = Store::open(base.path(), &manifest(0), AddressChange::Refused).unwrap();
    assert!(
        Store::open(base.path(), &manifest(0), AddressChange::Refused)
            .unwrap_err()
            .to_string()
            .contains("another process")
    );
    let other = tempfile::tempdir().unwrap();
    fs::write(other.path().join("thesis.tex"), "").unwrap();
    assert!(
        Store::open(other.path(), &manifest(0), AddressChange::Refused).unwrap_err().to_string().contains("not empty")
    );
}

#[test]
fn address_changes_need_permission() {
    let base = tempfile::tempdir().unwrap();
    drop(Store::open(base.path(), &at("typo"), AddressChange::Refused).unwrap());
    // Without a reply, the address may change.
    let mut store = Store::open(base.path(), &at("here"), AddressChange::Refused).unwrap();
    store.append(&record("a", TrialOutcome::Right)).unwrap();
    drop(store);
    assert!(Store::open(base.path(), &at("there"), AddressChange::Allowed).is_ok());
    let error = Store::open(base.path(), &at("there"), AddressChange::Refused).unwrap_err();
    assert!(error.to_string().contains("--resume"), "{error}");
}

/// The manifest of a run with a model at this address.
fn at(address: &str) -> RunManifest {
    let mut manifest = manifest(0);
    let model = [("m".to_owned(), serde_json::json!({ "--base-url": address }))];
    manifest.columns.insert("model".to_owned(), model.into());
    manifest
}

#[test]
fn unfinished_files_are_ignored() {
    let base = tempfile::tempdir().unwrap();
    fs::write(base.path().join(".manifest.json.part"), "{").unwrap();
    assert!(Store::open(base.path(), &manifest(0), AddressChange::Refused).is_ok());
}

#[test]
fn runs_are_found_by_their_hash() {
    let base = tempfile::tempdir().unwrap();
    for name in ["20260101-m-d-0123abcd", "20260102-m-d-0123abcd", "20260103-m-d-99999999"] {
        drop(Store::open(&base.path().join(name), &manifest(0), AddressChange::Refused).unwrap());
    }
    fs::create_dir(base.path().join("20260104-m-d-0123abcd")).unwrap();
    let found = find(base.path(), "0123abcd").unwrap();
    assert!(found.ends_with("20260102-m-d-0123abcd"));
    assert_eq!(find(base.path(), "abcdabcd"), None);
}
