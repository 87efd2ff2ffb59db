//! Files in and out: user's input read with line numbers, output written whole or not at all.
//!
//! | file | what |
//! |---|---|
//! | `input.rs` | texts, read whole or line by line, and what is no text refused |
//! | `arrays.rs` | NumPy files of known shape: results that are read again, users' counts |
//! | `npy.rs` | NumPy files: head and elements |
//! | `histograms/` | histograms of any sensor: tables, arrays, logs of evaluation kits |
//! | `misfit.rs` | values of the wrong type, without the names of types |
//! | `no_toml.rs` | settings that are no TOML, and files of other kinds in their place |
//! | `raster.rs` | pictures and maps: PNG, `.npy`, PFM, EXR |
//! | `open.rs` | files opened to be read, and what need not end refused |
//! | `output.rs` | output files: beside the target first, then renamed over it |
//! | `guarded.rs` | inputs of a run, which it does not replace, and files in its way that are not its own |
//! | `temporary.rs` | what stands there meanwhile, and what killed runs left of it |
//! | `interruption.rs` | signals that end the program |
//! | `journal.rs` | lines with checksums that are only appended |
//! | `manifest.rs` | files of a set of results with their hashes |
//! | `result_set.rs` | the results of a run as one set with a manifest |

mod arrays;
mod guarded;
mod histograms;
mod input;
mod interruption;
mod journal;
mod manifest;
mod misfit;
mod no_toml;
mod npy;
mod open;
mod output;
mod raster;
mod result_set;
mod temporary;

pub use arrays::{read_array, read_counts};
pub use femtogate::{InputError, in_words, instead_of, nearest};
pub use guarded::{
    begins_with, guard_inputs, open_input, refuse_input, said_of_kept_files, set_aside_foreign,
};
pub use histograms::{HistogramFormat, ZoneCounts, ZoneHistograms, other_kind};
pub use input::Lines;
pub(crate) use input::MOST_TOML_BYTES;
pub use input::{
    LineEnds, parse_json, parse_toml, placed, read_text, read_text_within, skip_mark, too_long,
};
pub use interruption::clean_up_when_interrupted;
pub use journal::{Journal, JournalReader, is_journal, journal_line};
pub use manifest::{MANIFEST, ManifestFile, file_hash};
pub use misfit::Misfit;
pub use misfit::in_plain_words;
pub(crate) use misfit::{is_no_word, unknown_word};
pub use npy::{
    Element, NpyHead, Number, write_npy, write_npy_elements, write_npy_head, write_npy_records_head,
};
pub use open::open_file;
pub use output::{OutputFile, create_folder};
pub use raster::Raster;
pub use result_set::ResultSet;
