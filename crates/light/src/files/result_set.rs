//! The results of one run as one set: all of them, and none of another run's.
//!
//! ```text
//!   begin ─► staging folder, where everything is written ─► commit: old set out, new set in, manifest last
//! ```
//!
//! `manifest.json` lists the files of the set with their sizes and SHA-256 hashes, beside the program's version and
//! what was asked for. A new set replaces the one that the manifest lists: its files are removed or replaced where they
//! still are what was written. A file that has changed since, or that no manifest lists, is the user's: it is kept,
//! under another name if its own is needed.
//!
//! The switch is a few renames under a lock of the folder. While it lasts, the manifest says `"complete": false` and
//! lists both sets, so that a run killed in it neither passes for whole nor loses track of its files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::output::create_folder;
use super::temporary::{Registry, Temporary, lock};
use femtogate::InputError;

/// Name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// A set of results that is being made.
#[derive(Debug)]
pub struct ResultSet {
    folder: PathBuf,
    staging: Temporary,
    /// Dropped after what is staged in it.
    _made: Option<MadeFolder>,
}

/// A folder that is removed again if nothing came into it.
#[derive(Debug)]
struct MadeFolder(PathBuf);

impl Drop for MadeFolder {
    fn drop(&mut self) {
        // One that is not empty stays.
        let _ = fs::remove_dir(&self.0);
    }
}

/// What a manifest says of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ManifestFile {
    /// Name in the manifest's folder.
    pub name: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of the contents, hexadecimal.
    pub sha256: String,
}

impl ManifestFile {
    fn of(folder: &Path, name: &str) -> io::Result<Self> {
        let mut file = File::open(folder.join(name))?;
        let mut hash = Sha256::new();
        let mut bytes = 0;
        let mut chunk = vec![0; 1 << 18];
        loop {
            match file.read(&mut chunk)? {
                0 => break,
                n => {
                    hash.update(&chunk[..n]);
                    bytes += n as u64;
                }
            }
        }
        let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
        Ok(ManifestFile {
            name: name.to_owned(),
            bytes,
            sha256,
        })
    }
}

/// The manifest, as far as this program reads it again.
#[derive(Debug, Serialize, Deserialize)]
struct Manifest {
    program: String,
    version: String,
    command: String,
    complete: bool,
    files: Vec<ManifestFile>,
    /// Only while one set replaces another: the files of the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    previous_files: Vec<ManifestFile>,
    #[serde(default)]
    configuration: serde_json::Value,
}

impl Manifest {
    /// The manifest of a folder, if it has one that is ours.
    fn read(folder: &Path) -> Option<Self> {
        let text = fs::read_to_string(folder.join(MANIFEST)).ok()?;
        let manifest: Manifest = serde_json::from_str(&text).ok()?;
        let files = || manifest.files.iter().chain(&manifest.previous_files);
        // Names that lead elsewhere are none of ours.
        let is_plain = |f: &ManifestFile| Path::new(&f.name).file_name() == Some(f.name.as_ref());
        (manifest.program == PROGRAM && files().all(is_plain)).then_some(manifest)
    }

    fn write(&self, path: &Path) -> io::Result<()> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        fs::write(path, text)
    }
}

const PROGRAM: &str = "gdtof";

/// What becomes of the files in a folder when a set is put there.
#[derive(Debug, Default)]
struct Switch {
    /// Files of the set before, unchanged since, that have no successor.
    remove: Vec<String>,
    /// Files that are not ours to replace, and the names they are kept under.
    set_aside: Vec<(String, String)>,
    /// Files that have changed since the set before, under names that this one does not need.
    kept: Vec<String>,
}

