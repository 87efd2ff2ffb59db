//! What a file of another kind is, so that a complaint can name it: by its first bytes, as its name may say anything.

use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

use femtogate::InputError;

use super::table::cells_of;
use crate::files::guarded::open_input;

/// Bytes that are looked at.
const FIRST: u64 = 1 << 16;

/// First bytes of a Parquet file.
const PARQUET: &[u8] = b"PAR1";

/// First bytes of files that only Python reads, and what they are.
const OF_PYTHON: [(&[u8], &str); 4] = [
    (PARQUET, "a Parquet file"),
    (b"\x89HDF", "an HDF5 file"),
    (b"MATLAB", "a file of MATLAB"),
    (b"PK\x03\x04", "an archive, as spreadsheets are"),
];

/// The complaint that names a file which is not of the format that was `wanted`, by its name on the command line; `None` where no more is known.
pub fn other_kind(path: &Path, wanted: &str) -> Option<InputError> {
    // A pipe has nothing left.
    if !path.is_file() {
        return None;
    }
    let mut first = Vec::new();
    let read = open_input(path).ok()?.take(FIRST).read_to_end(&mut first);
    read.ok()?;
    let extension = path.extension().and_then(|extension| extension.to_str());
    let is_named = |name: &str| extension.is_some_and(|of_path| of_path.eq_ignore_ascii_case(name));
    let message = if first.starts_with(b"\x1f\x8b") {
        let is_read = wanted == "tmf8829";
        (!is_read).then(|| "is packed by gzip; unpack it with gunzip".to_owned())
    } else if first.starts_with(b"\x93NUMPY") {
        let is_read = wanted == "counts" && is_named("npy");
        let cure = if wanted == "counts" {
            "give it such a name".to_owned()
        } else {
            other_format(wanted)
        };
        let what = "is an array of NumPy, which --format counts reads if its name ends with .npy";
        (!is_read).then(|| format!("{what}; {cure}"))
    } else if first.starts_with(b"\x89PNG") {
        Some("is a picture; give counts".to_owned())
    } else if is_named("npz") {
        None
    } else if let Some(row) = OF_PYTHON.iter().find(|(begin, _)| first.starts_with(begin)) {
        Some(of_python(path, row))
    } else {
        let text = String::from_utf8_lossy(&first);
        let (kind, format) = kind_of_text(&text)?;
        let cure = other_format(wanted);
        (format != wanted).then(|| format!("is {kind}, which --format {format} reads; {cure}"))
    };
    Some(InputError::new(path.display(), message?))
}

/// What to do with a file that another format reads.
fn other_format(wanted: &str) -> String {
    format!("give that format, or a file of --format {wanted}")
}

fn of_python(path: &Path, &(begin, kind): &(&[u8], &str)) -> String {
    let mut message = format!("is {kind}, which Python reads; ");
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    if begin == PARQUET {
        let _ = write!(
            message,
            "save its column of counts with numpy.save(\"counts.npy\", numpy.stack(pandas.read_parquet({file:?})[\"counts\"]))"
        );
    } else {
        message += "save its counts with numpy.save(\"counts.npy\", …)";
    }
    message += ", or give them to gdtof.Detector.range";
    message
}

/// What a text is, and the format that reads it.
fn kind_of_text(text: &str) -> Option<(&'static str, &'static str)> {
    let has_line = |begin: &str| text.lines().any(|line| line.starts_with(begin));
    if has_line("#Raw") {
        return Some(("a log of a TMF882x", "tmf882x"));
    }
    if has_line("Agg,") {
        return Some(("a log of compact normalised histograms", "cnh"));
    }
    if text.starts_with(['{', '[']) {
        if text.contains("\"Result_Set\"") {
            return Some(("a log of a TMF8829", "tmf8829"));
        }
        if text.contains("\"hists\"") {
            return Some(("a list of captures of a TMF8820", "tmf8820"));
        }
        if text.contains("\"scene_name\"") {
            return Some(("a report beside the histograms.npy of a frame", "frame"));
        }
        return None;
    }
    let lines = text.lines().map(str::trim);
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    let is_counts = |line: &str| {
        let cells = cells_of(line);
        cells.len() > 1 && cells.iter().all(|cell| cell.parse::<f64>().is_ok())
    };
    // A heading, a zone, and not the line that is cut off.
    let is_table = lines.take(2).any(is_counts);
    is_table.then_some(("a table of counts", "counts"))
}

