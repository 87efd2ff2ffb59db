//! Files and folders that are being written and do not stand under their name yet.
//!
//! A temporary is called `.gdtof-<number>-<check>` and stands in its target's folder. Its process holds a lock on
//! it (`flock`), which the kernel drops however that process ends. So a temporary whose lock is to be had is what a
//! killed run left; it is removed when the next run writes into the folder. A file of the user's is never taken for
//! one: the check is a hash of the number. Where locks are not to be had, nothing is removed.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sha2::{Digest, Sha256};

use super::open::open_file;

const PREFIX: &str = ".gdtof-";

/// The temporaries of this process, and what it has looked for others' leftovers.
pub(super) struct Registry {
    live: BTreeSet<PathBuf>,
    swept: BTreeSet<PathBuf>,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry {
    live: BTreeSet::new(),
    swept: BTreeSet::new(),
});

impl Registry {
    /// Keeps others from making, renaming and removing temporaries meanwhile.
    pub(super) fn lock() -> MutexGuard<'static, Registry> {
        REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes everything that this process has not finished.
    pub(super) fn remove_all(&mut self) {
        while let Some(path) = self.live.pop_first() {
            remove(&path);
        }
    }
}

/// A temporary of this process; it is removed when dropped.
#[derive(Debug)]
pub(super) struct Temporary {
    /// Where it stands.
    pub(super) path: PathBuf,
    /// Holds the lock.
    _lock: File,
}

impl Temporary {
    /// An empty file in `folder`, open for writing.
    pub(super) fn file_in(folder: &Path) -> io::Result<(Self, File)> {
        let temporary = Self::make(folder, |path| {
            let mut options = File::options();
            options.read(true).write(true).create_new(true);
            options.open(path)
        })?;
        let file = temporary._lock.try_clone()?;
        Ok((temporary, file))
    }

    /// An empty folder in `folder`.
    pub(super) fn folder_in(folder: &Path) -> io::Result<Self> {
        Self::make(folder, |path| {
            fs::create_dir(path)?;
            open_folder(path)
        })
    }

    fn make(folder: &Path, create: impl Fn(&Path) -> io::Result<File>) -> io::Result<Self> {
        let mut registry = Registry::lock();
        if registry.swept.insert(folder.to_owned()) {
            sweep(folder);
        }
        loop {
            let path = folder.join(fresh_name());
            let file = match create(&path) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                // Made, but taken for a leftover by another run before it was opened.
                Err(e) if e.kind() == io::ErrorKind::NotFound && folder.is_dir() => continue,
                other => other?,
            };
            lock::wait_for(&file);
            // Before it was locked, another run may have taken it for a leftover.
            if lock::is_same(&path, &file) {
                registry.live.insert(path.clone());
                return Ok(Temporary { path, _lock: file });
            }
        }
    }

    /// Gives a file its final name, whatever had that name before.
    pub(super) fn rename(self, target: &Path) -> io::Result<()> {
        let mut registry = Registry::lock();
        fs::rename(&self.path, target)?;
        registry.live.remove(&self.path);
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let mut registry = Registry::lock();
        if registry.live.remove(&self.path) {
            remove(&self.path);
        }
    }
}

/// Nothing can be done about one that resists; the next run tries again.
fn remove(path: &Path) {
    if !path.is_dir() {
        let _ = fs::remove_file(path);
        return;
    }
    // Another thread may be writing into it: under another name nobody finds it, and what was about to be made there is soon made.
    let hidden = path.with_file_name(fresh_name());
    let hidden = match fs::rename(path, &hidden) {
        Ok(()) => &*hidden,
        Err(_) => path,
    };
    let _ = (0..100).any(|_| fs::remove_dir_all(hidden).is_ok());
}

fn fresh_name() -> String {
    let number = RandomState::new().hash_one(std::process::id());
    format!("{PREFIX}{number:016x}-{:016x}", check_of(number))
}

fn check_of(number: u64) -> u64 {
    let hash = Sha256::digest(format!("gdtof temporary {number:016x}"));
    u64::from_be_bytes(hash[..8].try_into().expect("8 of 32 bytes"))
}

fn is_ours(name: &str) -> bool {
    let parts = name.strip_prefix(PREFIX).and_then(|n| n.split_once('-'));
    let numbers = parts.and_then(|(number, check)| {
        let parse = |text: &str| u64::from_str_radix(text, 16).ok();
        Some((parse(number)?, parse(check)?))
    });
    numbers.is_some_and(|(number, check)| check == check_of(number))
}