impl ResultSet {
    /// Begins a set of results for `folder`, which is created if missing.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn begin(folder: &Path) -> Result<Self, InputError> {
        let was_there = folder.exists();
        create_folder(folder)?;
        let made = (!was_there).then(|| MadeFolder(folder.to_owned()));
        let staging = Temporary::folder_in(folder);
        let staging = staging.map_err(|e| InputError::unwritable(folder, &e))?;
        Ok(ResultSet {
            folder: folder.to_owned(),
            staging,
            _made: made,
        })
    }

    /// The folder to write the results into, each under its own name.
    pub fn staging(&self) -> &Path {
        &self.staging.path
    }

    /// Puts everything in the staging folder into the place of the set before. `command` and `configuration` say in
    /// the manifest what was run. Returns a sentence about each file of the user's that was in the way.
    ///
    /// # Errors
    /// When a file cannot be replaced: the set before is then whole, or the manifest says that it is not.
    pub fn commit(
        self,
        command: &str,
        configuration: impl Serialize,
    ) -> Result<Vec<String>, InputError> {
        let failed = |e: io::Error| InputError::unwritable(&self.folder, &e);
        self.switch(
            command,
            serde_json::to_value(configuration).map_err(|e| failed(e.into()))?,
        )
        .map_err(failed)
    }

    fn switch(&self, command: &str, configuration: serde_json::Value) -> io::Result<Vec<String>> {
        let staging = &self.staging.path;
        let mut names = Vec::new();
        for entry in fs::read_dir(staging)? {
            let name = entry?.file_name().into_string();
            names.push(name.map_err(|name| io::Error::other(format!("{name:?} is not text")))?);
        }
        names.sort();
        let describe = |name: &String| ManifestFile::of(staging, name);
        let files = names.iter().map(describe).collect::<io::Result<_>>()?;

        // Two runs that end together put their sets there one after the other.
        let folder_lock = File::open(&self.folder)?;
        lock::wait_for(&folder_lock);
        let before = Manifest::read(&self.folder);
        let previous_files = before.map_or(Vec::new(), |m| [m.files, m.previous_files].concat());
        let switch = Switch::plan(&self.folder, &names, &previous_files)?;

        let mut manifest = Manifest {
            program: PROGRAM.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            command: command.into(),
            complete: false,
            files,
            previous_files,
            configuration,
        };
        let during = staging.join("manifest of the switch");
        manifest.write(&during)?;
        manifest.complete = true;
        manifest.previous_files.clear();
        let after = staging.join("manifest of the set");
        manifest.write(&after)?;

        let _undisturbed = Registry::lock();
        let at = |name: &str| self.folder.join(name);
        for (name, other) in &switch.set_aside {
            fs::rename(at(name), at(other))?;
        }
        fs::rename(&during, at(MANIFEST))?;
        for name in &names {
            fs::rename(staging.join(name), at(name))?;
        }
        for name in &switch.remove {
            fs::remove_file(at(name))?;
        }
        fs::rename(&after, at(MANIFEST))?;
        Ok(switch.sentences(&self.folder))
    }
}

impl Switch {
    fn plan(folder: &Path, names: &[String], previous: &[ManifestFile]) -> io::Result<Self> {
        let mut ours: BTreeMap<&str, Vec<&ManifestFile>> = BTreeMap::new();
        for file in previous {
            ours.entry(&file.name).or_default().push(file);
        }
        let is_ours = |name: &str| -> io::Result<bool> {
            let Some(known) = ours.get(name) else {
                return Ok(false);
            };
            let bytes = fs::symlink_metadata(folder.join(name))?.len();
            // Hashing is for those that might be.
            Ok(known.iter().any(|f| f.bytes == bytes)
                && known.contains(&&ManifestFile::of(folder, name)?))
        };
        let exists = |name: &str| fs::symlink_metadata(folder.join(name)).is_ok();
        let mut switch = Switch::default();
        for name in names.iter().filter(|name| exists(name)) {
            if folder.join(name).is_dir() {
                return Err(io::Error::other(format!("{name} is a folder there")));
            }
            if !is_ours(name)? {
                let other = free_name(name, exists);
                switch.set_aside.push((name.clone(), other));
            }
        }
        if exists(MANIFEST) && Manifest::read(folder).is_none() {
            let other = free_name(MANIFEST, exists);
            switch.set_aside.push((MANIFEST.into(), other));
        }
        let needed: BTreeSet<&str> = names.iter().map(String::as_str).collect();
        for &name in ours.keys().filter(|name| !needed.contains(*name)) {
            match exists(name) {
                true if is_ours(name)? => switch.remove.push(name.into()),
                true => switch.kept.push(name.into()),
                false => {}
            }
        }
        Ok(switch)
    }

    fn sentences(&self, folder: &Path) -> Vec<String> {
        let at = |name: &String| folder.join(name).display().to_string();
        let set_aside = self.set_aside.iter().map(|(name, other)| {
            let (name, other) = (at(name), at(other));
            format!("{name} was not as an earlier run left it, and is now {other}")
        });
        let kept = self.kept.iter().map(|name| {
            format!(
                "{} has been changed since an earlier run wrote it, and was kept; it is none of these results",
                at(name)
            )
        });
        set_aside.chain(kept).collect()
    }
}

