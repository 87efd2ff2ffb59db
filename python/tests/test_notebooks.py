"""Notebooks run from top to bottom, and are kept with small outputs that a run still prints.

`GDTOF_REMAKE=1 pytest -c python/pyproject.toml python/tests/test_notebooks.py` writes the outputs anew. Look at the pictures then.
"""

from __future__ import annotations

import base64
import io
import os
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from PIL import Image

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
NAMES = sorted(path.name for path in NOTEBOOKS.glob("*.ipynb"))

MOST_PICTURE_BYTES = 100_000
MOST_NOTEBOOK_BYTES = 400_000


def _read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]


def _code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def _printed(cell: Any) -> str:
    return "".join(output.text for output in cell.outputs if output.get("name") == "stdout")


def _kinds(cell: Any) -> list[str]:
    """What a cell shows besides what it prints."""
    return ["image/png" if "image/png" in output.data else "text" for output in cell.outputs if "data" in output]


def _small(picture: str) -> str:
    """The picture in 256 colours."""
    small = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(picture))) as image:
        image.convert("RGB").quantize(256).save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def _kept(notebook: Any, original: Any) -> Any:
    """The notebook with what is the same in every run."""
    notebook.metadata = original.metadata
    for cell in _code_cells(notebook):
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            # Tables of xarray have other names inside in each run.
            if "xr-wrap" in output.get("data", {}).get("text/html", ""):
                del output.data["text/html"]
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = _small(output.data["image/png"])
    return notebook


@pytest.mark.parametrize("name", NAMES)
def test_notebook_runs_and_prints_what_is_kept(name: str, tmp_path: Path) -> None:
    kept, notebook = _read(NOTEBOOKS / name), _read(NOTEBOOKS / name)
    for cell in _code_cells(notebook):
        cell.outputs, cell.execution_count = [], None
    NotebookClient(
        notebook,
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute()
    if os.environ.get("GDTOF_REMAKE"):
        kept = _kept(notebook, kept)
        nbformat.write(kept, NOTEBOOKS / name)  # type: ignore[no-untyped-call]
    for before, now in zip(_code_cells(kept), _code_cells(notebook), strict=True):
        assert _printed(before) == _printed(now), f"{now.source}\nprints something else; remake the outputs"
        assert _kinds(before) == _kinds(now), f"{now.source}\nshows something else; remake the outputs"


@pytest.mark.parametrize("name", NAMES)
def test_outputs_are_kept_and_small(name: str) -> None:
    assert (NOTEBOOKS / name).stat().st_size < MOST_NOTEBOOK_BYTES
    cells = _code_cells(_read(NOTEBOOKS / name))
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    pictures = [output.data["image/png"] for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    assert pictures
    assert any(_printed(cell) for cell in cells)
    assert not any(output.output_type == "error" for cell in cells for output in cell.outputs)
    for picture in pictures:
        data = base64.b64decode(picture)
        assert data.startswith(b"\x89PNG")
        assert len(data) < MOST_PICTURE_BYTES


def test_there_are_notebooks() -> None:
    assert len(NAMES) >= 3
