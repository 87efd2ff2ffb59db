//! A page to look at a frame or a drive: one HTML file that needs no network.
//!
//! ```text
//!   frame.json, histograms.npy ─┐                       ┌─► meta: names, windows, numbers (JSON)
//!                               ├─► Recording ─► packed ┤                                        ─► page.html
//!   drive.json, *.npy ──────────┘                       └─► frames: arrays, gzip, base64
//! ```
//!
//! | file | what |
//! |---|---|
//! | `recording.rs` | what a folder holds, frame by frame |
//! | `packed.rs` | that as text for the page, with what is worked out from it: windows, fits, camera views |
//! | `html.rs` | the parts put together |
//! | `page.html`, `page.css`, `*.js` | what runs in the browser |
//! | `plotly.min.js` | plotly.js 3.7.0 with scatter, heatmap and scatter3d alone (MIT); `plotly_bundle.js` says how it is made |

mod html;
mod packed;
mod recording;

use std::path::Path;

use self::packed::Packed;
use self::recording::Recording;
use crate::files::{InputError, OutputFile, begins_with, set_aside_foreign};

/// The page of what `gdtof frame` or `gdtof drive` has left in `folder`.
#[derive(Debug)]
pub struct Page {
    html: String,
    /// Frames that it shows.
    pub frames: usize,
}

impl Page {
    /// Reads `folder` and puts the page together. `called` is what commands in the page call the folder; of a drive, each
    /// `every`-th frame is shown.
    ///
    /// # Errors
    /// A folder that holds neither a frame nor a drive of this version, and files in it that cannot be read.
    pub fn read(folder: &Path, called: &Path, every: usize) -> Result<Self, InputError> {
        let recording = Recording::read(folder, every)?;
        let packed = Packed::new(&recording, called)?;
        Ok(Page {
            html: html::assemble(&packed),
            frames: packed.frames.len(),
        })
    }

    /// Bytes of the file.
    pub fn size(&self) -> usize {
        self.html.len()
    }

    /// Writes it. A file of that name that is no such page is set aside.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), InputError> {
        set_aside_foreign(path, begins_with(html::SIGNATURE))?;
        OutputFile::write_text(path, &self.html)
    }
}
