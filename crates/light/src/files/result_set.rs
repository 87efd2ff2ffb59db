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
//! A set replaces one of the same command alone, and no file that the run has read: else nothing is touched.
//!
//! The switch is a few renames under a lock of the folder. While it lasts, the manifest says `"complete": false` and
//! lists both sets, so that a run killed in it neither passes for whole nor loses track of its files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::guarded::{free_name, refuse_input, set_aside_sentence};
use super::manifest::{MANIFEST, Manifest, ManifestFile, PROGRAM};
use super::output::create_folder;
use super::temporary::{Registry, Temporary, lock, open_folder};
use femtogate::InputError;

/// A set of results that is being made.
#[derive(Debug)]
pub struct ResultSet {
    folder: PathBuf,
    command: String,
    staging: Temporary,
    keeps_others: bool,
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

/// The set in `folder`, which one of `command` may replace.
///
/// # Errors
/// A set of another command, or one with a file that this run has read.
fn replaceable(folder: &Path, command: &str) -> Result<Option<Manifest>, InputError> {
    let Some(manifest) = Manifest::read(folder) else {
        return Ok(None);
    };
    let other = &manifest.command;
    if other != command {
        let message = format!(
            "holds the results of `gdtof {other}`, which `gdtof {command}` does not replace; give another folder with --out, or delete this one"
        );
        return Err(InputError::new(folder.display(), message));
    }
    for file in manifest.files.iter().chain(&manifest.previous_files) {
        refuse_input(&folder.join(&file.name))?;
    }
    Ok(Some(manifest))
}

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
    /// Complains if `folder` holds what results of `command` may not replace.
    ///
    /// # Errors
    /// A set of another command, or one with a file that this run has read.
    pub fn check(folder: &Path, command: &str) -> Result<(), InputError> {
        replaceable(folder, command).map(drop)
    }

    /// Begins a set of results of `command` for `folder`, which is created if missing.
    ///
    /// # Errors
    /// As [`ResultSet::check`], and when the folder cannot be written.
    pub fn begin(folder: &Path, command: &str) -> Result<Self, InputError> {
        Self::check(folder, command)?;
        let was_there = folder.exists();
        create_folder(folder)?;
        let made = (!was_there).then(|| MadeFolder(folder.to_owned()));
        let staging = Temporary::folder_in(folder);
        let staging = staging.map_err(|e| InputError::unwritable(folder, &e))?;
        Ok(ResultSet {
            folder: folder.to_owned(),
            command: command.to_owned(),
            staging,
            keeps_others: false,
            _made: made,
        })
    }

    /// Files of the set before that have no successor stay in the set.
    pub fn beside_others(mut self) -> Self {
        self.keeps_others = true;
        self
    }

    /// The folder to write the results into, each under its own name.
    pub fn staging(&self) -> &Path {
        &self.staging.path
    }

    /// Puts everything in the staging folder into the place of the set before. `configuration` says in the manifest what
    /// was asked for. Returns a sentence about each file of the user's that was in the way.
    ///
    /// # Errors
    /// As [`ResultSet::check`], and when a file cannot be replaced: the set before is then whole, or the manifest says that
    /// it is not.
    pub fn commit(self, configuration: impl Serialize) -> Result<Vec<String>, InputError> {
        let failed = |e: io::Error| InputError::unwritable(&self.folder, &e);
        let configuration = serde_json::to_value(configuration).map_err(|e| failed(e.into()))?;
        let files = self.staged().map_err(failed)?;
        // Two runs that end together put their sets there one after the other.
        let folder_lock = open_folder(&self.folder).map_err(failed)?;
        lock::wait_for(&folder_lock);
        let before = replaceable(&self.folder, &self.command)?;
        let previous_files = before.map_or(Vec::new(), |m| [m.files, m.previous_files].concat());
        let mut switch = Switch::plan(&self.folder, &files, &previous_files).map_err(failed)?;
        for file in &files {
            refuse_input(&self.folder.join(&file.name))?;
        }
        let others = if self.keeps_others {
            std::mem::take(&mut switch.remove)
        } else {
            Vec::new()
        };
        let others = others
            .iter()
            .map(|name| ManifestFile::from_file(&self.folder, name));
        let others = others.collect::<io::Result<_>>().map_err(failed)?;
        self.publish(&switch, [files, others], previous_files, configuration)
            .map_err(failed)?;
        Ok(switch.sentences(&self.folder))
    }

