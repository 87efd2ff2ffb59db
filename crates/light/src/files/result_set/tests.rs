//! Sets of results: what they replace, keep and name, and what a run that is killed leaves.

use super::*;

fn commit_files(folder: &Path, files: &[(&str, &str)]) -> Vec<String> {
    let set = ResultSet::begin(folder, "test").unwrap();
    for (name, text) in files {
        fs::write(set.staging().join(name), text).unwrap();
    }
    set.commit(serde_json::json!({"files": files.len()}))
        .unwrap()
}

fn listing(folder: &Path) -> Vec<(String, String)> {
    let mut files: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read_to_string(entry.path()).unwrap())
        })
        .filter(|(name, _)| name != MANIFEST)
        .collect();
    files.sort();
    files
}

fn owned(files: &[(&str, &str)]) -> Vec<(String, String)> {
    files
        .iter()
        .map(|(n, t)| (n.to_string(), t.to_string()))
        .collect()
}

#[test]
fn a_set_that_is_given_up_leaves_no_folder_but_one_that_was_there() {
    let dir = tempfile::tempdir().unwrap();
    let (new, old) = (dir.path().join("new"), dir.path().join("old"));
    fs::create_dir(&old).unwrap();
    for out in [&new, &old] {
        let set = ResultSet::begin(out, "test").unwrap();
        fs::write(set.staging().join("a"), "half").unwrap();
    }
    assert!(!new.exists() && old.exists());
}

#[test]
fn a_set_replaces_the_one_before_it() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    assert!(commit_files(&out, &[("a", "1"), ("probe_1", "x"), ("probe_2", "y")]).is_empty());
    fs::write(out.join("notes.txt"), "mine").unwrap();
    assert!(commit_files(&out, &[("a", "2"), ("probe_3", "z")]).is_empty());
    let expected = [("a", "2"), ("notes.txt", "mine"), ("probe_3", "z")];
    assert_eq!(listing(&out), owned(&expected));
    let manifest = Manifest::read(&out).unwrap();
    assert!(manifest.complete);
    let known = ManifestFile::from_file(&out, "a").unwrap();
    assert_eq!(manifest.files[0], known);
    // sha256sum of "2".
    assert_eq!(
        known.sha256,
        "d4735e3a265e16eee03f59718b9b5d03019c07d8b6c51f90da3a666eec13ab35"
    );
}

#[test]
fn a_set_beside_others_keeps_those_without_a_successor() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    commit_files(&out, &[("a", "1"), ("b", "2")]);
    fs::write(out.join("b"), "mine").unwrap();
    let set = ResultSet::begin(&out, "test").unwrap().beside_others();
    fs::write(set.staging().join("c"), "3").unwrap();
    assert_eq!(set.commit(()).unwrap().len(), 1);
    assert_eq!(
        listing(&out),
        owned(&[("a", "1"), ("b", "mine"), ("c", "3")])
    );
    let names = Manifest::read(&out).unwrap().files;
    let names: Vec<&str> = names.iter().map(|file| &*file.name).collect();
    assert_eq!(names, ["c", "a"]);
}

#[test]
fn a_file_that_says_the_same_is_not_set_aside() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a"), "1").unwrap();
    assert!(commit_files(dir.path(), &[("a", "1")]).is_empty());
    assert_eq!(listing(dir.path()), owned(&[("a", "1")]));
}

#[test]
fn what_the_user_changed_or_made_is_kept_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path();
    fs::write(out.join("a.png"), "mine, before any run").unwrap();
    fs::write(out.join(MANIFEST), "{\"mine\": 1}").unwrap();
    let said = commit_files(out, &[("a.png", "1"), ("b", "1"), ("old", "1")]);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].contains("a.kept.png"), "{said:?}");

    fs::write(out.join("a.png"), "2 by the user").unwrap();
    fs::write(out.join("old"), "2").unwrap();
    let said = commit_files(out, &[("a.png", "3"), ("b", "3")]);
    assert_eq!(said.len(), 2, "{said:?}");
    let expected = [
        ("a.kept-2.png", "2 by the user"),
        ("a.kept.png", "mine, before any run"),
        ("a.png", "3"),
        ("b", "3"),
        ("manifest.kept.json", "{\"mine\": 1}"),
        ("old", "2"),
    ];
    assert_eq!(listing(out), owned(&expected));
}

#[test]
fn a_switch_that_was_killed_says_so_and_is_put_right_by_the_next() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path();
    commit_files(out, &[("a", "old a"), ("b", "old b"), ("probe", "old")]);
    // As far as a killed switch came: the manifest of both, and one of two files.
    let mut manifest = Manifest::read(out).unwrap();
    manifest.complete = false;
    manifest.previous_files = std::mem::take(&mut manifest.files);
    fs::write(out.join("a"), "new a").unwrap();
    manifest.files = vec![ManifestFile::from_file(out, "a").unwrap()];
    manifest.write(&out.join(MANIFEST)).unwrap();

    assert!(commit_files(out, &[("a", "newer a"), ("b", "newer b")]).is_empty());
    assert_eq!(listing(out), owned(&[("a", "newer a"), ("b", "newer b")]));
    assert!(Manifest::read(out).unwrap().complete);
}

#[test]
fn a_set_of_another_command_is_refused_and_untouched() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path();
    commit_files(out, &[("a", "1")]);
    let before = fs::read_dir(out).unwrap().count();
    let refused = ResultSet::begin(out, "other").unwrap_err().to_string();
    assert!(refused.contains("results of `gdtof test`"), "{refused}");
    assert_eq!(fs::read_dir(out).unwrap().count(), before);

    // Begun before that set was there.
    let new = out.join("new");
    let set = ResultSet::begin(&new, "other").unwrap();
    fs::write(set.staging().join("a"), "2").unwrap();
    commit_files(&new, &[("a", "1")]);
    assert!(set.commit(()).is_err());
    assert_eq!(listing(&new), owned(&[("a", "1")]));

    // Nor does a single file take the place of one of its files.
    let refused = super::super::OutputFile::create(&new.join("a"))
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("one of the results of `gdtof test`"),
        "{refused}"
    );
    assert!(super::super::OutputFile::create(&new.join("b")).is_ok());
}

#[test]
fn a_set_that_is_not_committed_leaves_the_old_one() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path();
    commit_files(out, &[("a", "1")]);
    let set = ResultSet::begin(out, "test").unwrap();
    fs::write(set.staging().join("a"), "2").unwrap();
    drop(set);
    assert_eq!(listing(out), owned(&[("a", "1")]));

    // A name that is a folder cannot be replaced, and nothing else is then.
    fs::create_dir(out.join("b")).unwrap();
    let set = ResultSet::begin(out, "test").unwrap();
    for name in ["a", "b"] {
        fs::write(set.staging().join(name), "3").unwrap();
    }
    let error = set.commit(()).unwrap_err().to_string();
    assert!(error.contains("b is a folder"), "{error}");
    fs::remove_dir(out.join("b")).unwrap();
    assert_eq!(listing(out), owned(&[("a", "1")]));
}

#[test]
fn a_manifest_that_points_elsewhere_removes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    commit_files(&out, &[("a", "1")]);
    fs::write(dir.path().join("a"), "1").unwrap();
    let text = fs::read_to_string(out.join(MANIFEST)).unwrap();
    let text = text.replace("\"name\": \"a\"", "\"name\": \"../a\"");
    fs::write(out.join(MANIFEST), text).unwrap();
    commit_files(&out, &[("b", "1")]);
    assert_eq!(fs::read_to_string(dir.path().join("a")).unwrap(), "1");
}
