//! Segment names of a Replica scene, from `info_semantic.json`.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::labels::names::class_of;
use crate::types::SegmentName;

/// Used fields of the file.
#[derive(Deserialize)]
struct SemanticInfo {
    objects: Vec<ReplicaObject>,
}

#[derive(Deserialize)]
struct ReplicaObject {
    id: i64,
    class_name: String,
}

/// Parses the names of segments, by number. Segments without a name are left out. Names without a known class are
/// counted in `unlisted`.
pub(super) fn parse(text: &str, unlisted: &mut BTreeMap<String, usize>) -> Result<BTreeMap<u32, SegmentName>, String> {
    let info: SemanticInfo = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let mut names = BTreeMap::new();
    for ReplicaObject { id, class_name } in info.objects {
        let Ok(id) = u32::try_from(id) else {
            continue;
        };
        let words = class_name.replace('-', " ");
        let Some(canonical) = class_of(&words, &class_name, 1, unlisted) else {
            continue;
        };
        let name = SegmentName { name: words, canonical: canonical.to_owned(), region: None };
        names.insert(id, name);
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_have_classes() {
        let text = r#"{"classes":[{"id":1,"name":"bed"}],"objects":[{"id":0,"class_id":1,"class_name":"bed"},{"id":2,"class_name":"coffee-table"},{"id":-1,"class_name":"bed"},{"id":3,"class_name":"gizmo"},{"id":4,"class_name":""}]}"#;
        let mut unlisted = BTreeMap::new();
        let names = parse(text, &mut unlisted).unwrap();
        let classes: Vec<(u32, &str)> = names.iter().map(|(id, name)| (*id, name.canonical.as_str())).collect();
        assert_eq!(classes, [(0, "bed"), (2, "table"), (3, "misc")]);
        assert_eq!(unlisted, [("gizmo".to_owned(), 1)].into());
        assert!(parse("{}", &mut unlisted).unwrap_err().contains("missing field `objects`"));
    }
}
