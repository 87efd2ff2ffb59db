//! What a SAIF file should say, counted from a waveform.

use std::collections::{BTreeMap, BTreeSet};

use femtogate::kernel::Activity;
use femtogate::logic::Logic;
use femtogate::netlist::{CellId, DelayModel, NetId, Netlist, ScopeId, Timing};
use femtogate::units::Time;
use femtogate::waves::write_saif;
use proptest::prelude::*;

use crate::every_edge::waves::Waves;

/// T0, T1, TX, TC, TG (0 in a file without), IG.
pub type Row = [i64; 6];

/// Where a row has its edges of inertial glitches.
const IG: usize = 5;

/// Duration, and every net of a SAIF file by its path below the top.
pub fn read_saif(text: &str) -> (i64, BTreeMap<String, Row>) {
    let mut path: Vec<String> = Vec::new();
    let (mut duration, mut nets, mut depth) = (0, BTreeMap::new(), 0);
    for line in text.lines() {
        depth += line.matches('(').count() as i64 - line.matches(')').count() as i64;
        let words: Vec<&str> = line
            .split(['(', ')', ' '])
            .filter(|w| !w.is_empty())
            .collect();
        match words[..] {
            ["DURATION", time] => duration = time.parse().unwrap(),
            ["INSTANCE", name] => path.push(name.to_owned()),
            // A list of nets or an instance ends.
            [] if depth < path.len() as i64 + 1 => _ = path.pop(),
            [
                name,
                "T0",
                t0,
                "T1",
                t1,
                "TX",
                tx,
                "TC",
                tc,
                ref tg @ ..,
                "IG",
                ig,
            ] => {
                let tg = match tg {
                    [] => "0",
                    &["TG", tg] => tg,
                    _ => panic!("{line}"),
                };
                let row = [t0, t1, tx, tc, tg, ig].map(|n| n.parse().unwrap());
                let name = name.replace('\\', "");
                let below = path[1..].iter().cloned().chain([name]);
                let path = below.collect::<Vec<_>>().join(".");
                assert!(nets.insert(path, row).is_none());
            }
            _ => {}
        }
    }
    assert_eq!(depth, 0, "parentheses");
    (duration, nets)
}

/// Times (fs) and values of one net, from time 0 on, one value an instant.
type Changes = Vec<(i64, Logic)>;

/// Every bit of every signal of a dump by its path, and the net that it is.
fn bits(netlist: &Netlist, waves: &Waves) -> Vec<(String, NetId, Changes)> {
    let mut bits = Vec::new();
    let dumped: BTreeMap<&str, &[(u64, String)]> = waves.changes().collect();
    for (index, scope) in netlist.scopes().iter().enumerate() {
        let scope_path = netlist.scope_path(ScopeId::new(index));
        let below_top = scope_path.split_once('.').map(|(_, below)| below);
        for signal in scope.module.signals() {
            let names = below_top.into_iter().chain([signal.name.as_str()]);
            let path = names.collect::<Vec<_>>().join(".");
            for (bit, net) in netlist.signal_nets(scope, signal).enumerate() {
                let of_bit = |(time, value): &(u64, String)| {
                    let value = match value.chars().rev().nth(bit).unwrap() {
                        '0' => Logic::Zero,
                        '1' => Logic::One,
                        'z' | 'Z' => Logic::Z,
                        _ => Logic::X,
                    };
                    (*time as i64, value)
                };
                let mut changes: Changes = dumped[path.as_str()].iter().map(of_bit).collect();
                changes.dedup_by_key(|change| change.1);
                let name = if signal.is_bus {
                    format!("{path}[{bit}]")
                } else {
                    path.clone()
                };
                bits.push((name, net, changes));
            }
        }
    }
    bits
}

/// The slow obvious count, value after value; of inertial glitches those that a dump shows.
fn count(changes: &Changes, input_changes: &BTreeSet<i64>, end: i64) -> Row {
    let mut row = [0; 6];
    let slot = |value| match value {
        Logic::Zero => 0,
        Logic::One => 1,
        Logic::X | Logic::Z => 2,
    };
    let ends = changes.iter().skip(1).map(|&(time, _)| time).chain([end]);
    for (&(time, value), until) in changes.iter().zip(ends) {
        row[slot(value)] += until - time;
    }
    let known: Vec<usize> = (0..changes.len())
        .filter(|&k| changes[k].1.to_bool().is_some())
        .collect();
    let mut in_settling: BTreeMap<Option<&i64>, i64> = BTreeMap::new();
    for pair in known.windows(2) {
        let [(_, before), (time, after)] = [changes[pair[0]], changes[pair[1]]];
        if before == after {
            row[IG] += 2;
        } else {
            row[3] += 1;
            let settling = input_changes.range(..=time).next_back();
            *in_settling.entry(settling).or_default() += 1;
        }
    }
    row[4] = in_settling.values().map(|toggles| toggles & !1).sum();
    row
}

/// The state of a flip-flop: what every possibility of its unknown pins leads to.
fn latched(state: Logic, [data, clock, reset, set]: [Logic; 4], clock_before: Logic) -> Logic {
    let may_be = |value: Logic| match value.to_bool() {
        Some(value) => vec![value],
        None => vec![false, true],
    };
    let mut found = BTreeSet::new();
    for (reset, set) in may_be(reset)
        .into_iter()
        .flat_map(|r| may_be(set).into_iter().map(move |s| (r, s)))
    {
        for (before, now) in may_be(clock_before)
            .into_iter()
            .flat_map(|b| may_be(clock).into_iter().map(move |n| (b, n)))
        {
            let rises = clock.as_gate_input() != clock_before.as_gate_input() && !before && now;
            let clocked = if rises { data } else { state };
            let values = match (reset, set) {
                (true, _) => vec![false],
                (false, true) => vec![true],
                (false, false) => may_be(clocked),
            };
            found.extend(values);
        }
    }
    match found.len() {
        1 => Logic::from(found.contains(&true)),
        _ => Logic::X,
    }
}

