#!/usr/bin/env bash
# The same netlist, stimulus and machine, one core each: Icarus Verilog against our gate engine, alone and in lanes.
# Icarus runs the exported cells, which are exact edge for edge, and cells written for its speed; each with the exported
# testbench, which parses its stimulus as it goes, and with one that loads it at once. Histograms must agree. Whole
# processes are timed, start and files included, by the kernel's accounting to the microsecond: least, median and most of
# the runs. A second exposure of one laser cycle tells start from simulation. Needs iverilog and Python.
#
#   benches/compare/icarus.sh [LASER_CYCLES [RUNS]]
set -euo pipefail
cd "$(dirname "$0")/../.."
cycles=${1:-200}
runs=${2:-5}
periods=520
command -v iverilog >/dev/null || { echo "iverilog is not installed: nothing to compare with" >&2; exit 2; }
cargo build --release --quiet --bin gdtof
here=$PWD/benches/compare
gdtof=$PWD/target/release/gdtof
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# 10 Mcounts/s of background and about one signal photon in each of $2 laser cycles, in each of $1 columns.
stimulus() {
    awk -v cols="$1" -v n="$2" -v p="$periods" 'BEGIN {
        srand(1); t = 1e15 / 384e6 * p
        print "time_fs,row,col,spad" > "events.csv"; print "row,col,init" > "inits.csv"
        for (c = 0; c < cols; c++) {
            print "0," c "," (300 + c * 37) % 512 > "inits.csv"
            for (i = 0; i < n; i++) {
                printf "%.0f,0,%d,%d\n", (i + 0.56 + 0.004 * rand()) * t, c, rand() * 16 > "events.csv"
                for (b = -log(rand()); b < 13.5; b -= log(rand()))
                    printf "%.0f,0,%d,%d\n", (i + b / 13.5) * t, c, rand() * 16 > "events.csv"
            }
        }
    }'
}
measure() { echo "$1 $2 $(python3 "$here/measure.py" "$3" "${@:4}")" >>"$work/times"; }

for n in 1 "$cycles"; do
    mkdir -p "$work/$n" && cd "$work/$n"
    replay=(--inits inits.csv --events events.csv --stop-periods $periods --laser-cycles "$n")
    stimulus 64 "$n"
    measure lanes "$n" "$runs" "$gdtof" replay --rows 1 --cols 64 "${replay[@]}" --engine gate --out lanes.csv
    stimulus 1 "$n"
    measure one "$n" "$runs" "$gdtof" replay --rows 1 --cols 1 "${replay[@]}" --engine gate --out one.csv
    measure one_vcd "$n" "$runs" "$gdtof" replay --rows 1 --cols 1 "${replay[@]}" --engine gate --out one.csv --vcd one.vcd
    "$gdtof" export verilog --rows 1 --cols 1 "${replay[@]}" --out verilog >/dev/null 2>&1
    cd verilog
    python3 "$here/preload.py" .
    for cells in exact lean; do
        file=cells.v
        [ $cells = exact ] || file=$here/lean_cells.v
        iverilog -g2005 -o $cells tb.v design.v "$file"
        iverilog -g2005 -o ${cells}_preloaded tb_preloaded.v design.v "$file"
        # The exported cells take minutes: a third of the runs.
        [ $cells = exact ] && some=$(((runs + 2) / 3)) || some=$runs
        for bench in $cells ${cells}_preloaded; do
            rm -f histograms.csv
            measure $bench "$n" "$some" vvp -n $bench
            cmp ../one.csv histograms.csv
        done
    done
    measure lean_vcd "$n" "$runs" vvp -n lean +vcd
done
cd "$here/../.."
python3 "$here/icarus_table.py" "$work/times" $periods
cargo bench --quiet --bench figures
