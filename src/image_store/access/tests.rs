use std::fs::File;

use super::*;
use crate::image_store::{Content, EntryFacts, Shown};

fn key(name: &str) -> Key {
    Key::from_recipe(&[name]).unwrap()
}

fn entry(bytes: usize) -> Entry {
    Entry {
        image: vec![7; bytes],
        size: [4, 3],
        facts: EntryFacts::new(Shown::default(), 30, serde_json::Value::Null),
    }
}

fn store(folder: &Path, most: u64) -> ImageStore {
    ImageStore::open(folder, FolderAccess::Private, StoredKinds::Enhanced, most).unwrap()
}

fn image(store: &ImageStore, name: &str) -> Option<Vec<u8>> {
    store
        .get(&key(name), Content::Image, |_| true)
        .map(|entry| entry.image)
}

#[test]
fn two_stores_of_one_folder_share_their_images() {
    let place = tempfile::tempdir().unwrap();
    let [one, other] = [0, 1].map(|_| store(place.path(), 1 << 20));
    assert_eq!(image(&one, "a"), None);
    one.put(&key("a"), &entry(9));
    assert_eq!(image(&other, "a"), Some(vec![7; 9]));
    assert_eq!(other.get(&key("a"), Content::Image, |_| false), None);
    let counts = other.counts();
    assert_eq!((counts.hits, counts.misses, counts.hit_bytes), (1, 1, 9));
    assert_eq!(counts.saved_ms, 30);
}

#[test]
fn a_damaged_and_an_exchanged_file_are_removed_and_counted() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    let file = |name| store.folder.place(key(name).digest());
    store.put(&key("a"), &entry(9));
    store.put(&key("b"), &entry(12));
    fs::copy(file("b"), file("a")).unwrap();
    assert_eq!(image(&store, "a"), None);
    assert!(!file("a").exists());
    assert_eq!(image(&store, "b"), Some(vec![7; 12]));
    let mut bytes = fs::read(file("b")).unwrap();
    bytes[3] ^= 1;
    fs::write(file("b"), bytes).unwrap();
    assert_eq!(image(&store, "b"), None);
    assert_eq!(store.counts().damaged, 2);
    store.put(&key("b"), &entry(12));
    assert_eq!(image(&store, "b"), Some(vec![7; 12]));
}

#[test]
fn a_full_store_takes_no_more_until_something_was_long_unused() {
    let place = tempfile::tempdir().unwrap();
    let room = 1000;
    let full = store(place.path(), room);
    for name in ["a", "b", "c", "d", "e", "f", "g", "h"] {
        full.put(&key(name), &entry(200));
    }
    let counts = full.counts();
    assert!(counts.written >= 1 && counts.left_out >= 4, "{counts:?}");
    assert_eq!(counts.written + counts.left_out, 8);
    let bytes = |store: &ImageStore| -> u64 {
        let files = store.folder.files().unwrap();
        files.iter().map(|file| file.bytes).sum()
    };
    assert!(bytes(&full) <= room, "{}", bytes(&full));
    for file in full.folder.files().unwrap() {
        let old = SystemTime::now() - Duration::from_hours(24 * 15);
        let file = File::options().write(true).open(file.path).unwrap();
        file.set_modified(old).unwrap();
    }
    full.put(&key("h"), &entry(200));
    assert_eq!(image(&full, "h"), Some(vec![7; 200]));
    assert!(full.counts().evicted > 0 && bytes(&full) <= room);
}

#[test]
fn a_folder_that_is_deleted_meanwhile_is_made_again() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("store");
    let store = store(&folder, 1 << 20);
    store.put(&key("a"), &entry(9));
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(image(&store, "a"), None);
    store.put(&key("a"), &entry(9));
    assert_eq!(image(&store, "a"), Some(vec![7; 9]));
}

#[test]
fn a_store_that_cannot_be_written_to_is_left_alone() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    let root = store.folder.root().to_owned();
    fs::remove_dir_all(&root).unwrap();
    fs::write(&root, "a file in the place of the folder").unwrap();
    store.put(&key("a"), &entry(9));
    assert_eq!(store.with(|state| state.health), Health::ReadOnly);
    assert_eq!(image(&store, "a"), None);
    assert_eq!(store.with(|state| state.health), Health::Gone);
    assert_eq!(store.counts().written, 0);
}

#[cfg(unix)]
#[test]
fn only_the_user_can_enter_the_folder() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = tempfile::tempdir().unwrap();
    let store = store(&place.path().join("store"), 1 << 20);
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(store.folder.root()), 0o700);
    // Also where it was deleted meanwhile.
    fs::remove_dir_all(place.path().join("store")).unwrap();
    store.put(&key("a"), &entry(9));
    assert_eq!(mode(store.folder.root()), 0o700);
    assert_eq!(
        mode(store.folder.place(key("a").digest()).parent().unwrap()),
        0o700
    );
}

#[test]
fn facts_alone_are_kept_beside_images_and_not_counted_as_images() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    let shown = Shown {
        content: Content::Probe,
        ..Shown::default()
    };
    let facts = EntryFacts::new(shown, 500, serde_json::json!("found"));
    assert!(!store.contains(&key("a")));
    store.put(&key("a"), &Entry::from_facts(facts));
    assert!(store.contains(&key("a")));
    let read = store.get(&key("a"), Content::Probe, |_| true).unwrap();
    assert_eq!(read.facts.notes, serde_json::json!("found"));
    assert_eq!(store.get(&key("b"), Content::Measures, |_| true), None);
    let counts = store.counts();
    assert_eq!((counts.hits, counts.misses, counts.written), (0, 0, 0));
    assert_eq!((counts.facts, counts.saved_ms), (1, 500));
}
