//! The default sensor under scattered light breaks no limit of any flip-flop but those that sample SPADs.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{GateSimulation, Histograms};
use guided_dtof::kernel::{CheckReport, Policy};
use guided_dtof::netlist::{CheckKind, Corner};
use guided_dtof::photon::{SpadEvent, apply_dead_time};
use guided_dtof::units::Time;

/// Pulses at scattered times on every SPAD.
fn pulses(config: &SensorConfig, exposure: &Exposure, count: i64) -> Vec<SpadEvent> {
    let mut pulses: Vec<SpadEvent> = (0..count)
        .map(|i| SpadEvent {
            // Multiples of the golden section spread evenly over the exposure.
            time: Time::from_fs(
                (exposure.end().as_fs() as f64 * (i as f64 * 0.618_033_988_7).fract()) as i64,
            ),
            spad: (i % 16) as u8,
        })
        .collect();
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), 0);
    pulses
}

fn sensor_report(config: &SensorConfig, policy: Policy) -> (CheckReport, Option<Histograms>) {
    let exposure = Exposure::new(config, 60, 40);
    let pulses = pulses(config, &exposure, 1_500);
    let start = [20];
    let mut gate = GateSimulation::new(config, &exposure, (0, 0), (1, 1), &start, &[&pulses]);
    let mut checks = gate.timing_checks(policy);
    gate.run(&mut checks);
    let report = checks.report(gate.netlist());
    (report, gate.histograms().ok())
}

#[test]
fn the_default_sensor_breaks_nothing_but_its_asynchronous_samplers() {
    for corner in [Corner::Fast, Corner::Typ] {
        let config = SensorConfig {
            rows: 1,
            cols: 1,
            corner,
            ..SensorConfig::default()
        };
        let (report, histograms) = sensor_report(&config, Policy::ReportOnly);
        println!("{corner:?} {report}");
        let real = report.violations.iter().filter(|v| !v.is_asynchronous);
        let real: Vec<_> = real.take(20).collect();
        assert!(real.is_empty(), "{real:#?}\n{report}");
        assert_eq!(report.asynchronous_flip_flops, 16);
        let hold = report.summary(CheckKind::Hold);
        assert!(
            hold.asynchronous_violated > 0,
            "photons ignore CLK: {report}"
        );
        for kind in CheckKind::ALL {
            assert!(
                report.summary(kind).checked > 0,
                "{kind:?} was never judged"
            );
        }
        // With no violation that acts, X has nothing to spread from.
        let (_, with_x) = sensor_report(&config, Policy::XOnViolation);
        assert!(histograms.is_some() && histograms == with_x);
    }
}
