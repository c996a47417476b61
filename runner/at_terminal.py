"""Whether somebody is at the other end of a stream; any of the standard ones may be closed."""

from typing import TextIO


def at_terminal(*streams: TextIO | None) -> bool:
    """Return whether all of `streams` are a terminal's.

    rich also takes FORCE_COLOR for a terminal, which is none.
    """
    return all(stream is not None and stream.isatty() for stream in streams)