/// `depth.png` becomes `depth.kept.png`, or `depth.kept-2.png` where that is taken.
fn free_name(name: &str, exists: impl Fn(&str) -> bool) -> String {
    let (stem, extension) = match name.rsplit_once('.') {
        Some((stem, extension)) => (stem, format!(".{extension}")),
        None => (name, String::new()),
    };
    let numbered = (2..).map(|n| format!("{stem}.kept-{n}{extension}"));
    std::iter::once(format!("{stem}.kept{extension}"))
        .chain(numbered)
        .find(|name| !exists(name))
        .expect("numbers do not end")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(folder: &Path, files: &[(&str, &str)]) -> Vec<String> {
        let set = ResultSet::begin(folder).unwrap();
        for (name, text) in files {
            fs::write(set.staging().join(name), text).unwrap();
        }
        set.commit("test", serde_json::json!({"files": files.len()}))
            .unwrap()
    }

    fn listing(folder: &Path) -> Vec<(String, String)> {
        let mut files: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| {
                let entry = entry.unwrap();
                let name = entry.file_name().into_string().unwrap();
                (name, fs::read_to_string(entry.path()).unwrap())
            })
            .filter(|(name, _)| name != MANIFEST)
            .collect();
        files.sort();
        files
    }

    fn owned(files: &[(&str, &str)]) -> Vec<(String, String)> {
        files
            .iter()
            .map(|(n, t)| (n.to_string(), t.to_string()))
            .collect()
    }

    #[test]
    fn a_set_that_is_given_up_leaves_no_folder_but_one_that_was_there() {
        let dir = tempfile::tempdir().unwrap();
        let (new, old) = (dir.path().join("new"), dir.path().join("old"));
        fs::create_dir(&old).unwrap();
        for out in [&new, &old] {
            let set = ResultSet::begin(out).unwrap();
            fs::write(set.staging().join("a"), "half").unwrap();
        }
        assert!(!new.exists() && old.exists());
    }

    #[test]
    fn a_set_replaces_the_one_before_it() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        assert!(put(&out, &[("a", "1"), ("probe_1", "x"), ("probe_2", "y")]).is_empty());
        fs::write(out.join("notes.txt"), "mine").unwrap();
        assert!(put(&out, &[("a", "2"), ("probe_3", "z")]).is_empty());
        let expected = [("a", "2"), ("notes.txt", "mine"), ("probe_3", "z")];
        assert_eq!(listing(&out), owned(&expected));
        let manifest = Manifest::read(&out).unwrap();
        assert!(manifest.complete);
        let known = ManifestFile::of(&out, "a").unwrap();
        assert_eq!(manifest.files[0], known);
        // sha256sum of "2".
        assert_eq!(
            known.sha256,
            "d4735e3a265e16eee03f59718b9b5d03019c07d8b6c51f90da3a666eec13ab35"
        );
    }

    #[test]
    fn what_the_user_changed_or_made_is_kept_and_said() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        fs::write(out.join("a.png"), "mine, before any run").unwrap();
        fs::write(out.join(MANIFEST), "{\"mine\": 1}").unwrap();
        let said = put(out, &[("a.png", "1"), ("b", "1"), ("old", "1")]);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("a.kept.png"), "{said:?}");

        fs::write(out.join("a.png"), "2 by the user").unwrap();
        fs::write(out.join("old"), "2").unwrap();
        let said = put(out, &[("a.png", "3"), ("b", "3")]);
        assert_eq!(said.len(), 2, "{said:?}");
        let expected = [
            ("a.kept-2.png", "2 by the user"),
            ("a.kept.png", "mine, before any run"),
            ("a.png", "3"),
            ("b", "3"),
            ("manifest.kept.json", "{\"mine\": 1}"),
            ("old", "2"),
        ];
        assert_eq!(listing(out), owned(&expected));
    }

    #[test]
    fn a_switch_that_was_killed_says_so_and_is_put_right_by_the_next() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        put(out, &[("a", "old a"), ("b", "old b"), ("probe", "old")]);
        // As far as a killed switch came: the manifest of both, and one of two files.
        let mut manifest = Manifest::read(out).unwrap();
        manifest.complete = false;
        manifest.previous_files = std::mem::take(&mut manifest.files);
        fs::write(out.join("a"), "new a").unwrap();
        manifest.files = vec![ManifestFile::of(out, "a").unwrap()];
        manifest.write(&out.join(MANIFEST)).unwrap();

        assert!(put(out, &[("a", "newer a"), ("b", "newer b")]).is_empty());
        assert_eq!(listing(out), owned(&[("a", "newer a"), ("b", "newer b")]));
        assert!(Manifest::read(out).unwrap().complete);
    }

    #[test]
    fn a_set_that_is_not_committed_leaves_the_old_one() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        put(out, &[("a", "1")]);
        let set = ResultSet::begin(out).unwrap();
        fs::write(set.staging().join("a"), "2").unwrap();
        drop(set);
        assert_eq!(listing(out), owned(&[("a", "1")]));

        // A name that is a folder cannot be replaced, and nothing else is then.
        fs::create_dir(out.join("b")).unwrap();
        let set = ResultSet::begin(out).unwrap();
        for name in ["a", "b"] {
            fs::write(set.staging().join(name), "3").unwrap();
        }
        let error = set.commit("test", ()).unwrap_err().to_string();
        assert!(error.contains("b is a folder"), "{error}");
        fs::remove_dir(out.join("b")).unwrap();
        assert_eq!(listing(out), owned(&[("a", "1")]));
    }

    #[test]
    fn a_manifest_that_points_elsewhere_removes_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        put(&out, &[("a", "1")]);
        fs::write(dir.path().join("a"), "1").unwrap();
        let text = fs::read_to_string(out.join(MANIFEST)).unwrap();
        let text = text.replace("\"name\": \"a\"", "\"name\": \"../a\"");
        fs::write(out.join(MANIFEST), text).unwrap();
        put(&out, &[("b", "1")]);
        assert_eq!(fs::read_to_string(dir.path().join("a")).unwrap(), "1");
    }
}