#[cfg(test)]
mod tests {
    use super::super::HistogramFormat;
    use super::super::tests::read_bytes;

    #[test]
    fn a_file_of_another_kind_is_named_for_what_it_is() {
        use HistogramFormat::{Cnh, Table, Tmf882x, Tmf8829};
        let raw = b"#Raw,0,0,18,28\n";
        let agg = b"Data Count: 0\nAgg, 0, Ambient, 2.5, Bins, 0.1, 8.4\n";
        let set = b"{\"Result_Set\":[{\"info\":{}}]}";
        let table = b"# mine\nbin 0,bin 1\n1,2\n";
        for (name, bytes, format, words) in [
            (
                "a.csv",
                &raw[..],
                Table,
                "a log of a TMF882x, which --format tmf882x reads",
            ),
            ("a.csv", &agg[..], Table, "which --format cnh reads"),
            ("a.json", &set[..], Table, "which --format tmf8829 reads"),
            (
                "a.json",
                b"[{\"hists\":[[1,2]]}]",
                Tmf8829,
                "which --format tmf8820 reads",
            ),
            (
                "a.json",
                b"{\"scene_name\":\"street\"}",
                Table,
                "beside the histograms.npy of a frame, which --format frame reads",
            ),
            (
                "a.csv",
                &table[..],
                Tmf882x,
                "a table of counts, which --format counts reads",
            ),
            ("a.csv", &table[..], Cnh, "which --format counts reads"),
            ("a.csv", &table[..], Tmf8829, "which --format counts reads"),
            ("a.log", &agg[..], Tmf882x, "which --format cnh reads"),
            (
                "a.parquet",
                b"PAR1\x15",
                Table,
                "pandas.read_parquet(\"a.parquet\")",
            ),
            ("counts", b"PAR1\x15\xff", Cnh, "is a Parquet file"),
            ("a.mat", b"\x89HDF\r\n\x1a\n", Table, "is an HDF5 file"),
            (
                "a.mat",
                b"MATLAB 5.0 MAT-file\0\xff",
                Table,
                "is a file of MATLAB",
            ),
            ("a.xlsx", b"PK\x03\x04\xff", Table, "as spreadsheets are"),
            ("a.csv.gz", b"\x1f\x8b\x08\xff", Table, "with gunzip"),
            (
                "a.dat",
                b"\x93NUMPY\x01\0",
                Table,
                "if its name ends with .npy",
            ),
            ("depth.png", b"\x89PNG\r\n", Table, "is a picture"),
        ] {
            let said = read_bytes(name, bytes, format, None).unwrap_err();
            assert!(said.contains(words), "{name} {format:?}: {said}");
        }
    }

    #[test]
    fn what_is_wrong_in_a_file_of_the_wanted_kind_is_still_said() {
        for (name, bytes, format, words) in [
            (
                "a.csv",
                &b"1,2\n1,x\n"[..],
                HistogramFormat::Table,
                "`x` in bin 1",
            ),
            (
                "a.npy",
                b"\x93NUMPY\x01\0",
                HistogramFormat::Table,
                "NumPy file of counts",
            ),
            ("a.log", b"#Raw,0,0,18\n", HistogramFormat::Tmf882x, "#Raw"),
        ] {
            let said = read_bytes(name, bytes, format, None).unwrap_err();
            assert!(said.contains(words), "{name}: {said}");
        }
    }
}
