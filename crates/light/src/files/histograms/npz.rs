//! An array in an archive of NumPy: a zip file whose members are `.npy` files, stored (`np.savez`) or deflated (`np.savez_compressed`).
//!
//! ```text
//!   member 0 │ member 1 │ … │ directory: name, method, sizes, place of each member │ end: place of the directory
//! ```
//!
//! Sizes are taken from the directory, because NumPy leaves them out before a member. Source: PKWARE, .ZIP File Format Specification 6.3.

use std::io::Read;
use std::path::Path;

use femtogate::{InputError, in_words};
use flate2::Crc;
use flate2::read::DeflateDecoder;

use crate::files::guarded::open_input;

/// The longest end of an archive: a head, and a remark of 65 535 bytes.
const LONGEST_END: usize = 22 + 65_535;

/// Names of an array that is taken from among others.
const COUNTS: [&str; 2] = ["counts", "histograms"];

/// A member, as the directory has it.
struct Member {
    /// Without `.npy`.
    name: String,
    method: u16,
    crc: u32,
    stored_bytes: usize,
    bytes: usize,
    place: usize,
}

/// The bytes of the `.npy` file of counts in an archive.
///
/// # Errors
/// What is no archive, has several arrays of which none is named for counts, or is damaged.
pub(super) fn read_counts(path: &Path) -> Result<Vec<u8>, InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let mut archive = Vec::new();
    open_input(path)?
        .read_to_end(&mut archive)
        .map_err(|error| complain(format!("cannot be read ({})", in_words(&error))))?;
    let members = members(&archive)
        .ok_or_else(|| complain("is no archive of NumPy; give a .npz or a .npy".into()))?;
    let is_counts = |member: &&Member| COUNTS.contains(&member.name.as_str());
    let named: Vec<&Member> = members.iter().filter(is_counts).collect();
    let member = match (&named[..], &members[..]) {
        ([named], _) => named,
        ([], [only]) => only,
        (_, []) => return Err(complain("has no array; give a .npz with counts".into())),
        (_, several) => {
            let names: Vec<&str> = several.iter().map(|member| &member.name[..]).collect();
            let names = names.join(", ");
            return Err(complain(format!(
                "has the arrays {names}; name only the one with the counts `counts`"
            )));
        }
    };
    contents(&archive, member).ok_or_else(|| {
        let name = &member.name;
        complain(format!("has a damaged array `{name}`; save it again"))
    })
}

fn number<const N: usize>(bytes: &[u8], place: usize) -> Option<usize> {
    let bytes = bytes.get(place..place.checked_add(N)?)?;
    let shifted = bytes.iter().enumerate();
    Some(shifted.fold(0, |sum, (at, &byte)| sum | usize::from(byte) << (8 * at)))
}

/// The arrays of an archive; `None` of what is none.
fn members(archive: &[u8]) -> Option<Vec<Member>> {
    let from = archive.len().saturating_sub(LONGEST_END);
    let is_end = |four: &[u8]| four == b"PK\x05\x06";
    let end = from + archive[from..].windows(4).rposition(is_end)?;
    let mut at = number::<4>(archive, end + 16)?;
    let mut members = Vec::new();
    for _ in 0..number::<2>(archive, end + 10)? {
        if archive.get(at..at + 4)? != b"PK\x01\x02" {
            return None;
        }
        let name_bytes = number::<2>(archive, at + 28)?;
        let name = archive.get(at + 46..at + 46 + name_bytes)?;
        let member = Member {
            name: String::from_utf8_lossy(name).into_owned(),
            method: number::<2>(archive, at + 10)? as u16,
            crc: number::<4>(archive, at + 16)? as u32,
            stored_bytes: number::<4>(archive, at + 20)?,
            bytes: number::<4>(archive, at + 24)?,
            place: number::<4>(archive, at + 42)?,
        };
        if let Some(name) = member.name.strip_suffix(".npy") {
            let name = name.to_owned();
            members.push(Member { name, ..member });
        }
        at += 46 + name_bytes + number::<2>(archive, at + 30)? + number::<2>(archive, at + 32)?;
    }
    Some(members)
}

