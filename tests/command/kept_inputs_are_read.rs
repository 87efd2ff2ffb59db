//! Inputs that the fuzzer found or began with: every one is read or refused, soon. `fuzz/run` finds more.

use std::fs;
use std::path::Path;

use cpu_time::ThreadTime;
use gdtof::cli::READERS;

#[test]
fn every_kept_input_is_read_or_refused() {
    let here = tempfile::tempdir().unwrap();
    let corpora = Path::new("vectors/fuzz");
    let mut folders = fs::read_dir(corpora)
        .unwrap()
        .map(|folder| folder.unwrap().file_name());
    let reader_of = |name: &str| READERS.iter().any(|(known, _)| *known == name);
    assert!(folders.all(|name| reader_of(name.to_str().unwrap())));
    for (name, reader) in READERS {
        let mut read = 0;
        for input in fs::read_dir(corpora.join(name)).unwrap() {
            let input = input.unwrap().path();
            let path = here.path().join("input");
            fs::copy(&input, &path).unwrap();
            let begun = ThreadTime::now();
            match reader(&path) {
                Ok(()) => read += 1,
                Err(refusal) => assert!(!refusal.is_empty(), "{}", input.display()),
            }
            let took_s = begun.elapsed().as_secs_f64();
            assert!(took_s < 5.0, "{} takes {took_s} s", input.display());
        }
        assert!(read > 0, "nothing of {name} is read");
    }
}
