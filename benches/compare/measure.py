"""Runs a command several times and prints "least median most peak": processor seconds (user and system, microseconds
exact, from the kernel's accounting of that process) and peak memory in MB.

    measure.py RUNS COMMAND ...
"""
import os
import statistics
import sys

runs, command = int(sys.argv[1]), sys.argv[2:]
seconds, peak = [], 0
for _ in range(runs):
    with open(os.devnull, "w") as nothing:
        actions = [(os.POSIX_SPAWN_DUP2, nothing.fileno(), 1), (os.POSIX_SPAWN_DUP2, nothing.fileno(), 2)]
        process = os.posix_spawnp(command[0], command, os.environ, file_actions=actions)
    _, status, usage = os.wait4(process, 0)
    if status:
        sys.exit(f"{' '.join(command)} failed")
    seconds.append(usage.ru_utime + usage.ru_stime)
    peak = max(peak, usage.ru_maxrss / 1024)
print(f"{min(seconds):.6f} {statistics.median(seconds):.6f} {max(seconds):.6f} {peak:.1f}")
