//! Value of the flag for images that another program enhanced: [`EnhancedFolder`].

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use darkqa_base::types::EnhancerName;

/// A folder of images that another program enhanced (`NAME=DIR`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnhancedFolder {
    /// The name of the enhancer in tables and records.
    pub name: EnhancerName,
    /// Folder of the images.
    pub folder: PathBuf,
}

impl FromStr for EnhancedFolder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, folder) = text
            .split_once('=')
            .filter(|(_, folder)| !folder.is_empty())
            .ok_or("expected NAME=DIR, such as mine=enhanced/")?;
        let name = EnhancerName::new(name)
            .map_err(|_| format!("{name:?} is not a valid name; use letters, digits, '_', '-' and '.'"))?;
        Ok(Self { name, folder: folder.into() })
    }
}

impl fmt::Display for EnhancedFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.name, self.folder.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_needs_a_name() {
        let read: EnhancedFolder = "mine=a=b/c".parse().unwrap();
        assert_eq!(read.to_string(), "mine=a=b/c");
        assert_eq!(read.folder, PathBuf::from("a=b/c"));
        for text in ["mine", "mine=", "=out", "my one=out"] {
            assert!(text.parse::<EnhancedFolder>().is_err(), "{text}");
        }
    }
}
