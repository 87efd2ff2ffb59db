//! The files of a cell library in a setting: one, or those of a kit, separated by commas.
//!
//! ```text
//!   liberty = "sky130_fd_sc_hd_tt.lib.gz"
//!   liberty = "simple.lib.gz, invbuf.lib.gz, seq.lib"
//! ```

use std::path::{Path, PathBuf};

/// The files of a setting, none of an empty one. A file whose own name has a comma is one file.
pub fn library_files(setting: &Path) -> Vec<PathBuf> {
    let Some(text) = setting
        .to_str()
        .filter(|text| text.contains(',') && !setting.is_file())
    else {
        let one = (!setting.as_os_str().is_empty()).then(|| setting.to_owned());
        return one.into_iter().collect();
    };
    let parts = text.split(',').map(str::trim);
    parts
        .filter(|part| !part.is_empty())
        .map(PathBuf::from)
        .collect()
}

/// The setting of these files.
pub fn library_setting(files: impl IntoIterator<Item = PathBuf>) -> PathBuf {
    let names = files.into_iter().map(PathBuf::into_os_string);
    let names: Vec<_> = names.collect();
    PathBuf::from(names.join(std::ffi::OsStr::new(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_separated_by_commas() {
        let folder = tempfile::tempdir().unwrap();
        let odd = folder.path().join("a,b.lib");
        std::fs::write(&odd, "").unwrap();
        for (setting, files) in [
            ("", &[][..]),
            ("one.lib", &["one.lib"]),
            (
                "one.lib, two.lib,three.lib",
                &["one.lib", "two.lib", "three.lib"],
            ),
            (" one.lib,", &["one.lib"]),
            (odd.to_str().unwrap(), &[odd.to_str().unwrap()]),
        ] {
            let found = library_files(Path::new(setting));
            assert_eq!(found, files.iter().map(PathBuf::from).collect::<Vec<_>>());
            assert_eq!(library_files(&library_setting(found.clone())), found);
        }
    }
}
