//! What a run of the command may not lose: the files that it reads, and files that are not its own where it writes.
//!
//! From [`guard_inputs`] on, every file that is opened by [`open_input`] is known by its device and inode (elsewhere than on Unix by
//! its path without links). Whatever replaces files, [`super::OutputFile`] and [`super::ResultSet`], asks [`refuse_input`] first.
//!
//! A file of a fixed name that the user did not give (`journal.log`, `x.gtkw` beside `x.vcd`) may be the user's own, and so may a link.
//! [`set_aside_foreign`] renames it: `journal.log` becomes `journal.kept.log`.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::manifest::owner_of;
use super::open::open_file;
use super::temporary::Registry;
use femtogate::InputError;

/// A file, whatever its names are.
#[cfg(unix)]
type FileId = (u64, u64);
#[cfg(not(unix))]
type FileId = PathBuf;

#[derive(Debug)]
struct InputGuard {
    /// With the name by which each was opened.
    inputs: BTreeMap<FileId, PathBuf>,
    sentences: Vec<String>,
}

/// Nothing for a library: a long-lived process may write what it once read.
static GUARDED: Mutex<Option<InputGuard>> = Mutex::new(None);

fn guarded() -> MutexGuard<'static, Option<InputGuard>> {
    GUARDED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on, files that this process reads are not replaced. For `main` alone.
pub fn guard_inputs() {
    guarded().get_or_insert(InputGuard {
        inputs: BTreeMap::new(),
        sentences: Vec::new(),
    });
}

/// Sentences about files that were set aside since the last call, for the user to see.
pub fn said_of_kept_files() -> Vec<String> {
    let mut guarded = guarded();
    let sentences = guarded.as_mut().map(|g| std::mem::take(&mut g.sentences));
    sentences.unwrap_or_default()
}

/// Opens a file that the user gives to be read.
///
/// # Errors
/// As [`open_file`].
pub fn open_input(path: &Path) -> Result<File, InputError> {
    let file = open_file(path)?;
    if let (Some(guarded), Some(id)) = (guarded().as_mut(), id_of(path)) {
        guarded.inputs.entry(id).or_insert_with(|| path.to_owned());
    }
    Ok(file)
}

/// Complains if the file at `path` is one that this run has read.
///
/// # Errors
/// When it is.
pub fn refuse_input(path: &Path) -> Result<(), InputError> {
    let guarded = guarded();
    let Some((guarded, id)) = guarded.as_ref().zip(id_of(path)) else {
        return Ok(());
    };
    let Some(input) = guarded.inputs.get(&id) else {
        return Ok(());
    };
    let message = if input == path {
        "is read by this run, which would replace it; give another name for the output".to_owned()
    } else {
        format!(
            "is the same file as {}, which this run reads; give another name for the output",
            input.display()
        )
    };
    Err(InputError::new(path.display(), message))
}

/// What stands in the way of a file.
const FOLDER_THERE: &str = "is a folder; give the name of a file";

/// Complains if what stands at `path` is no file.
///
/// # Errors
/// A folder, a pipe or a device.
fn refuse_special(path: &Path) -> Result<(), InputError> {
    let complain = |message: &str| Err(InputError::new(path.display(), message));
    match fs::metadata(path) {
        Ok(about) if about.is_dir() => complain(FOLDER_THERE),
        Ok(about) if !about.is_file() => {
            complain("is a pipe or a device, which would be replaced; give the name of a file")
        }
        _ => Ok(()),
    }
}

/// Complains if a single file at `path` would replace one that this run has read, one of a set of results, or what is no file.
///
/// # Errors
/// When it would.
pub(super) fn refuse_to_replace(path: &Path) -> Result<(), InputError> {
    refuse_special(path)?;
    refuse_input(path)?;
    let Some(command) = owner_of(path) else {
        return Ok(());
    };
    let message =
        format!("is one of the results of `gdtof {command}`; give another name for the output");
    Err(InputError::new(path.display(), message))
}

/// The file behind a name, through links.
#[cfg(unix)]
fn id_of(path: &Path) -> Option<FileId> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|m| (m.dev(), m.ino()))
}

#[cfg(not(unix))]
fn id_of(path: &Path) -> Option<FileId> {
    path.canonicalize().ok()
}

/// Renames what stands at `path`, unless it is a file of ours, by what `is_ours` finds in it. A link or a device is never ours, and
/// never followed.
///
/// # Errors
/// A folder, a file that this run reads, one of a set of results, and one that cannot be renamed.
pub fn set_aside_foreign(
    path: &Path,
    is_ours: impl FnOnce(BufReader<File>) -> bool,
) -> Result<(), InputError> {
    let unwritable = |e: io::Error| InputError::unwritable(path, &e);
    let Ok(about) = fs::symlink_metadata(path) else {
        return Ok(());
    };
    if about.is_dir() {
        return Err(InputError::new(path.display(), FOLDER_THERE));
    }
    if about.is_file() && is_ours(BufReader::new(open_file(path)?)) {
        return Ok(());
    }
    refuse_to_replace(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let other = path.with_file_name(free_name(&name, |name| {
        fs::symlink_metadata(path.with_file_name(name)).is_ok()
    }));
    {
        let _undisturbed = Registry::lock();
        fs::rename(path, &other).map_err(unwritable)?;
    }
    if let Some(guarded) = guarded().as_mut() {
        guarded.sentences.push(set_aside_sentence(path, &other));
    }
    Ok(())
}

/// Whether a file begins so: how files of ours that are texts are known.
pub fn begins_with(beginning: &str) -> impl FnOnce(BufReader<File>) -> bool {
    move |file| {
        let mut head = Vec::new();
        let read = file.take(beginning.len() as u64).read_to_end(&mut head);
        read.is_ok() && head == beginning.as_bytes()
    }
}

/// What the user is told of a file that was in the way.
pub(super) fn set_aside_sentence(path: &Path, other: &Path) -> String {
    format!(
        "{} was not as an earlier run left it, and is now {}",
        path.display(),
        other.display()
    )
}

/// `depth.png` becomes `depth.kept.png`, or `depth.kept-2.png` where that is taken.
pub(super) fn free_name(name: &str, exists: impl Fn(&str) -> bool) -> String {
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

    #[test]
    fn what_is_not_ours_gets_another_name_and_nothing_is_lost() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let put_aside = |path: &Path| set_aside_foreign(path, begins_with("ours"));
        put_aside(&path("absent.log")).unwrap();

        fs::write(path("a.log"), "ours").unwrap();
        put_aside(&path("a.log")).unwrap();
        assert!(path("a.log").exists());

        for (content, kept) in [("first", "a.kept.log"), ("second", "a.kept-2.log")] {
            fs::write(path("a.log"), content).unwrap();
            put_aside(&path("a.log")).unwrap();
            assert!(!path("a.log").exists());
            assert_eq!(fs::read_to_string(path(kept)).unwrap(), content);
        }

        fs::create_dir(path("b.log")).unwrap();
        assert!(put_aside(&path("b.log")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_never_ours_and_is_not_followed() {
        let dir = tempfile::tempdir().unwrap();
        let [target, link] = ["target", "x.log"].map(|name| dir.path().join(name));
        fs::write(&target, "ours").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        set_aside_foreign(&link, |_| true).unwrap();
        assert!(fs::symlink_metadata(&link).is_err());
        assert_eq!(
            fs::read_link(dir.path().join("x.kept.log")).unwrap(),
            target
        );
    }
}
