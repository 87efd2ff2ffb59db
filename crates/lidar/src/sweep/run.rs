//! Takes the points of a study that its folder has no rows of, on all threads.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use super::error::SweepError;
use super::row::{Index, journals_in};
use super::study::{Study, StudyKind};
use super::subject::{Scratch, Subject};
use crate::engine::Answer;
use crate::files::{
    InputError, Journal, OutputFile, ResultSet, create_folder, is_journal, parse_json, read_text,
    refuse_input, set_aside_foreign,
};

/// One of `of` parts of a study: the points whose number leaves `part` when divided by `of`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    pub part: u64,
    /// At least 1.
    pub parts: u64,
}

impl Shard {
    /// The whole.
    pub const WHOLE: Shard = Shard { part: 0, parts: 1 };

    fn journal(self) -> String {
        match self.parts {
            1 => "journal.log".into(),
            of => format!("journal-{}-of-{of}.log", self.part + 1),
        }
    }

    /// How many of `points` points are its own.
    pub fn share(self, points: u64) -> u64 {
        points.saturating_sub(self.part).div_ceil(self.parts)
    }
}

/// What became of the points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Outcome {
    /// Points of the study, or of its shard.
    pub points: u64,
    /// Those whose rows were there.
    pub reused: u64,
    /// Those that were taken now.
    pub taken: u64,
    /// Those of them that are impossible or that the engine refuses: their rows say why.
    pub without_results: u64,
    /// Lines of journals that were of no use.
    pub spoilt_lines: u64,
}

/// The study that a folder holds results of.
#[derive(Debug, Serialize, Deserialize)]
struct StoredStudy {
    name: String,
    source: String,
    folder: PathBuf,
    text: String,
}

/// Where it is kept.
const STUDY: &str = "study.json";

/// Takes the missing points of a study, or of its shard, in `folder`, and adds them to the journal there. `done` is
/// called with points as they are done, those that were there included.
///
/// With one thread to a point where there are more points than threads: the frames of a study need no help from each other. `done` may stop
/// the sweep by its [`Answer`]; points that are being taken are finished. A journal or a study in `folder` that is none of ours is set
/// aside.
///
/// # Errors
/// When another process takes the same, `folder` holds results of another command, the journal is removed meanwhile, files cannot be
/// written, the program fails, or it is stopped.
pub fn run<A: Answer>(
    study: &Study,
    folder: &Path,
    shard: Shard,
    done: impl Fn(u64) -> A + Sync,
) -> Result<Outcome, SweepError> {
    ResultSet::check(folder, "sweep")?;
    create_folder(folder)?;
    let path = folder.join(shard.journal());
    refuse_input(&path)?;
    set_aside_foreign(&folder.join(STUDY), |file| {
        serde_json::from_reader::<_, StoredStudy>(file).is_ok()
    })?;
    set_aside_foreign(&path, is_journal)?;
    let Some(journal) = Journal::open(&path)? else {
        let message =
            "another process takes these points; wait for it, or give another folder or shard";
        return Err(InputError::new(path.display(), message).into());
    };
    keep(study, folder)?;
    let there = Index::read(journals_in(folder), &Subject::columns(study.kind))?;
    let points = shard.share(study.len());
    let workers = (rayon::current_num_threads() as u64).min(points).max(1);
    // A theoretical point takes less than a write.
    let batch = match study.kind {
        StudyKind::Frame => 1,
        StudyKind::Theory => 256,
    };
    let work = SharedSweep {
        subject: Subject::new(study),
        study,
        shard,
        points,
        batch,
        there: &there,
        next: AtomicU64::new(0),
        counts: [const { AtomicU64::new(0) }; 3],
        journal: Mutex::new(journal),
        failed: AtomicBool::new(false),
        error: Mutex::new(None),
    };
    if points < 2 * workers && study.kind == StudyKind::Frame {
        // Too few to go round: all threads on one frame after the other.
        work.take_points(&done);
    } else {
        std::thread::scope(|scope| {
            for _ in 0..workers {
                scope.spawn(
                    || match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
                        Ok(own) => own.install(|| work.take_points(&done)),
                        // No more threads to be had: in the common pool, slower.
                        Err(_) => work.take_points(&done),
                    },
                );
            }
        });
    }
    if let Some(error) = work.error.into_inner().expect("nobody panicked") {
        return Err(error);
    }
    work.journal
        .into_inner()
        .expect("nobody panicked")
        .check_place()?;
    let [reused, taken, without_results] = work.counts.map(AtomicU64::into_inner);
    Ok(Outcome {
        points,
        reused,
        taken,
        without_results,
        spoilt_lines: there.spoilt as u64,
    })
}

