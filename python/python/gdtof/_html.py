"""What notebooks show of sensors, scenes and frames."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

from ._arrays import FrameArrays


def _table(caption: str, rows: Iterable[tuple[str, str]]) -> str:
    cell = "<tr><th style='text-align:left'>{}</th><td style='text-align:left'>{}</td></tr>"
    body = "".join(cell.format(escape(name), escape(value)) for name, value in rows)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"


def of_keys(caption: str, keys: dict[str, Any]) -> str:
    """A table of settings; sections and lists have their items counted."""

    def text(value: Any) -> str:
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return ", ".join(str(item.get("name", "?")) for item in value)
        if isinstance(value, dict):
            return ", ".join(f"{key} = {inner}" for key, inner in value.items())
        return str(value)

    return _table(caption, ((key, text(value)) for key, value in keys.items()))


def of_frame(frame: FrameArrays) -> str:
    summary = frame.summary

    def metres(name: str) -> str:
        value = summary[name]
        return "none" if value is None else f"{value:.3f} m"

    rows, cols, bins = frame.shape
    lines = [
        ("macropixels", f"{rows} x {cols}, {bins} bins of {frame.bin_m:.3f} m"),
        ("that see a surface", str(summary["with_target"])),
        ("guided, target in window", f"{summary['guided']}, {summary['in_window']}"),
        ("depths, wrong by more than a bin", f"{summary['depths']}, {summary['outliers']}"),
        ("RMS error without these", metres("rms_error_without_outliers_m")),
        ("median absolute error", metres("median_absolute_error_m")),
    ]
    no_depth = sorted(summary["no_depth"].items(), key=lambda item: -item[1])
    lines += [(f"no depth: {name.replace('_', ' ')}", str(count)) for name, count in no_depth]
    remark = getattr(frame, "remark", None)
    sentences = [remark] if remark else []
    sentences += [hint.sentence for hint in getattr(frame, "hints", [])]
    notes = "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)
    return _table(repr(frame).strip("<>").split(",")[0].split(" ")[0], lines) + notes
