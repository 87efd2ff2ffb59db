//! What a table decides, beside SPADs that fire photon by photon.

use super::*;
use crate::engine::window::sight::ROUNDING_FS;
use crate::photon::{DeadTimeLaw, SpadModel};
use crate::units::Time;
use proptest::prelude::*;

/// When a SPAD fires, photon by photon.
fn fires(mut times_fs: Vec<i64>, dead_fs: i64, law: DeadTimeLaw) -> Vec<i64> {
    times_fs.sort_unstable();
    let mut ready_fs = i64::MIN;
    let mut fires = Vec::new();
    for time_fs in times_fs {
        let is_ready = time_fs > ready_fs;
        if is_ready {
            fires.push(time_fs);
        }
        if is_ready || law == DeadTimeLaw::Paralysable {
            ready_fs = time_fs + dead_fs;
        }
    }
    fires
}

proptest! {
    /// Whatever came before the table, and however many SPADs there are.
    #[test]
    fn what_is_not_in_doubt_is_what_times_give(
        bins in 1i64..20,
        bin_fs in 2_000_000i64..4_000_000,
        dead_fs in prop_oneof![Just(0i64), 1i64..4_000_000, 4_000_000i64..120_000_000],
        room_fs in 0i64..4_000_000,
        is_paralysable: bool,
        spad_bits in 0u32..=6,
        threshold in 0usize..4,
        photons in prop::collection::vec((0u32..128, 0f64..1.0), 0..200),
    ) {
        let law = if is_paralysable { DeadTimeLaw::Paralysable } else { DeadTimeLaw::NonParalysable };
        let spads = SpadModel { law, ..SpadModel::with_dead_time(Time::from_fs(dead_fs)) };
        let edges_fs: Vec<i64> = (0..=bins).map(|bin| bin * bin_fs).collect();
        let from_fs = -dead_fs - ROUNDING_FS - room_fs;
        let layout = Layout::new(&edges_fs, from_fs, &spads, None);
        let (begin_fs, end_fs) = (3 * from_fs, bins * bin_fs + bin_fs);
        let time = |at: f64| begin_fs + (at * (end_fs - begin_fs) as f64) as i64;
        let photons: Vec<(u32, i64)> = photons.into_iter().map(|(place, at)| (place, time(at))).collect();
        let mut table = Table::default();
        let words = (128 / WORD) as usize;
        table.clear(&layout, words);
        let row = |time_fs: i64| layout.edges_fs.partition_point(|&edge_fs| edge_fs <= time_fs);
        for &(place, time_fs) in photons.iter().filter(|&&(_, time_fs)| time_fs >= from_fs) {
            prop_assert!(layout.row_of(time_fs).is_none_or(|found| found == row(time_fs)));
            table.put_photon(row(time_fs), place);
        }
        table.settle(&layout, words);
        let in_doubt = |table: &Table, place: u32| table.doubt[(place / WORD) as usize] >> (place % WORD) & 1 != 0;
        let mut expected = vec![vec![0usize; 128 >> spad_bits]; bins as usize];
        for place in 0..128 {
            let of_place = photons.iter().filter(|photon| photon.0 == place);
            let times_fs: Vec<i64> = of_place.map(|photon| photon.1).collect();
            let rows: Vec<usize> = fires(times_fs, dead_fs, law).into_iter().map(row).collect();
            let once = rows.iter().filter(|row| rows.iter().filter(|other| other == row).count() % 2 == 1);
            let mut fired: Vec<usize> = once.copied().collect();
            fired.dedup();
            fired.retain(|&row| row > layout.before && row <= layout.rows());
            if in_doubt(&table, place) {
                fired.iter().for_each(|&row| table.toggle(row, place));
            }
            for &row in &fired {
                expected[row - layout.before - 1][(place >> spad_bits) as usize] += 1;
            }
        }
        let adds: Vec<i64> = (0..=1 << spad_bits).map(|spads| i64::from(spads > threshold)).collect();
        for (bin, cycles) in expected.into_iter().enumerate() {
            let counts = table.count(layout.before + 1 + bin, spad_bits, words, &adds);
            let hits = cycles.iter().filter(|&&spads| spads > threshold).count() as i64;
            let pulses = cycles.iter().sum::<usize>() as i64;
            let lit = cycles.iter().filter(|&&spads| spads > 0).count() as i64;
            prop_assert_eq!(counts, [hits, pulses, lit]);
        }
    }

    /// Two photons of a word that come closer than a stage of the photon line, one of them in the window, whatever the bins.
    #[test]
    fn photons_that_may_meet_are_noticed(
        widths_fs in prop::collection::vec(0i64..400_000, 1..20),
        stage_fs in 1i64..200_000,
        photons in prop::collection::vec((0u32..128, -0.2f64..1.2), 0..40),
    ) {
        prop_assume!(widths_fs.iter().sum::<i64>() > 100_000);
        let mut edges_fs = vec![0];
        for width_fs in widths_fs {
            edges_fs.push(edges_fs[edges_fs.len() - 1] + width_fs);
        }
        let end_fs = edges_fs[edges_fs.len() - 1];
        let (dead_fs, stage) = (4_000_000, Some(Time::from_fs(stage_fs)));
        let spads = SpadModel::with_dead_time(Time::from_fs(dead_fs));
        let layout = Layout::new(&edges_fs, -dead_fs - ROUNDING_FS, &spads, stage);
        let time = |at: f64| (at * end_fs as f64) as i64;
        let photons: Vec<(u32, i64)> = photons.into_iter().map(|(place, at)| (place, time(at))).collect();
        let mut table = Table::default();
        let words = (128 / WORD) as usize;
        table.clear(&layout, words);
        for &(place, time_fs) in &photons {
            table.put_photon(layout.edges_fs.partition_point(|&edge_fs| edge_fs <= time_fs), place);
        }
        let meeting: Vec<u32> = table.meeting(&layout, words).collect();
        for word in 0..words as u32 {
            let of_word: Vec<_> = photons.iter().filter(|(place, _)| place / WORD == word).collect();
            let meets = of_word.iter().any(|(place, time_fs)| {
                let mut others = of_word.iter().filter(|(other, _)| other != place);
                let meets = others.any(|(_, other_fs)| (other_fs - time_fs).abs() < stage_fs);
                meets && (0..end_fs).contains(time_fs)
            });
            let is_noticed = meeting.contains(&word);
            prop_assert!(is_noticed || !meets);
            prop_assert!(!is_noticed || of_word.len() > 1);
        }
    }
}