    /// What is in the staging folder.
    fn staged(&self) -> io::Result<Vec<ManifestFile>> {
        let staging = &self.staging.path;
        let mut names = Vec::new();
        for entry in fs::read_dir(staging)? {
            let name = entry?.file_name().into_string();
            names.push(name.map_err(|name| io::Error::other(format!("{name:?} is not text")))?);
        }
        names.sort();
        let describe = |name: &String| ManifestFile::from_file(staging, name);
        names.iter().map(describe).collect()
    }

    fn publish(
        &self,
        switch: &Switch,
        [files, others]: [Vec<ManifestFile>; 2],
        previous_files: Vec<ManifestFile>,
        configuration: serde_json::Value,
    ) -> io::Result<()> {
        let staging = &self.staging.path;
        let mut manifest = Manifest {
            program: PROGRAM.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            command: self.command.clone(),
            complete: false,
            files: [&files[..], &others].concat(),
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
        let path = |name: &str| self.folder.join(name);
        for (name, other) in &switch.set_aside {
            fs::rename(path(name), path(other))?;
        }
        fs::rename(&during, path(MANIFEST))?;
        for ManifestFile { name, .. } in &files {
            fs::rename(staging.join(name), path(name))?;
        }
        for name in &switch.remove {
            fs::remove_file(path(name))?;
        }
        fs::rename(&after, path(MANIFEST))
    }
}

impl Switch {
    fn plan(folder: &Path, files: &[ManifestFile], previous: &[ManifestFile]) -> io::Result<Self> {
        let mut ours: BTreeMap<&str, Vec<&ManifestFile>> = BTreeMap::new();
        for file in previous {
            ours.entry(&file.name).or_default().push(file);
        }
        let is_ours = |name: &str| -> io::Result<bool> {
            let Some(known) = ours.get(name) else {
                return Ok(false);
            };
            let about = fs::symlink_metadata(folder.join(name))?;
            // Hashing is for those that might be.
            Ok(about.is_file()
                && known.iter().any(|f| f.bytes == about.len())
                && known.contains(&&ManifestFile::from_file(folder, name)?))
        };
        let exists = |name: &str| fs::symlink_metadata(folder.join(name)).is_ok();
        let mut switch = Switch::default();
        for file in files.iter().filter(|file| exists(&file.name)) {
            let name = &file.name;
            let about = fs::symlink_metadata(folder.join(name))?;
            if about.is_dir() {
                return Err(io::Error::other(format!("{name} is a folder there")));
            }
            // Nothing is lost of one that says the same.
            let is_same = || -> io::Result<bool> {
                Ok(about.is_file()
                    && about.len() == file.bytes
                    && ManifestFile::from_file(folder, name)? == *file)
            };
            if !is_ours(name)? && !is_same()? {
                let other = free_name(name, exists);
                switch.set_aside.push((name.clone(), other));
            }
        }
        if exists(MANIFEST) && Manifest::read(folder).is_none() {
            let other = free_name(MANIFEST, exists);
            switch.set_aside.push((MANIFEST.into(), other));
        }
        let needed: BTreeSet<&str> = files.iter().map(|file| &*file.name).collect();
        for &name in ours.keys().filter(|name| !needed.contains(*name)) {
            if !exists(name) {
                continue;
            }
            if is_ours(name)? {
                switch.remove.push(name.into());
            } else {
                switch.kept.push(name.into());
            }
        }
        Ok(switch)
    }

    fn sentences(&self, folder: &Path) -> Vec<String> {
        let shown_path = |name: &String| folder.join(name).display().to_string();
        let set_aside = (self.set_aside.iter())
            .map(|(name, other)| set_aside_sentence(&folder.join(name), &folder.join(other)));
        let kept = self.kept.iter().map(|name| {
            format!(
                "{} has been changed since an earlier run wrote it, and was kept; it is none of these results",
                shown_path(name)
            )
        });
        set_aside.chain(kept).collect()
    }
}

#[cfg(test)]
mod tests;