/// Pulses of each net that are shorter than its driver's delay: each cell by itself, from the waves at its pins.
fn inertial_glitches(netlist: &Netlist, timing: &Timing, of_net: &[Changes]) -> Vec<i64> {
    let mut pulses = vec![0; of_net.len()];
    for (index, cell) in netlist.cells().iter().enumerate() {
        let pins: Vec<NetId> = cell.input_nets().collect();
        let net_value = |net: NetId, time: i64| {
            let changes = &of_net[net.index()];
            let until = changes.partition_point(|change| change.0 <= time);
            until.checked_sub(1).map_or(Logic::X, |k| changes[k].1)
        };
        let times: BTreeSet<i64> = pins
            .iter()
            .flat_map(|net| of_net[net.index()].iter().map(|change| change.0))
            .collect();
        for (which, output) in cell.outputs.into_iter().enumerate() {
            let Some(output) = output else { continue };
            let mut last = Logic::X;
            let mut on_their_way: Vec<(i64, Logic)> = Vec::new();
            for &time in &times {
                let value =
                    |pin: usize, time| pins.get(pin).map_or(Logic::Zero, |&p| net_value(p, time));
                let now = [0, 1, 2, 3].map(|pin| value(pin, time));
                let next = match (cell.kind.is_flip_flop(), which) {
                    (false, _) => cell.kind.output(now),
                    (true, 0) => latched(last, now, value(1, time - 1)),
                    (true, _) => latched(last.inverted(), now, value(1, time - 1)).inverted(),
                };
                if next == last {
                    continue;
                }
                last = next;
                // A clock that goes low causes nothing.
                let is_fall = |pin| cell.kind.is_flip_flop() && pin == 1 && now[1] == Logic::Zero;
                let causes = (0..pins.len()).filter(|&pin| {
                    cell.kind.triggers(pin) && !is_fall(pin) && now[pin] != value(pin, time - 1)
                });
                let delays = causes.map(|pin| {
                    timing.cell_delays(CellId::new(index))[pin][which]
                        .delay(next)
                        .as_fs()
                });
                let due = time + delays.min().unwrap();
                on_their_way.retain(|&(arrives, _)| arrives > time);
                let stays = match timing.model(CellId::new(index)) {
                    DelayModel::Inertial => 0,
                    DelayModel::Transport => on_their_way.partition_point(|&(t, _)| t < due),
                };
                let dropped = on_their_way.split_off(stays);
                let before = on_their_way
                    .last()
                    .map_or(net_value(output, time), |&(_, v)| v);
                let values: Vec<Logic> = [before]
                    .into_iter()
                    .chain(dropped.into_iter().map(|(_, value)| value))
                    .chain([next])
                    .collect();
                let edges = values.windows(2).filter(|pair| {
                    pair[0] != pair[1] && pair.iter().all(|v| v.to_bool().is_some())
                });
                // One of them is left where the ends differ.
                pulses[output.index()] += edges.count() as i64 / 2;
                if before != next {
                    on_their_way.push((due, next));
                }
            }
        }
    }
    pulses
}

/// Compares a SAIF file with a dump of the same run; gives what it says of each net.
pub fn compare(
    saif: &str,
    (netlist, timing): (&Netlist, &Timing),
    waves: &Waves,
    end: Time,
) -> Result<BTreeMap<String, Row>, TestCaseError> {
    let (duration, nets) = read_saif(saif);
    prop_assert_eq!(duration, end.as_fs());
    let mut bits = bits(netlist, waves);
    for (.., changes) in &mut bits {
        // Another simulator's dump may go on.
        changes.retain(|&(time, _)| time <= duration);
    }
    let mut of_net = vec![Changes::new(); netlist.net_count()];
    for (_, net, changes) in &bits {
        of_net[net.index()].clone_from(changes);
    }
    let inputs = netlist.inputs();
    let input_changes = inputs.iter().flat_map(|input| &of_net[input.index()]);
    let input_changes = input_changes.map(|change| change.0).collect();
    let swallowed = inertial_glitches(netlist, timing, &of_net);
    for (path, net, changes) in &bits {
        let row = nets.get(path);
        prop_assert!(row.is_some(), "{} is in no list", path);
        let mut expected = count(changes, &input_changes, duration);
        expected[IG] += 2 * swallowed[net.index()];
        prop_assert_eq!(*row.unwrap(), expected, "{}", path);
        prop_assert_eq!(expected[..3].iter().sum::<i64>(), duration, "{}", path);
    }
    prop_assert_eq!(bits.len(), nets.len());
    Ok(nets)
}

/// What it says of a run.
pub fn saif(netlist: &Netlist, activity: &Activity, end: Time) -> String {
    let mut text = Vec::new();
    write_saif(
        &mut text,
        netlist,
        &activity.net_activity(end),
        end,
        true,
        femtogate::Origin::default(),
    )
    .unwrap();
    String::from_utf8(text).unwrap()
}
