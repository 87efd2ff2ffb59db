//! The text of a Liberty file: plain, or packed by gzip in one member or several, as `pigz`, `bgzip` and `cat` leave them.
//!
//! Whether a file is packed is told by its first bytes, not by its name.

use std::io::{Cursor, Read};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::files::{InputError, open_input};
use crate::liberty::liberty_text;

/// Most bytes of a library: the largest open ones have 60 MB a corner.
const MOST_BYTES: u64 = 512 << 20;

/// What a packed file begins with (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The text of a library.
///
/// # Errors
/// A file that cannot be read, is too large or no text.
pub(super) fn read_library(path: &Path) -> Result<String, String> {
    let said = |error| InputError::unreadable(path, &error).message;
    let mut file = open_input(path).map_err(|error| error.message)?;
    let mut head = Vec::new();
    (&mut file).take(2).read_to_end(&mut head).map_err(said)?;
    let is_packed = head == GZIP;
    let whole = Cursor::new(head).chain(file);
    let mut unpacked: Box<dyn Read> = if is_packed {
        Box::new(MultiGzDecoder::new(whole))
    } else {
        Box::new(whole)
    };
    let mut bytes = Vec::new();
    let no_text = || "is not text; give a Liberty file, .lib or .lib.gz".to_owned();
    loop {
        let part = (&mut unpacked).take(1 << 20).read_to_end(&mut bytes);
        let part = part.map_err(said)?;
        if part == 0 {
            return liberty_text(bytes).ok_or_else(no_text);
        }
        // What is no text is not read to its end, which it need not have.
        if bytes[bytes.len() - part..].contains(&0) {
            return Err(no_text());
        }
        if bytes.len() as u64 > MOST_BYTES {
            return Err(format!(
                "has more than {} MB; give a library of one corner",
                MOST_BYTES >> 20
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;

    #[test]
    fn packed_files_are_known_by_their_bytes_and_have_several_members() {
        let member = |text: &str| {
            let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
            packer.write_all(text.as_bytes()).unwrap();
            packer.finish().unwrap()
        };
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            read_library(&path)
        };
        let two = [member("library (a) "), member("{ }")].concat();
        for name in ["a.lib.gz", "a.lib"] {
            assert_eq!(read(name, &two).as_deref(), Ok("library (a) { }"));
        }
        assert_eq!(
            read("b.lib.gz", b"library (b)").as_deref(),
            Ok("library (b)")
        );
        assert_eq!(read("c.lib", b"").as_deref(), Ok(""));
        assert_eq!(read("d.lib", b"/* \xe9 */").as_deref(), Ok("/* é */"));
        let cut = read("e.lib", &two[..two.len() - 9]).unwrap_err();
        assert!(cut.starts_with("cannot be read"), "{cut}");
        let binary = read("f.db", b"li\0brary").unwrap_err();
        assert!(binary.starts_with("is not text"), "{binary}");
    }
}
