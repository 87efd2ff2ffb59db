"""The table of icarus.sh, from lines of "name laser-cycles least median most peak"."""
import sys

times, periods = {}, int(sys.argv[2])
for line in open(sys.argv[1]):
    name, cycles, *numbers = line.split()
    times.setdefault(name, {})[int(cycles)] = [float(number) for number in numbers]
cycles = max(times["one"])


def median(name):
    return times[name][cycles][1]


def laser_cycle(name):
    """A laser cycle more: what is left when start and files are taken off."""
    return (median(name) - times[name][1][1]) / (cycles - 1)


rows = [
    ("Icarus, exported cells, stimulus parsed", "exact", 1),
    ("Icarus, exported cells, preloaded", "exact_preloaded", 1),
    ("Icarus, lean cells, stimulus parsed", "lean", 1),
    ("Icarus, lean cells, preloaded", "lean_preloaded", 1),
    ("gate engine, one macropixel", "one", 1),
    ("gate engine, 64 macropixels in lanes", "lanes", 64),
]
print(f"{cycles} laser cycles of {periods} CLK periods, histograms equal; processor time of whole processes")
print(f"{'':<40} {'least, median, most (s)':>26} {'k mpx-CLK/s':>12} {'x lean, parsed':>15} {'x lean, preloaded':>18} "
      f"{'a laser cycle more (ms)':>24} {'x lean, preloaded':>18} {'peak MB':>8}")
for title, name, pixels in rows:
    least, middle, most, peak = times[name][cycles]
    more = laser_cycle(name)
    print(f"{title:<40} {least:>8.3f} {middle:>8.3f} {most:>8.3f} {1e-3 * pixels * cycles * periods / middle:>12.1f} "
          f"{pixels * median('lean') / middle:>15.1f} {pixels * median('lean_preloaded') / middle:>18.1f} "
          f"{1e3 * more:>24.4f} {pixels * laser_cycle('lean_preloaded') / more:>18.1f} {peak:>8.1f}")
for title, name in (("gate engine", "one"), ("Icarus", "lean")):
    print(f"{title}: with a VCD {median(name + '_vcd') / median(name):.2f} times as long")
print("Left out by the lean cells: X propagation, delays by input pin, ties within an instant. By ours: nothing.")
