"""Types of the keys of a sensor, and names of what is built in.

Made by `GDTOF_REMAKE=1 cargo test --test command python_knows_every_key` from the tables that files are held to.
"""

from collections.abc import Sequence
from typing import Any, Literal, SupportsFloat, SupportsIndex, TypedDict

SensorName = Literal["quantic4x4", "vcsel_flash", "hslidar", "hslidar_delay_line"]

SceneName = Literal["street", "warehouse", "van", "fog", "glass", "sweep", "night", "empty"]


class SensorKeys(TypedDict, total=False):
    """Keys of a sensor. `gdtof sensor` prints what each is, its unit and range."""

    rows: SupportsIndex | str
    cols: SupportsIndex | str
    spad_rows: SupportsIndex | str
    spad_cols: SupportsIndex | str
    front_end: Literal["summation", "or_tree", "xor_tree", "coincidence"]
    coincident_spads: SupportsIndex | str
    counter_bits: SupportsIndex | str
    p_counter: Literal["ripple", "set_reset", "synchronous", "comparator", "memoryless", "gray", "segmented"]
    p_counter_block: str
    tap: Literal["borrow", "msb"]
    after_borrow: Literal["hold", "wrap"]
    step_periods: SupportsIndex | str
    reset_stages: SupportsIndex | str
    tdc: Literal["clocked", "counter", "delay_line"]
    delay_control_v: SupportsFloat | str
    delay_sigma: SupportsFloat | str
    delay_seed: SupportsIndex | str
    clk_skew_ps: SupportsFloat | str
    bins: SupportsIndex | str
    bin_bits: SupportsIndex | str
    clk_hz: SupportsFloat | str
    stop_phase_ps: SupportsFloat | str
    load_clk_hz: SupportsFloat | str
    reset_to_load: bool
    readout_pins: SupportsIndex | str
    read_clk_hz: SupportsFloat | str
    dead_time_ns: SupportsFloat | str
    dead_time_spread: SupportsFloat | str
    dead_time_seed: SupportsIndex | str
    paralysable: bool
    afterpulse_probability: SupportsFloat | str
    afterpulse_time_ns: SupportsFloat | str
    afterpulse_activation_ev: SupportsFloat | str
    crosstalk_probability: SupportsFloat | str
    correlation_block: str
    front_end_block: str
    metdc_block: str
    histogram_block: str
    event_type: Literal["less", "equal", "greater"]
    threshold: SupportsIndex | str
    overflow: Literal["saturate", "wrap"]
    mode: Literal["guided", "conventional"]
    corner: Literal["slow", "typ", "fast"]
    temperature_c: SupportsFloat | str | Sequence[Any]
    liberty: str
    liberty_slow: str
    liberty_fast: str
    liberty_cells: str
    input_slew_ps: SupportsFloat | str
    wire_ff: SupportsFloat | str