/// Opens a folder, to lock it.
#[expect(clippy::disallowed_methods, reason = "nothing is read of it")]
pub(super) fn open_folder(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// Removes what runs that are no more left in `folder`.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_link = entry.file_type().is_ok_and(|kind| kind.is_symlink());
        if is_link || !entry.file_name().to_str().is_some_and(is_ours) {
            continue;
        }
        let path = entry.path();
        let opened = if path.is_dir() {
            open_folder(&path).ok()
        } else {
            open_file(&path).ok()
        };
        let Some(file) = opened else {
            continue;
        };
        if lock::is_free(&file) && lock::is_same(&path, &file) {
            remove(&path);
        }
    }
}

/// Advisory locks on open files and folders.
pub(super) mod lock {
    use std::fs::File;
    use std::path::Path;

    /// Locks `file`, once nobody else does. Without effect where there are no locks.
    #[cfg(unix)]
    pub(crate) fn wait_for(file: &File) {
        use rustix::fs::{FlockOperation, flock};
        while let Err(rustix::io::Errno::INTR) = flock(file, FlockOperation::LockExclusive) {}
    }

    /// Locks `file` if nobody else does, and says whether it did.
    #[cfg(unix)]
    pub(crate) fn is_free(file: &File) -> bool {
        use rustix::fs::{FlockOperation, flock};
        flock(file, FlockOperation::NonBlockingLockExclusive).is_ok()
    }

    /// Locks `file` if nobody else does, and says whether somebody does. Without locks nobody is known to.
    #[cfg(unix)]
    pub(crate) fn is_held_elsewhere(file: &File) -> bool {
        !is_free(file)
    }

    #[cfg(not(unix))]
    pub(crate) fn is_held_elsewhere(_: &File) -> bool {
        false
    }

    /// Is `file` what stands at `path`?
    #[cfg(unix)]
    pub(crate) fn is_same(path: &Path, file: &File) -> bool {
        use std::os::unix::fs::MetadataExt;
        let place = |m: std::fs::Metadata| (m.dev(), m.ino());
        let at_path = std::fs::symlink_metadata(path).map(place).ok();
        at_path.is_some() && at_path == file.metadata().map(place).ok()
    }

    #[cfg(not(unix))]
    pub(crate) fn wait_for(_: &File) {}

    #[cfg(not(unix))]
    pub(crate) fn is_free(_: &File) -> bool {
        false
    }

    #[cfg(not(unix))]
    pub(crate) fn is_same(path: &Path, _: &File) -> bool {
        path.exists()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |e: io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
        fs::read_dir(folder).unwrap().map(name).collect()
    }

    #[test]
    fn only_names_that_we_made_are_ours() {
        for _ in 0..100 {
            assert!(is_ours(&fresh_name()));
        }
        for name in [
            ".gdtof-",
            ".gdtof-notes",
            ".gdtof-x8Gk2P",
            ".gdtof-0000000000000001-0000000000000002",
            "gdtof.toml",
        ] {
            assert!(!is_ours(name), "{name}");
        }
    }

    #[test]
    fn a_folder_goes_while_others_write_into_it() {
        use std::sync::atomic::{AtomicBool, Ordering};
        let dir = tempfile::tempdir().unwrap();
        let is_over = AtomicBool::new(false);
        let folder = Mutex::new(dir.path().join("x"));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for number in (0..1000)
                    .cycle()
                    .take_while(|_| !is_over.load(Ordering::Relaxed))
                {
                    let place = folder.lock().unwrap().join(number.to_string());
                    let _ = fs::write(place, "half");
                }
            });
            for number in 0..200 {
                let path = dir.path().join(format!("folder {number}"));
                fs::create_dir(&path).unwrap();
                folder.lock().unwrap().clone_from(&path);
                while fs::read_dir(&path).unwrap().count() < 10 {}
                remove(&path);
                assert_eq!(names(dir.path()), [""; 0]);
            }
            is_over.store(true, Ordering::Relaxed);
        });
    }

    #[test]
    fn leftovers_go_and_everything_else_stays() {
        let dir = tempfile::tempdir().unwrap();
        let here = dir.path();
        let (live, _file) = Temporary::file_in(here).unwrap();
        let live_folder = Temporary::folder_in(here).unwrap();
        fs::write(live_folder.path.join("half"), "x").unwrap();
        let stays = [".gdtof-notes", ".gdtof-0-0", "data.csv"];
        for name in stays {
            fs::write(here.join(name), "mine").unwrap();
        }
        // What a killed run leaves: its names, and no lock.
        fs::write(here.join(fresh_name()), "half").unwrap();
        let folder = here.join(fresh_name());
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("probe.vcd"), "half").unwrap();

        sweep(here);
        let mut left = names(here);
        left.sort();
        let mut expected: Vec<String> = stays.map(String::from).to_vec();
        for path in [&live.path, &live_folder.path] {
            expected.push(path.file_name().unwrap().to_str().unwrap().to_owned());
        }
        expected.sort();
        assert_eq!(left, expected);

        drop((live, live_folder));
        assert_eq!(names(here).len(), stays.len());
    }
}
