//! The readers of `gdtof::cli::READERS` under libFuzzer; the environment variable `READER` names one. `fuzz/run` builds and runs it.

#![no_main]

use std::alloc::System;
use std::path::PathBuf;
use std::sync::LazyLock;

use cap::Cap;
use cpu_time::ThreadTime;
use gdtof::cli::{READERS, Reader};
use libfuzzer_sys::fuzz_target;

/// What takes more than 200 MB at once is a crash.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 200_000_000);

static READER: LazyLock<(Reader, PathBuf)> = LazyLock::new(|| {
    let name = std::env::var("READER").expect("READER names a reader");
    let found = READERS.iter().find(|(known, _)| *known == name);
    let &(_, reader) = found.unwrap_or_else(|| panic!("there is no reader {name}"));
    let folder = std::env::temp_dir().join(format!("fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    (reader, folder.join("input"))
});

fuzz_target!(|input: &[u8]| {
    let (reader, path) = &*READER;
    std::fs::write(path, input).expect("a temporary file");
    let begun = ThreadTime::now();
    if let Err(refusal) = reader(path) {
        assert!(!refusal.is_empty());
    }
    let took_s = begun.elapsed().as_secs_f64();
    assert!(took_s < 1.0, "{took_s} s");
});
