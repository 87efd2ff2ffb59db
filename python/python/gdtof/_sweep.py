"""Sweeps, on this machine or on a cluster."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _gdtof
from .errors import InputError

if TYPE_CHECKING:
    import pandas

PARTS_A_THREAD = 4
"""Parts of a study for each thread of a cluster: a killed one is a quarter of a thread's work at most, and a slow one is shared out."""

RETRIES = 3
"""How often a part is begun again that failed, as one whose worker was thought lost and still takes it. How many workers may be lost under a
part is the scheduler's to say (distributed.scheduler.allowed-failures)."""


@dataclass(frozen=True)
class Swept:
    """What :func:`sweep` gives: the table is in `folder`, as `results.csv` and `results.parquet`."""

    folder: Path
    """Where table and journals are."""
    points: int
    """Points of the study."""
    reused: int
    """Those whose rows were there before."""
    taken: int
    """Those that were taken now."""
    without_results: int
    """Those of them that cannot be, or that the engine refuses: their rows say why."""

    def to_pandas(self) -> pandas.DataFrame:
        """The table: a row for each point."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("tables need pandas; pip install 'gdtof[pandas]'") from error
        table: pandas.DataFrame = pandas.read_csv(self.folder / "results.csv", index_col="point")
        return table


def sweep(
    study: str | PathLike[str] | dict[str, Any],
    folder: str | PathLike[str] | None = None,
    *,
    client: Any = None,
    parts: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> Swept:
    """Takes all points of a study that its folder has no rows of, and writes the table: the same as `gdtof sweep`, to the bit.

    Whatever ends it, the next one goes on from there: rows are kept in journals as they are made, under a hash of all that they depend on.

    Parameters
    ----------
    study
        The study file (TOML), or a dict of its sections: ``{"study": {"kind": "frame"}, "fixed": {"sensor.rows": 8},
        "vary": {"scene.lidar.pde": [0.1, 0.2]}}``, as ``tomllib.load`` gives it. Keys may be nested or have dots; what varies first in the dict
        varies slowest. Files that it names are relative to the current folder.
    folder
        Where journals and table go; what the study says, or its name, without it.
    client
        A Dask client (``distributed.Client``): the study is taken in parts on its workers, each part on one thread. Workers must see
        a study file, the files that it names and `folder` under the paths that are given here, as on a cluster's shared file system.
        A part whose worker is lost goes on elsewhere from its last row. All threads of this process without a client.
    parts
        Parts of the study with a client, each a task; four for each thread of its workers without it. The same number must be given to
        take up parts that another sweep is still taking.
    progress
        Called now and then with the number of points that are done.

    Raises
    ------
    InputError
        What cannot be in the study, all at once with their lines. Why the first point has no result, if no point has one.
    """
    if not isinstance(study, dict | str | PathLike):
        raise InputError(f"study: {type(study).__name__} is no study; give a file, or a dict of its sections")
    if isinstance(study, dict):
        # Where it would stand as a file.
        path, text = Path("study").absolute(), _gdtof.sweep_text(study)
    else:
        path, text = Path(fspath(study)).absolute(), None
    points, out, _ = _gdtof.sweep_outline(path, text)
    where = (Path(out) if folder is None else Path(fspath(folder))).absolute()
    if client is None:
        if parts is not None:
            raise InputError("parts: are for a client; leave them out")
        outcome = _gdtof.sweep_part(path, text, where, (0, 1), 0, progress)
        outcomes = [outcome]
    else:
        outcomes = _on_cluster(client, (path, text), where, points, parts, progress)
    written = _gdtof.sweep_table(where)
    if written["missing"]:
        raise InputError(f"{where}: {written['missing']} of {points} points have no row; sweep again")
    counts = {key: sum(o[key] for o in outcomes) for key in ("reused", "taken")}
    return Swept(where, points, **counts, without_results=written["without_results"])


def _take(study: tuple[Path, str | None], folder: Path, part: int, of: int) -> dict[str, Any]:
    """On a worker."""
    return _gdtof.sweep_part(*study, folder, (part, of), 1, None)


def _on_cluster(
    client: Any,
    study: tuple[Path, str | None],
    folder: Path,
    points: int,
    parts: int | None,
    progress: Callable[[int], object] | None,
) -> list[dict[str, Any]]:
    from distributed import as_completed

    if parts is None:
        parts = PARTS_A_THREAD * max(sum(client.nthreads().values()), 1)
    if parts < 1:
        raise InputError(f"parts: {parts} is impossible; give 1 or more")
    parts = min(parts, points)
    futures = [
        client.submit(_take, study, folder, part, parts, pure=False, retries=RETRIES, key=f"gdtof-{part}-{id(client)}-{folder}")
        for part in range(parts)
    ]
    outcomes = []
    try:
        for future in as_completed(futures):
            outcomes.append(future.result())
            if progress is not None:
                progress(sum(outcome["points"] for outcome in outcomes))
    except BaseException:
        client.cancel(futures)
        raise
    return outcomes