/// What a member holds; `None` if it is damaged or packed otherwise.
fn contents(archive: &[u8], member: &Member) -> Option<Vec<u8>> {
    let place = member.place;
    if archive.get(place..place.checked_add(4)?)? != b"PK\x03\x04" {
        return None;
    }
    let names = number::<2>(archive, place + 26)? + number::<2>(archive, place + 28)?;
    let begins = place + 30 + names;
    let stored = archive.get(begins..begins.checked_add(member.stored_bytes)?)?;
    let contents = match member.method {
        0 => stored.to_vec(),
        8 => {
            let mut contents = Vec::new();
            // No more than it should be, however far it would unfold.
            let mut unpacked = DeflateDecoder::new(stored).take(member.bytes as u64 + 1);
            unpacked.read_to_end(&mut contents).ok()?;
            contents
        }
        _ => return None,
    };
    let mut crc = Crc::new();
    crc.update(&contents);
    (contents.len() == member.bytes && crc.sum() == member.crc).then_some(contents)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::DeflateEncoder;

    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;
    use super::*;
    use crate::files::write_npy;

    fn array(counts: &[u32]) -> Vec<u8> {
        let mut file = Vec::new();
        write_npy(&mut file, &[counts.len() / 2, 2], counts).unwrap();
        file
    }

    /// An archive as NumPy writes it: sizes before a member are left out.
    fn archive(members: &[(&str, Vec<u8>)], is_packed: bool) -> Vec<u8> {
        let (mut file, mut directory) = (Vec::new(), Vec::new());
        let two = |number: usize| (number as u16).to_le_bytes();
        let four = |number: usize| (number as u32).to_le_bytes();
        for (name, contents) in members {
            let mut crc = Crc::new();
            crc.update(contents);
            let stored = if is_packed {
                let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
                packed.write_all(contents).unwrap();
                packed.finish().unwrap()
            } else {
                contents.clone()
            };
            let method = if is_packed { 8 } else { 0 };
            directory.extend(b"PK\x01\x02\x2d\x00\x2d\x00\x00\x00");
            directory.extend(two(method));
            directory.extend([0; 4]);
            directory.extend(crc.sum().to_le_bytes());
            directory.extend(four(stored.len()));
            directory.extend(four(contents.len()));
            directory.extend(two(name.len()));
            directory.extend([0; 12]);
            directory.extend(four(file.len()));
            directory.extend(name.as_bytes());
            file.extend(b"PK\x03\x04\x2d\x00\x00\x00");
            file.extend(two(method));
            file.extend([0; 4]);
            file.extend(crc.sum().to_le_bytes());
            file.extend([255; 8]);
            file.extend(two(name.len()));
            file.extend(two(4));
            file.extend(name.as_bytes());
            file.extend([1, 0, 0, 0]);
            file.extend(stored);
        }
        let place = file.len();
        file.extend(&directory);
        file.extend(b"PK\x05\x06\x00\x00\x00\x00");
        file.extend(two(members.len()));
        file.extend(two(members.len()));
        file.extend(four(directory.len()));
        file.extend(four(place));
        file.extend(two(0));
        file
    }

    fn read(file: &[u8]) -> Result<Vec<u32>, String> {
        let read = read_bytes("counts.npz", file, HistogramFormat::Table, None);
        read.map(|read| read.captures[0].counts.clone())
    }

    #[test]
    fn the_only_array_or_the_one_of_counts_is_read() {
        let [counts, other] = [[1, 2, 3, 4], [9, 9, 9, 9]].map(|counts| array(&counts));
        for is_packed in [false, true] {
            let only = archive(&[("arr_0.npy", counts.clone())], is_packed);
            assert_eq!(read(&only), Ok(vec![1, 2, 3, 4]));
            let named = [("time.npy", other.clone()), ("counts.npy", counts.clone())];
            assert_eq!(read(&archive(&named, is_packed)), Ok(vec![1, 2, 3, 4]));
            let others = [("a.npy", other.clone()), ("b.npy", counts.clone())];
            let said = read(&archive(&others, is_packed)).unwrap_err();
            assert!(said.contains("has the arrays a, b; name only"), "{said}");
            let both = [
                ("counts.npy", other.clone()),
                ("histograms.npy", counts.clone()),
            ];
            assert!(read(&archive(&both, is_packed)).is_err());
        }
        assert!(
            read(&archive(&[], false))
                .unwrap_err()
                .contains("has no array")
        );
        assert!(read(b"PK").unwrap_err().contains("no archive of NumPy"));
    }

    #[test]
    fn no_damaged_byte_is_a_panic_or_other_counts() {
        for is_packed in [false, true] {
            let whole = archive(&[("counts.npy", array(&[5, 6, 7, 8]))], is_packed);
            for at in 0..whole.len() {
                for bit in [0, 3, 7] {
                    let mut damaged = whole.clone();
                    damaged[at] ^= 1 << bit;
                    if let Ok(counts) = read(&damaged) {
                        assert_eq!(counts, [5, 6, 7, 8], "byte {at}");
                    }
                }
                let _ = read(&whole[..at]);
            }
        }
    }
}
