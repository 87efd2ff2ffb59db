//! `frame` in the conventional mode: every macropixel looks at the CLK periods before STOP, with or without a guide.

use std::process::Command;

fn frame(options: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args("frame --rows 32 --cols 32 --laser-cycles 2000 --json".split(' '))
        .args(options.split(' '))
        .current_dir(folder.path())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{options}: {error}");
    serde_json::from_slice(&run.stdout).unwrap()
}

#[test]
fn it_sees_what_lies_before_stop_and_nothing_else() {
    // 16 bins of 0.39 m that end at 196 and at 15.5 m or so: nothing, and the ground and the near car.
    for (stop_periods, probes) in [(520, "none"), (55, "20,16")] {
        let options = format!(
            "--set sensor.mode=conventional --stop-periods {stop_periods} --probe {probes}"
        );
        let frame = frame(&options);
        let window_m = |bins: f64| {
            let law = &frame["distance"];
            let opens_s = law["window_opens_s"]["0"].as_f64().unwrap();
            let bin_s = law["bin_width_s"].as_f64().unwrap();
            299_792_458.0 / 2.0 * (opens_s + bins * bin_s)
        };
        let (from_m, to_m) = (window_m(0.0), window_m(16.0));
        let (mut inside, mut found) = (0, 0);
        for pixel in frame["macropixels"].as_array().unwrap() {
            assert_eq!(pixel["start"], 0);
            assert!(pixel["no_depth"] != "no_guide" && pixel["no_depth"] != "out_of_reach");
            let true_m = pixel["true_m"].as_f64().unwrap_or(f64::INFINITY);
            assert_eq!(pixel["in_window"], (from_m..to_m).contains(&true_m));
            if (from_m + 1.0..to_m - 1.0).contains(&true_m) {
                inside += 1;
                let error_m = pixel["measured_m"].as_f64().map(|m| (m - true_m).abs());
                found += usize::from(error_m.is_some_and(|m| m < 0.4));
            }
        }
        if stop_periods == 520 {
            assert_eq!(inside, 0);
            let remark = frame["remark"].as_str().unwrap();
            assert!(
                remark.contains("the STOP that ends the laser cycle, from 196."),
                "{remark}"
            );
        } else {
            assert!(
                inside > 20 && 10 * found > 9 * inside,
                "{found} of {inside}"
            );
            assert_eq!(frame["probes"].as_array().unwrap().len(), 1);
        }
    }
}
