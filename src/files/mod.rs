//! Files in and out: user's input read with line numbers, output written whole or not at all.
//!
//! | file | what |
//! |---|---|
//! | `complaint.rs` | what is wrong with an input: `FILE:LINE: what is wrong; what to do` |
//! | `input.rs` | texts, read whole or line by line, and what is no text refused |
//! | `arrays.rs` | NumPy files of known shape: results that are read again, users' counts |
//! | `misfit.rs` | values of the wrong type, without the names of types |
//! | `raster.rs` | pictures and maps: PNG, `.npy`, PFM, EXR |
//! | `output.rs` | output files: beside the target first, then renamed over it |
//! | `temporary.rs` | what stands there meanwhile, and what killed runs left of it |
//! | `interruption.rs` | signals that end the program |
//! | `journal.rs` | lines with checksums that are only appended |
//! | `result_set.rs` | the results of a run as one set with a manifest |

mod arrays;
mod complaint;
mod input;
mod interruption;
mod journal;
mod misfit;
mod output;
mod raster;
mod result_set;
mod temporary;

pub(crate) use arrays::{read_array, read_counts};
pub use complaint::InputError;
pub use input::Lines;
pub(crate) use input::{LineEnds, parse_json, parse_toml, read_text, read_text_within, too_long};
pub(crate) use interruption::clean_up_when_interrupted;
pub(crate) use journal::{Journal, JournalReader, journal_line};
pub use misfit::in_plain_words;
pub(crate) use misfit::{Misfit, is_no_word};
pub use output::{OutputFile, create_folder};
pub use raster::Raster;
pub use result_set::{MANIFEST, ManifestFile, ResultSet};
