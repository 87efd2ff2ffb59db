"""Our semi-global matching beside OpenCV's StereoSGBM, in one run on one thread of one processor, on a pair of rectified pictures with truth.

    pip install opencv-python-headless numpy       # into an environment outside of this folder
    cargo build --release --bin gdtof
    stereo.py FOLDER [GDTOF] [DISPARITIES] [ROUNDS]

FOLDER has motorcycle_left.png, motorcycle_right.png and motorcycle_disp.npz, as scikit-image ships them (Middlebury 2014). Both see grey
pictures. Every round times each once more, in turns, so that a machine that is busy for a while is so for all. OpenCV keeps its memory from pair to
pair, and so do we.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import cv2
import numpy as np

folder = sys.argv[1]
gdtof = sys.argv[2] if len(sys.argv) > 2 else "target/release/gdtof"
disparities = int(sys.argv[3]) if len(sys.argv) > 3 else 64
rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 7
cv2.setNumThreads(1)
files = [f"{folder}/motorcycle_{side}.png" for side in ("left", "right")]
left, right = (cv2.imread(file, cv2.IMREAD_GRAYSCALE) for file in files)
truth = next(iter(np.load(f"{folder}/motorcycle_disp.npz").values())).astype(np.float64)
known = np.isfinite(truth)


def errors(found, valid):
    off = np.abs(found - truth)[valid & known]
    bad, total = np.count_nonzero(off > 2), np.count_nonzero(known)
    return {"bad_2px_percent": 100 * bad / off.size, "valid_percent": 100 * off.size / total,
            "bad_2px_or_invalid_percent": 100 * (total - off.size + bad) / total,
            "rms_px": np.sqrt(np.mean(off ** 2)), "median_px": np.median(off)}


def opencv(mode, block=3):
    matcher = cv2.StereoSGBM_create(0, disparities, block, 8 * block ** 2, 32 * block ** 2, 1, 63, 10, 100, 2, mode)
    matcher.compute(left, right)

    def run(times):
        for _ in range(5):
            start = time.perf_counter()
            found = matcher.compute(left, right)
            times.append(time.perf_counter() - start)
        return errors(found / 16, found >= 0)
    return run


def ours(paths):
    def run(times):
        with tempfile.TemporaryDirectory() as out:
            np.save(f"{out}/truth.npy", truth)
            command = [gdtof, "stereo", *files, "--truth", f"{out}/truth.npy", "--out", f"{out}/found", "--paths", str(paths),
                       "--disparities", str(disparities), "--repeat", "6", "--json"]
            result = subprocess.run(command, env={**os.environ, "RAYON_NUM_THREADS": "1"}, check=True, capture_output=True)
        result = json.loads(result.stdout)
        times.extend(result["run_time_s"])
        return result["errors"]
    return run


rows = [("OpenCV, 3 paths", opencv(cv2.STEREO_SGBM_MODE_SGBM_3WAY)), ("gdtof, 3 paths", ours(3)),
        ("OpenCV, 4 paths", opencv(cv2.STEREO_SGBM_MODE_HH4)), ("gdtof, 4 paths", ours(4)),
        ("OpenCV, 5 paths", opencv(cv2.STEREO_SGBM_MODE_SGBM)), ("gdtof, 5 paths", ours(5)),
        ("OpenCV, 8 paths", opencv(cv2.STEREO_SGBM_MODE_HH)), ("gdtof, 8 paths", ours(8))]
times = {name: [] for name, _ in rows}
for _ in range(rounds):
    found = {name: run(times[name]) for name, run in rows}
print(f"{left.shape[1]} x {left.shape[0]} pixels, {disparities} disparities, OpenCV {cv2.__version__}, one thread")
print(f"{'':<16} {'> 2 px of valid':>16} {'valid':>8} {'> 2 px or invalid':>18} {'RMS':>9} {'median':>9} {'least, median run time':>24}")
for name, _ in rows:
    e, t = found[name], [1e3 * s for s in times[name]]
    print(f"{name:<16} {e['bad_2px_percent']:>14.2f} % {e['valid_percent']:>6.1f} % {e['bad_2px_or_invalid_percent']:>16.2f} % "
          f"{e['rms_px']:>6.2f} px {e['median_px']:>6.3f} px {min(t):>12.1f} {statistics.median(t):>8.1f} ms")
