"""Makes an exported testbench that parses nothing as it runs: CLK is compiled in, and all other pins' changes are loaded at
once. Reads tb.v and stimulus.txt, writes tb_preloaded.v and stimulus.hex. (Loading CLK's edges, too, costs Icarus as much as
parsing them.)

    preload.py FOLDER
"""
import re
import sys

folder = sys.argv[1]
bench = open(f"{folder}/tb.v").read()
clk_pin = int(re.search(r"\.CLK\(pins\[(\d+)\]\)", bench)[1])
clk, others = [], []
for line in open(f"{folder}/stimulus.txt"):
    time, pin, value = map(int, line.split())
    (clk if pin == clk_pin else others).append((time, pin, value))
with open(f"{folder}/stimulus.hex", "w") as out:
    out.writelines(f"{time:016x}{2 * pin + value:04x}\n" for time, pin, value in others)

assert all(a[2] != b[2] for a, b in zip(clk, clk[1:])), "every line of CLK is an edge"
steps = [b[0] - a[0] for a, b in zip(clk[1:], clk[2:])]
# Whole femtoseconds make the half periods of 384 MHz repeat after three.
period = next(p for p in range(1, len(steps)) if steps[p:] == steps[:-p])
repeats, rest = divmod(len(steps), period)


def toggles(delays):
    return " ".join(f"#{delay} clk = !clk;" for delay in delays)


clock = f"""\
  reg clk = {clk[0][2]};
  initial begin
    #{clk[1][0]} clk = !clk;
    repeat ({repeats}) begin {toggles(steps[:period])} end
    {toggles(steps[:rest])}
  end
  reg [79:0] changes [0:{len(others) - 1}], change;
"""
loop = re.compile(r"    while \(\$fscanf.*?\n    end\n", re.S)
assert loop.search(bench), "the testbench reads its stimulus in another way"
bench = loop.sub(f"""\
    $readmemh("stimulus.hex", changes);
    for (pin = 0; pin < {len(others)}; pin = pin + 1) begin
      change = changes[pin];
      if (change[79:16] > $time) #(change[79:16] - $time);
      pins[change[15:1]] = change[0];
    end
""", bench)
bench = bench.replace("module tb;\n", f"module tb;\n{clock}", 1).replace(f".CLK(pins[{clk_pin}])", ".CLK(clk)")
open(f"{folder}/tb_preloaded.v", "w").write(bench)
