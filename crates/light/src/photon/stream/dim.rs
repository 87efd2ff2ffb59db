//! The photons of dim macropixels, drawn for a group of laser cycles at once.
//!
//! A [`Draw`] takes a group and a span of each of its cycles: first the Poisson numbers of all slots and of the echo, then as
//! many words as that makes photons. What was drawn at the greatest rate is thinned afterwards (`thinning`).

use super::draw::Draw;
use super::exposure::Span;
use super::group::{CycleGroup, GROUP, GroupPlace};
use super::numbers::Counts;
use super::part::{PixelStream, nearest};
use crate::photon::random::RandomPurpose;
use crate::photon::spad_grid::MOST_SPADS;

/// Second counter word of the number of signal photons; slots are below it.
const SIGNAL_RUN: u32 = u32::MAX;

impl PixelStream<'_> {
    /// Draws all photons of `group` in a part of its cycles.
    pub fn draw(&self, group: CycleGroup, span: &Span, draw: &mut Draw) {
        let key = self.key;
        let numbered = |purpose: RandomPurpose| purpose as u32 | group.number() << 8;
        debug_assert!(!self.is_bright, "bright light is drawn by laser cycle");
        draw.begin(group);
        if self
            .limits
            .as_ref()
            .is_some_and(|limits| limits.is_outside(group))
        {
            return;
        }

        if let Some(foreign) = &self.foreign {
            self.push_foreign(foreign, group, span.slots.clone(), &mut draw.kept);
            draw.count_exposure(group.cycles_in(self.stream.config().laser_cycles));
            return;
        }
        draw.within_fs = span.within_fs.clone();
        let (background, parts) = self.background.distribution(group);
        let (signal, signal_parts) = self.signal.distribution(group);
        let has_echo = !signal.is_zero()
            && !draw.within_fs.is_empty()
            && self.echo_fs.0 < draw.within_fs.end
            && self.echo_fs.1 >= draw.within_fs.start;
        if has_echo {
            let words = signal.words() * signal_parts;
            draw.counts.push_run(SIGNAL_RUN, words.div_ceil(2));
        }
        let words = background.words() * parts;
        if !background.is_zero() {
            for slot in span.slots.clone() {
                draw.counts.push_run(slot, words.div_ceil(2));
            }
        }
        let mut numbers = std::mem::take(&mut draw.counts);
        numbers.generate(key, self.pixel, numbered(self.kind.counts()));

        let mut counts = Counts::new(&numbers);
        if has_echo {
            let photons = counts.next(signal, signal_parts);
            draw.push_echo(photons, self.shape.is_some());
            draw.echo
                .generate(key, self.pixel, numbered(self.kind.echo()));
        }
        if !background.is_zero() {
            for slot in span.slots.clone() {
                let photons = counts.next(background, parts);
                draw.push_run(slot, photons);
            }
            draw.background
                .generate(key, self.pixel, numbered(self.kind.background()));
        }
        draw.counts = numbers;
        if self
            .limits
            .as_ref()
            .is_some_and(|limits| !limits.keep_all_of(group, self.stream))
        {
            draw.thin(self);
        }
        draw.count_exposure(group.cycles_in(self.stream.config().laser_cycles));
    }

    /// Place of an echo's photon of this number in `draw` ([`Draw::half_an_echo`]), and its time after the start of its
    /// cycle, fs.
    #[inline]
    pub fn signal_photon(&self, draw: &Draw, number: usize) -> (GroupPlace, i64) {
        let word = draw.echo_word(number);
        let mut after_fs = self.gaussian.draw(word);
        if let Some(shape) = &self.shape {
            after_fs += shape.draw(draw.echo_words(number));
        }
        let place = draw.group.place((word >> 32) as u32);
        (place, self.arrival_fs + nearest(after_fs))
    }
}

