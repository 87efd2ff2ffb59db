//! A netlist that stands in the place of a built-in block, by the file that it is read from. What it must be, and what it does, is told
//! by what stands above it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::files::read_text_within;
use crate::liberty::Liberty;
use crate::netlist::Module;
use crate::settings::{Range, Setting};

/// Most bytes of a file: more than [`Module::from_yosys`] takes, which then says so.
const MOST_BYTES: usize = 32 << 20;

/// A netlist in the place of a built-in block, by the file that it is read from: FILE, or FILE:MODULE.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(from = "PathBuf", into = "PathBuf")]
pub struct OwnBlock {
    file: PathBuf,
    read: Option<Arc<Read>>,
}

#[derive(Debug)]
struct Read {
    module: Arc<Module>,
    /// Of the file's text and the module's name.
    hash: u64,
}

impl From<PathBuf> for OwnBlock {
    fn from(file: PathBuf) -> Self {
        OwnBlock { file, read: None }
    }
}

impl From<OwnBlock> for PathBuf {
    fn from(block: OwnBlock) -> Self {
        block.file
    }
}

/// Blocks are equal if they come from the same file, which said the same.
impl PartialEq for OwnBlock {
    fn eq(&self, other: &Self) -> bool {
        self.file == other.file && self.hash() == other.hash()
    }
}

/// FILE and MODULE.
fn parts(asked: &Path) -> (&Path, Option<&str>) {
    match asked.to_str().and_then(|asked| asked.rsplit_once(':')) {
        Some((file, top)) if !asked.exists() => (Path::new(file), Some(top)),
        _ => (asked, None),
    }
}

impl Setting for OwnBlock {
    const RANGE: Range = Range::Text;
}

impl OwnBlock {
    /// A block that is read already.
    pub fn from_module(file: impl Into<PathBuf>, module: Arc<Module>, text: &str) -> Self {
        let mut hasher = DefaultHasher::new();
        (text, module.name()).hash(&mut hasher);
        let read = Read {
            module,
            hash: hasher.finish(),
        };
        OwnBlock {
            file: file.into(),
            read: Some(Arc::new(read)),
        }
    }

    /// Reads its file, which is relative to `folder`; its cells may be those of a library.
    ///
    /// # Errors
    /// What is wrong with the file, with its name.
    pub(in crate::chip) fn load(
        &mut self,
        folder: &Path,
        library: Option<&Liberty>,
    ) -> Result<(), String> {
        let asked = folder.join(&self.file);
        let (file, top) = parts(&asked);
        let text = read_text_within(file, MOST_BYTES).map_err(|e| e.to_string())?;
        let module = Module::from_yosys_of(&text, top, library);
        let module = module.map_err(|e| format!("{}: {e}", file.display()))?;
        // What cells of a library do, the library says.
        let library_name = library.map_or(String::new(), |library| library.name.clone());
        *self = OwnBlock::from_module(asked, module, &(text + &library_name));
        Ok(())
    }

    /// Where it comes from: FILE, or FILE:MODULE.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The file alone.
    pub fn path(&self) -> &Path {
        parts(&self.file).0
    }

    /// Tells netlists apart, where the block has been read.
    pub fn hash(&self) -> Option<u64> {
        self.read.as_ref().map(|read| read.hash)
    }

    /// The circuit of the block called `name`: that of `own`, or else the built-in one.
    pub(in crate::chip) fn or(
        own: Option<&Self>,
        name: &str,
        built_in: impl FnOnce() -> Arc<Module>,
    ) -> Arc<Module> {
        own.map_or_else(built_in, |own| {
            let read = own.read.as_ref().expect("it has been checked");
            read.module.renamed(name)
        })
    }

    /// Its circuit, once it has been read.
    pub(super) fn module(&self) -> Option<&Arc<Module>> {
        self.read.as_ref().map(|read| &read.module)
    }
}
