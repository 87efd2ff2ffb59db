"""What goes wrong, with the sentences of the command ``gdtof``."""

__all__ = ["Error", "InputError", "SimulationError"]


class Error(Exception):
    """Anything that this package reports."""


class InputError(Error, ValueError):
    """Something that was asked for and cannot be: what is the case, and what would help.

    Files are named with their line, as ``my_chip.toml:3: ...``; several faults of a file have a line of text each.
    """


class SimulationError(Error, RuntimeError):
    """Something went wrong that other arguments would not mend."""
