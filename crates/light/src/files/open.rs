//! Files opened to be read.
//!
//! [`open_file`] is the only place where files are opened to be read; clippy refuses others. It takes nothing that need not end.

use std::fs::{self, File};
use std::path::Path;

use femtogate::InputError;

/// Opens a file to be read. A pipe without a place in the file system, as of `<(...)` or of standard input, is one: its other
/// end is held by a process that the user has just started.
///
/// # Errors
/// A named pipe, a device, a folder, and what cannot be opened.
pub fn open_file(path: &Path) -> Result<File, InputError> {
    if path.as_os_str().is_empty() {
        return Err(InputError::new("\"\"", "is no name of a file; give one"));
    }
    let unreadable = |e| InputError::unreadable(path, &e);
    let kind = fs::metadata(path).map_err(unreadable)?.file_type();
    let complain = |message: String| Err(InputError::new(path.display(), message));
    if kind.is_dir() {
        return complain("is a folder; give a file".into());
    }
    if let Some(what) = endless(path, kind) {
        let cure = "which may never end; write its contents to a file first";
        return complain(format!("is {what}, {cure}"));
    }
    #[expect(clippy::disallowed_methods, reason = "this is the one place")]
    File::open(path).map_err(unreadable)
}

/// What something is whose end nobody knows.
#[cfg(unix)]
fn endless(path: &Path, kind: fs::FileType) -> Option<&'static str> {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_fifo() && path.canonicalize().is_ok() {
        Some("a named pipe")
    } else if kind.is_char_device() || kind.is_block_device() {
        Some("a device")
    } else if kind.is_socket() {
        Some("a socket")
    } else {
        None
    }
}

#[cfg(not(unix))]
fn endless(_: &Path, _: fs::FileType) -> Option<&'static str> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn what_may_never_end_is_not_opened() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let made = std::process::Command::new("mkfifo")
            .arg(path("pipe"))
            .status();
        assert!(made.unwrap().success());
        symlink(path("pipe"), path("link")).unwrap();
        symlink("/dev/zero", path("zero")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        for (name, says) in [
            ("pipe", "is a named pipe"),
            ("link", "is a named pipe"),
            ("zero", "is a device"),
            ("socket", "is a socket"),
            ("", "is a folder"),
        ] {
            let refused = open_file(&path(name)).unwrap_err().to_string();
            assert!(refused.contains(says), "{refused}");
        }
        fs::write(path("file"), "").unwrap();
        assert!(open_file(&path("file")).is_ok());
    }
}
