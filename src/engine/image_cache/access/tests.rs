use std::fs::File;

use super::*;
use crate::image_cache::{EntryFacts, EntryType, Shown};

fn key(name: &str) -> Key {
    Key::from_recipe(&[name]).unwrap()
}

fn entry(bytes: usize) -> Entry {
    Entry { image: vec![7; bytes], size: [4, 3], facts: EntryFacts::new(Shown::default(), 30, serde_json::Value::Null) }
}

fn store(folder: &Path, capacity: u64) -> ImageStore {
    ImageStore::open(folder, FolderAccess::Private, StoredKinds::Enhanced, capacity).unwrap()
}

/// File of the entry with this name.
fn file(store: &ImageStore, name: &str) -> PathBuf {
    store.folder.path(key(name).digest())
}

/// Total size of the store's files, in bytes.
fn total_bytes(store: &ImageStore) -> u64 {
    let files = store.folder.files().unwrap();
    files.iter().map(|file| file.bytes).sum()
}

fn image(store: &ImageStore, name: &str) -> Option<Vec<u8>> {
    store.get(&key(name), EntryType::Image, |_| true).map(|entry| entry.image)
}

#[test]
fn two_stores_of_one_folder_share_their_images() {
    let place = tempfile::tempdir().unwrap();
    let [one, other] = [0, 1].map(|_| store(place.path(), 1 << 20));
    assert_eq!(image(&one, "a"), None);
    one.put(&key("a"), &entry(9));
    assert_eq!(image(&other, "a"), Some(vec![7; 9]));
    assert_eq!(other.get(&key("a"), EntryType::Image, |_| false), None);
    let counts = other.counts();
    assert_eq!((counts.hits, counts.misses, counts.hit_bytes), (1, 1, 9));
    assert_eq!(counts.saved_ms, 30);
}

#[test]
fn damaged_and_exchanged_files_are_removed_and_counted() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    store.put(&key("a"), &entry(9));
    store.put(&key("b"), &entry(12));
    let [a, b] = ["a", "b"].map(|name| file(&store, name));
    fs::copy(&b, &a).unwrap();
    assert_eq!(image(&store, "a"), None);
    assert!(!a.exists());
    assert_eq!(image(&store, "b"), Some(vec![7; 12]));
    let mut bytes = fs::read(&b).unwrap();
    bytes[3] ^= 1;
    fs::write(&b, bytes).unwrap();
    assert_eq!(image(&store, "b"), None);
    assert_eq!(store.counts().damaged, 2);
    store.put(&key("b"), &entry(12));
    assert_eq!(image(&store, "b"), Some(vec![7; 12]));
}

#[test]
fn full_store_refuses_entries_until_old_ones_can_be_evicted() {
    let place = tempfile::tempdir().unwrap();
    let room = 1000;
    let full = store(place.path(), room);
    for name in ["a", "b", "c", "d", "e", "f", "g", "h"] {
        full.put(&key(name), &entry(200));
    }
    let counts = full.counts();
    assert!(counts.written >= 1 && counts.left_out >= 4, "{counts:?}");
    assert_eq!(counts.written + counts.left_out, 8);
    assert!(total_bytes(&full) <= room, "{}", total_bytes(&full));
    for file in full.folder.files().unwrap() {
        let old = SystemTime::now() - Duration::from_hours(24 * 15);
        let file = File::options().write(true).open(file.path).unwrap();
        file.set_modified(old).unwrap();
    }
    full.put(&key("h"), &entry(200));
    assert_eq!(image(&full, "h"), Some(vec![7; 200]));
    assert!(full.counts().evicted > 0 && total_bytes(&full) <= room);
}

#[test]
fn deleted_folder_is_created_again() {
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
fn store_that_cannot_be_used_is_ignored() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    let root = store.folder.root().to_owned();
    fs::remove_dir_all(&root).unwrap();
    fs::write(&root, "a file in the place of the folder").unwrap();
    store.put(&key("a"), &entry(9));
    assert_eq!(store.with_state(|state| state.health), Health::ReadOnly);
    assert_eq!(image(&store, "a"), None);
    assert_eq!(store.with_state(|state| state.health), Health::Unusable);
    assert_eq!(store.counts().written, 0);
}

#[cfg(unix)]
fn mode(path: &Path) -> u32 {
    use std::os::unix::fs::PermissionsExt as _;
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}

#[cfg(unix)]
#[test]
fn only_the_user_can_enter_the_folder() {
    let place = tempfile::tempdir().unwrap();
    let store = store(&place.path().join("store"), 1 << 20);
    assert_eq!(mode(store.folder.root()), 0o700);
    // The same after the folder was deleted and created again.
    fs::remove_dir_all(place.path().join("store")).unwrap();
    store.put(&key("a"), &entry(9));
    assert_eq!(mode(store.folder.root()), 0o700);
    assert_eq!(mode(file(&store, "a").parent().unwrap()), 0o700);
}

#[test]
fn entries_without_an_image_are_counted_separately() {
    let place = tempfile::tempdir().unwrap();
    let store = store(place.path(), 1 << 20);
    let shown = Shown { content: EntryType::Probe, ..Shown::default() };
    let facts = EntryFacts::new(shown, 500, serde_json::json!("found"));
    assert!(!store.contains(&key("a")));
    store.put(&key("a"), &Entry::from_facts(facts));
    assert!(store.contains(&key("a")));
    let read = store.get(&key("a"), EntryType::Probe, |_| true).unwrap();
    assert_eq!(read.facts.notes, serde_json::json!("found"));
    assert_eq!(store.get(&key("b"), EntryType::Measures, |_| true), None);
    let counts = store.counts();
    assert_eq!((counts.hits, counts.misses, counts.written), (0, 0, 0));
    assert_eq!((counts.facts, counts.saved_ms), (1, 500));
}