/// What all threads share.
struct SharedSweep<'a> {
    subject: Subject<'a>,
    study: &'a Study,
    shard: Shard,
    points: u64,
    batch: u64,
    there: &'a Index,
    next: AtomicU64,
    /// Reused, taken, without results.
    counts: [AtomicU64; 3],
    journal: Mutex<Journal>,
    failed: AtomicBool,
    error: Mutex<Option<SweepError>>,
}

impl SharedSweep<'_> {
    /// Takes points until there are no more.
    fn take_points<A: Answer>(&self, done: &(impl Fn(u64) -> A + Sync)) {
        let mut scratch = Scratch::default();
        while !self.failed.load(Ordering::Relaxed) {
            let begin = self.next.fetch_add(self.batch, Ordering::Relaxed);
            if begin >= self.points {
                return;
            }
            let end = (begin + self.batch).min(self.points);
            let taken = self.run_batch(begin..end, &mut scratch);
            let stops = done(end - begin).stops();
            if let Err(error) = taken.and(if stops {
                Err(SweepError::Stopped)
            } else {
                Ok(())
            }) {
                self.failed.store(true, Ordering::Relaxed);
                self.error
                    .lock()
                    .expect("nobody panicked")
                    .get_or_insert(error);
            }
        }
    }

    fn run_batch(
        &self,
        batch: std::ops::Range<u64>,
        scratch: &mut Scratch,
    ) -> Result<(), SweepError> {
        let mut lines = String::new();
        let mut counts = [0; 3];
        for at in batch {
            let index = self.shard.part + at * self.shard.parts;
            let point = self.study.point(index);
            let Ok(ready) = self.subject.ready(&point, scratch) else {
                // Found out again, and said, when the table is written.
                counts[1] += 1;
                counts[2] += 1;
                continue;
            };
            if self.there.has(ready.key) {
                counts[0] += 1;
                continue;
            }
            let key = ready.key;
            let row = self.subject.compute_row(ready, scratch)?;
            counts[1] += 1;
            counts[2] += u64::from(row.error.is_some());
            lines += &row.line(key);
        }
        if !lines.is_empty() {
            self.journal
                .lock()
                .expect("nobody panicked")
                .append(&lines)?;
        }
        for (all, some) in self.counts.iter().zip(counts) {
            all.fetch_add(some, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Writes down which study a folder is of.
fn keep(study: &Study, folder: &Path) -> Result<(), InputError> {
    let here = std::path::absolute(study.folder()).unwrap_or_else(|_| study.folder().to_owned());
    let kept = StoredStudy {
        name: study.name.clone(),
        source: study.source().to_owned(),
        folder: here,
        text: study.text().to_owned(),
    };
    OutputFile::write_with(&folder.join(STUDY), |out| {
        serde_json::to_writer_pretty(&mut *out, &kept)?;
        writeln!(out)
    })
}

/// The study that a folder holds results of.
///
/// # Errors
/// When it is no such folder.
pub fn study_of(folder: &Path) -> Result<Study, InputError> {
    let path = folder.join(STUDY);
    if !path.exists() {
        let message = "holds no sweep; give a folder that `gdtof sweep` has written";
        return Err(InputError::new(folder.display(), message));
    }
    let text = read_text(&path)?;
    let kept: StoredStudy = parse_json(
        path.display(),
        &text,
        "a folder that `gdtof sweep` has written",
    )?;
    Study::parse(&kept.source, &kept.text, &kept.folder, &kept.name)
}
