#!/usr/bin/env bash
# Remakes the golden results in this folder at gate level. Run it only after a deliberate change of the
# chip, and read the difference before committing it.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p vectors/traces
mkdir -p vectors/range vectors/timing
GDTOF_REMAKE=1 cargo test --release --quiet -p femtogate --test kernel -- --exact \
    traces_are_deterministic::every_build_finds_the_golden_hashes
GDTOF_REMAKE=1 cargo test --release --quiet --test command -- --exact \
    golden_vectors_hold::in_the_delays_of_every_p_counter
GDTOF_REMAKE=1 cargo test --release --quiet --test command -- --exact \
    real_histograms_are_ranged::the_sample_captures_are_ranged
GDTOF_REMAKE=1 cargo test --release --quiet --test command -- --exact \
    histograms_of_any_sensor_are_ranged::the_sample_logs_give_their_distances \
    histograms_of_any_sensor_are_ranged::a_table_is_ranged_and_written
GDTOF_REMAKE=1 cargo test --release --quiet --test command -- --exact \
    the_book_lists_every_key::with_its_unit_range_and_source \
    python_knows_every_key::with_the_type_of_its_values
GDTOF_REMAKE=1 cargo test --release --quiet --test command -- --exact \
    the_same_everywhere::with_any_number_of_threads
cd vectors/replay
cargo run --release --quiet -- replay --sensor sensor.toml --inits inits.csv --events events.csv \
    --stop-periods 80 --laser-cycles 40 --engine gate --out histograms.csv

# The README's picture, and that of the first hour; look at them.
cd ../scenes
frame=$(mktemp -d)
cargo run --release --quiet -- frame --scene outdoor.toml --probe none --out "$frame"
cp "$frame/depth.png" outdoor_depth.png
cargo run --release --quiet -- frame --scene warehouse --sensor vcsel_flash --probe none --out "$frame"
cp "$frame/depth.png" ../../docs/src/pictures/warehouse_depth.png
rm -r "$frame"

# Verdicts of the published figures.
cd ../reproduce
cargo run --release --quiet -- reproduce --json | python3 -c '
import json, sys
for claim in json.load(sys.stdin)["claims"]:
    for row in claim["rows"]:
        print(claim["claim"], row["quantity"], row["verdict"], sep=" | ")' > verdicts.txt

# References of `tests/figures/functions_keep_their_promises.rs` and, some minutes, of the theory; need Python with mpmath.
python3 ../stability/make.py
cd ../theory
python3 detection.py
python3 precision.py
GDTOF_REMAKE=1 cargo test --quiet --test figures -- --exact functions_keep_their_promises::every_function_keeps_its_promise
