//! `manifest.json`, which lists the files of a set of results with their sizes and hashes.

use std::fs;
use std::io::{self, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::open::open_file;

/// Name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// What a manifest of ours says of the program that wrote it.
pub(super) const PROGRAM: &str = "gdtof";

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

/// Bytes of a file, and their hash, SHA-256 in hexadecimal digits.
///
/// # Errors
/// When it cannot be read.
pub fn file_hash(path: &Path) -> io::Result<(u64, String)> {
    let mut file = open_file(path).map_err(io::Error::other)?;
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
    let digits = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok((bytes, digits))
}

impl ManifestFile {
    pub(super) fn from_file(folder: &Path, name: &str) -> io::Result<Self> {
        let (bytes, sha256) = file_hash(&folder.join(name))?;
        Ok(ManifestFile {
            name: name.to_owned(),
            bytes,
            sha256,
        })
    }
}

/// The manifest, as far as this program reads it again.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Manifest {
    pub(super) program: String,
    pub(super) version: String,
    pub(super) command: String,
    pub(super) complete: bool,
    pub(super) files: Vec<ManifestFile>,
    /// Only while one set replaces another: the files of the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) previous_files: Vec<ManifestFile>,
    #[serde(default)]
    pub(super) configuration: serde_json::Value,
}

impl Manifest {
    /// The manifest of a folder, if it has one that is ours.
    pub(super) fn read(folder: &Path) -> Option<Self> {
        let path = folder.join(MANIFEST);
        if !fs::symlink_metadata(&path).ok()?.is_file() {
            return None;
        }
        let file = BufReader::new(open_file(&path).ok()?);
        let manifest: Manifest = serde_json::from_reader(file).ok()?;
        let files = || manifest.files.iter().chain(&manifest.previous_files);
        // Names that lead elsewhere are none of ours.
        let is_plain = |f: &ManifestFile| Path::new(&f.name).file_name() == Some(f.name.as_ref());
        (manifest.program == PROGRAM && files().all(is_plain)).then_some(manifest)
    }

    pub(super) fn write(&self, path: &Path) -> io::Result<()> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        fs::write(path, text)
    }
}

/// The command whose results the file `path` is one of.
pub(super) fn owner_of(path: &Path) -> Option<String> {
    fs::symlink_metadata(path).ok()?;
    let manifest = Manifest::read(path.parent()?)?;
    let is_its = |file: &ManifestFile| path.file_name() == Some(file.name.as_ref());
    let mut files = manifest.files.iter().chain(&manifest.previous_files);
    files.any(is_its).then_some(manifest.command)
}
