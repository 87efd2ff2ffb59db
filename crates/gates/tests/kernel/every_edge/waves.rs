//! Waveform files as lists of changes, and the first difference between two of them.

use std::collections::BTreeMap;
use std::io::{BufRead, Seek};
use std::time::Instant;

/// Times (fs) and values of one signal: first the one at time 0, then only changes, one per
/// instant.
type Changes = Vec<(u64, String)>;

/// Every signal of a file by its path below one scope.
pub struct Waves(BTreeMap<String, Changes>);

/// How much was compared.
#[derive(Debug, Clone, Copy, Default)]
pub struct Figures {
    /// Signals that both have.
    pub signals: u64,
    /// Those that ever change.
    pub moving: u64,
    /// Their changes.
    pub changes: u64,
    /// Changes to a value with an X or Z in it.
    pub unknown: u64,
}

impl std::ops::Add for Figures {
    type Output = Figures;
    fn add(self, other: Figures) -> Figures {
        Figures {
            signals: self.signals + other.signals,
            changes: self.changes + other.changes,
            moving: self.moving + other.moving,
            unknown: self.unknown + other.unknown,
        }
    }
}

impl Figures {
    /// Says how much was compared, and how fast.
    pub fn print(self, what: &str, cases: u64, start: Instant) {
        println!(
            "{what}: {cases} cases, {} signals ({} of them change), {} changes ({} to an unknown value) in {:.1} s",
            self.signals,
            self.moving,
            self.changes,
            self.unknown,
            start.elapsed().as_secs_f64()
        );
    }
}

impl Waves {
    /// Every signal's path and its changes.
    #[allow(dead_code)]
    pub fn changes(&self) -> impl Iterator<Item = (&str, &[(u64, String)])> {
        self.0
            .iter()
            .map(|(path, changes)| (path.as_str(), changes.as_slice()))
    }

    /// Reads the signals of the scope at a dotted path and of the scopes below it.
    pub fn read(dump: impl BufRead + Seek + Send + Sync + 'static, scope: &str) -> Self {
        let mut read = Self::read_each(dump, &[scope.to_owned()]);
        read.pop().expect("a scope was asked for")
    }

    /// The same of several scopes.
    pub fn read_each(
        dump: impl BufRead + Seek + Send + Sync + 'static,
        scopes: &[String],
    ) -> Vec<Self> {
        let mut waves = wellen::simple::read_from_reader(dump).unwrap();
        scopes
            .iter()
            .map(|scope| Self::of_scope(&mut waves, scope))
            .collect()
    }

    fn of_scope(waves: &mut wellen::simple::Waveform, scope: &str) -> Self {
        let hierarchy = waves.hierarchy();
        let prefix = format!("{scope}.");
        let signals: Vec<(String, wellen::SignalRef)> = hierarchy
            .all_vars()
            .filter_map(|var| {
                let var = &hierarchy[var];
                let path = var.full_name(hierarchy);
                let path = path.strip_prefix(&prefix)?.to_owned();
                Some((path, var.signal_ref()))
            })
            .collect();
        let references: Vec<_> = signals.iter().map(|(_, signal)| *signal).collect();
        waves.load_signals(&references);
        let times = waves.time_table();
        let changes = |signal| {
            let mut settled: Changes = Vec::new();
            for (index, value) in waves.get_signal(signal).unwrap().iter_changes() {
                let (time, value) = (times[index as usize], value.to_bit_string().unwrap());
                // Of several values in one instant only the last is one.
                settled.pop_if(|(last, _)| *last == time);
                if settled.last().is_none_or(|(_, last)| *last != value) {
                    settled.push((time, value));
                }
            }
            settled
        };
        let signals = signals.into_iter();
        Waves(
            signals
                .map(|(path, signal)| (path, changes(signal)))
                .collect(),
        )
    }

    /// Compares every signal of `self` with that of the same path in `other`, which may hold
    /// more, before `end_fs`.
    ///
    /// # Errors
    /// The earliest difference, in words.
    pub fn compare(&self, other: &Waves, names: [&str; 2], end_fs: u64) -> Result<Figures, String> {
        let mut figures = Figures::default();
        let mut earliest: Option<(u64, String)> = None;
        for (path, ours) in &self.0 {
            let Some(theirs) = other.0.get(path) else {
                return Err(format!("{} has no signal {path}", names[1]));
            };
            figures.signals += 1;
            figures.moving += (ours.len() > 1) as u64;
            figures.changes += ours.len() as u64 - 1;
            let is_unknown = |(_, value): &&(u64, String)| value.contains(['x', 'z']);
            figures.unknown += ours.iter().skip(1).filter(is_unknown).count() as u64;
            let Some(time) = first_difference(ours, theirs).filter(|&time| time < end_fs) else {
                continue;
            };
            if earliest.as_ref().is_none_or(|(first, _)| time < *first) {
                let [ours, theirs] = [ours, theirs].map(|changes| state_text(changes, time));
                let [our_name, their_name] = names;
                let text = format!("{path} at {time} fs: {our_name} {ours}, {their_name} {theirs}");
                earliest = Some((time, text));
            }
        }
        match earliest {
            Some((_, text)) => Err(text),
            None => Ok(figures),
        }
    }
}

fn first_difference(a: &Changes, b: &Changes) -> Option<u64> {
    let same = a.iter().zip(b).take_while(|(a, b)| a == b).count();
    let times = [a, b].map(|changes| changes.get(same).map(|(time, _)| *time));
    times.into_iter().flatten().min()
}

/// What a signal is at a time, since when and until when.
fn state_text(changes: &Changes, time: u64) -> String {
    let next = changes.partition_point(|(t, _)| *t <= time);
    let now = match next.checked_sub(1).map(|last| &changes[last]) {
        Some((since, value)) => format!("is {value} since {since}"),
        None => "is nothing yet".to_owned(),
    };
    match changes.get(next) {
        Some((until, value)) => format!("{now} (then {value} at {until})"),
        None => format!("{now} (for good)"),
    }
}