impl Draw {
    /// Every photon of the first `cycles` laser cycles of the group, as place and time after the start of its cycle in fs, in no
    /// particular order. `pixel` is whose they are. No background photon comes before the exposure.
    pub fn photons(
        &self,
        pixel: &PixelStream<'_>,
        cycles: u32,
    ) -> impl Iterator<Item = (GroupPlace, i64)> {
        let words = self.words();
        let slots = pixel.slots();
        // Short exposures need few of a group's photons; only of those the times are worked out.
        let is_wanted = move |word: u32| self.group.split(self.group.place(word)).0 < cycles;
        let background = self.runs.iter().flat_map(move |run| {
            let rows = run.blocks().into_iter().zip(words);
            rows.flat_map(move |(blocks, words)| {
                let photon =
                    move |&word: &u32| (self.group.place(word), slots.time_fs(run.slot, word));
                let wanted = words[blocks].iter().filter(move |word| is_wanted(**word));
                wanted.map(photon)
            })
        });
        let halves = self.echo().into_iter().zip(self.echo_photons());
        let signal = halves
            .enumerate()
            .flat_map(move |(half, ([_, high], photons))| {
                let wanted = (0..photons).filter(move |&at| is_wanted(high[at]));
                wanted.map(move |at| half * self.half_an_echo() + at)
            });
        let signal = signal
            .map(|photon| pixel.signal_photon(self, photon))
            .filter(|(_, time_fs)| self.within_fs.contains(time_fs));
        let is_first_group = self.group.first_cycle() == 0;
        let background = background.filter(move |&(place, time_fs)| {
            !is_first_group || time_fs >= 0 || self.group.split(place).0 > 0
        });
        let kept = self.kept.iter().copied();
        let kept = kept.filter(move |&(place, _)| self.group.split(place).0 < cycles);
        background.chain(signal).chain(kept)
    }

    /// Keeps only those photons that `pixel` keeps. They are worked out here, and are no words any more.
    pub(super) fn thin(&mut self, pixel: &PixelStream<'_>) {
        let mut kept = std::mem::take(&mut self.kept);
        let first_cycle = self.group.first_cycle();
        let slots = pixel.slots();
        for run in &self.runs {
            for (blocks, words) in run.blocks().into_iter().zip(self.words()) {
                for &word in &words[blocks] {
                    let (place, time_fs) = (self.group.place(word), slots.time_fs(run.slot, word));
                    let (cycle, spad) = self.group.split(place);
                    let cycle = first_cycle + cycle;
                    let is_before_exposure = cycle == 0 && time_fs < 0;
                    if !is_before_exposure
                        && pixel.keeps_background(cycle, spad, time_fs, 1.0, [word, run.slot])
                    {
                        kept.push((place, time_fs));
                    }
                }
            }
        }
        for number in self.echo_numbers() {
            let (place, time_fs) = pixel.signal_photon(self, number);
            let (cycle, spad) = self.group.split(place);
            let word = self.echo_word(number);
            let words = [word as u32, (word >> 32) as u32];
            if self.within_fs.contains(&time_fs)
                && pixel.keeps_signal(first_cycle + cycle, spad, words)
            {
                kept.push((place, time_fs));
            }
        }
        self.runs.clear();
        (self.photons, self.echo_photons) = (0, 0);
        self.kept = kept;
    }
}

/// Bits of a SPAD's number below a time.
pub(in crate::photon) const SPAD_SHIFT: u32 = MOST_SPADS.trailing_zeros();

/// Photons of a group sorted by cycle, then time, then SPAD.
#[derive(Debug, Clone, Default)]
pub(in crate::photon) struct ByCycle {
    /// Time after the start of the cycle in fs and SPAD, as `time << SPAD_SHIFT | SPAD`.
    photons: Vec<i64>,
    /// Where each cycle's photons end.
    ends: Vec<usize>,
}

impl ByCycle {
    pub(in crate::photon) fn sort(&mut self, draw: &Draw, pixel: &PixelStream<'_>) {
        self.ends.clear();
        self.ends.resize(GROUP as usize, 0);
        for (place, _) in draw.photons(pixel, GROUP) {
            self.ends[draw.group.split(place).0 as usize] += 1;
        }
        let mut total = 0;
        for end in &mut self.ends {
            // Where the cycle begins, until its photons have moved it to where it ends.
            total += std::mem::replace(end, total);
        }
        self.photons.clear();
        self.photons.resize(total, 0);
        for (place, time_fs) in draw.photons(pixel, GROUP) {
            let (cycle, spad) = draw.group.split(place);
            let end = &mut self.ends[cycle as usize];
            self.photons[*end] = time_fs << SPAD_SHIFT | i64::from(spad);
            *end += 1;
        }
        let mut start = 0;
        for &end in &self.ends {
            self.photons[start..end].sort_unstable();
            start = end;
        }
    }

    pub(in crate::photon) fn cycle_photons(&self, cycle: u32) -> &[i64] {
        let cycle = cycle as usize;
        let start = cycle.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.photons[start..self.ends[cycle]]
    }
}
