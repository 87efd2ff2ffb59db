"""A guided direct time-of-flight lidar chip, down to gates and flip-flops.

>>> import gdtof
>>> frame = gdtof.frame(scene="street", laser_cycles=2000)
>>> frame.depth.shape
(64, 64)
>>> frame.plot()                                                  # doctest: +SKIP

Distances are metres along the ray, NaN where there is none; arrays by macropixel have the shape (rows, cols).
"""

from . import errors, theory, waves
from ._arrays import Reason, WalkLeft
from ._detector import Agreement, Coincidence, Detected, Detector
from ._frame import Drive, DriveFrame, Frame, Hint, Maps, drive, frame
from ._gdtof import Guide, Problem, Scene, Sensor, __version__
from ._histograms import Exposed, Ranged, Replayed, expose, range, replay
from ._light import Light, Photons, light
from ._sweep import Swept, sweep
from ._timing import Timing, bin_edges, starts_for, timing, windows
from .errors import Error, InputError, SimulationError
from .waves import Waveform, read_vcd

__all__ = [
    "Agreement",
    "Coincidence",
    "Detected",
    "Detector",
    "Drive",
    "DriveFrame",
    "Error",
    "Exposed",
    "Frame",
    "Guide",
    "Hint",
    "InputError",
    "Light",
    "Maps",
    "Photons",
    "Problem",
    "Ranged",
    "Reason",
    "WalkLeft",
    "Replayed",
    "Scene",
    "Sensor",
    "SimulationError",
    "Swept",
    "Timing",
    "Waveform",
    "__version__",
    "bin_edges",
    "drive",
    "errors",
    "expose",
    "frame",
    "light",
    "range",
    "read_vcd",
    "replay",
    "starts_for",
    "sweep",
    "theory",
    "timing",
    "waves",
    "windows",
]
