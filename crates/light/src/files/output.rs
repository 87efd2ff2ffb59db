//! Output files, there whole or not at all.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::guarded::{refuse_input, refuse_to_replace};
use super::temporary::Temporary;
use femtogate::InputError;

/// A buffered output file that appears under its name only when [`OutputFile::commit`] succeeds.
pub struct OutputFile {
    path: PathBuf,
    writer: BufWriter<File>,
    temporary: Temporary,
}

impl OutputFile {
    /// Starts a file beside `path`.
    ///
    /// # Errors
    /// When the folder does not exist or is not writable, `path` is a folder, a file that this run has read, or one of a
    /// set of results.
    pub fn create(path: &Path) -> Result<Self, InputError> {
        let unwritable = |e: io::Error| InputError::unwritable(path, &e);
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        refuse_to_replace(path)?;
        let (temporary, file) = Temporary::file_in(folder).map_err(unwritable)?;
        Ok(OutputFile {
            path: path.to_owned(),
            writer: BufWriter::with_capacity(1 << 20, file),
            temporary,
        })
    }

    /// Flushes and moves the file to its final name.
    ///
    /// # Errors
    /// When the disk is full, the target cannot be replaced or has been read meanwhile; the target is then untouched.
    pub fn commit(mut self) -> Result<(), InputError> {
        refuse_input(&self.path)?;
        let unwritable = |e: io::Error| InputError::unwritable(&self.path, &e);
        self.writer.flush().map_err(unwritable)?;
        self.temporary.rename(&self.path).map_err(unwritable)
    }

    /// Writes a text as a whole file.
    ///
    /// # Errors
    /// As [`OutputFile::write_with`].
    pub fn write_text(path: &Path, text: &str) -> Result<(), InputError> {
        Self::write_with(path, |out| out.write_all(text.as_bytes()))
    }

    /// Writes a whole file through `fill`.
    ///
    /// # Errors
    /// As [`OutputFile::create`] and [`OutputFile::commit`], or an I/O error of `fill`.
    pub fn write_with(
        path: &Path,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), InputError> {
        Self::prepared(path, fill)?.commit()
    }

    /// Writes a whole file through `fill`, which may go back in it.
    ///
    /// # Errors
    /// As [`OutputFile::write_with`].
    pub fn create_with(
        path: &Path,
        fill: impl FnOnce(&mut Self) -> io::Result<()>,
    ) -> Result<(), InputError> {
        let mut file = Self::create(path)?;
        fill(&mut file).map_err(|e| InputError::unwritable(path, &e))?;
        file.commit()
    }

    /// Writes a whole file through `fill`, for the caller to commit: of several files, all appear or none.
    ///
    /// # Errors
    /// As [`OutputFile::create`], or an I/O error of `fill`.
    pub fn prepared(
        path: &Path,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Self, InputError> {
        let mut file = Self::create(path)?;
        let filled = fill(&mut file.writer).and_then(|()| file.writer.flush());
        filled.map_err(|e| InputError::unwritable(path, &e))?;
        Ok(file)
    }
}

impl Write for OutputFile {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.writer.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// Formats that tell at the beginning what is known at the end go back for it.
impl Seek for OutputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer.seek(to)
    }
}

impl Read for OutputFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.writer.flush()?;
        self.writer.get_mut().read(buffer)
    }
}

/// Makes sure a folder for output exists.
///
/// # Errors
/// When it cannot be made.
pub fn create_folder(path: &Path) -> Result<(), InputError> {
    if path.exists() && !path.is_dir() {
        let message = "is not a folder; give the name of one, or of one to be made";
        return Err(InputError::new(path.display(), message));
    }
    std::fs::create_dir_all(path).map_err(|e| InputError::unwritable(path, &e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.txt");
        std::fs::write(&path, "old").unwrap();
        let failed = OutputFile::write_with(&path, |w| {
            w.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        OutputFile::write_with(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_a_clear_sentence() {
        let e = OutputFile::create(Path::new("/nonexistent/dir/x"))
            .err()
            .unwrap();
        assert!(
            e.to_string()
                .contains("/nonexistent/dir/x: cannot be written"),
            "{e}"
        );
    }
}
