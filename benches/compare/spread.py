"""Rows of verilator.sh's table: least, median and most of the runs of some files of "logic packing" seconds."""
import statistics
import sys

if len(sys.argv) == 1:
    print(f"{'64x64 macropixels, one thread, histograms equal':<46} {'logic: least, median, most (ms)':>34} "
          f"{'G mpx-CLK/s':>12} {'with packing (ms)':>27} {'G mpx-CLK/s':>12} {'ours: logic, with packing':>26}")
    sys.exit()

what, work, files = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
names = ["Verilator, RTL as one loop over memories", "Verilator, bit-sliced, 4096 to a word",
         "Verilator, bit-sliced, 64 to a word", "cycle engine, netlist"]
runs = [[tuple(map(float, line.split())) for line in open(file)] for file in files]
sides = [([logic for logic, _ in times], [sum(both) for both in times]) for times in runs]


def spread(seconds):
    return f"{1e3 * min(seconds):.2f} {1e3 * statistics.median(seconds):.2f} {1e3 * max(seconds):.2f}"


print(what)
ours = [statistics.median(side) for side in sides[-1]]
for name, side in zip(names, sides):
    medians = [statistics.median(times) for times in side]
    ratio = ", ".join(f"{theirs / own:.1f}x" for theirs, own in zip(medians, ours))
    print(f"  {name:<44} {spread(side[0]):>34} {1e-9 * work / medians[0]:>12.2f} "
          f"{spread(side[1]):>27} {1e-9 * work / medians[1]:>12.2f} {ratio:>26}")
