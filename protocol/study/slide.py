"""The sliding experiment (paper, section 5.1): a block is drawn along the driven beam."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from protocol.study.fields import Count, Name, NotNegative, Positive, Record, Whole
from protocol.study.touch import (
    LONGEST_S,
    SHORTEST_S,
    Direction,
    Relative,
    Touch,
    TouchDefaults,
    Way,
)

MOST_PASSES = 200
"""In one experiment: it takes an hour or more."""
_AROUND_RESONANCE = (0.98, 0.99, 0.995, 1.0, 1.005, 1.01, 1.02)


class Slide(Record):
    """What is drawn along the beam, how, and how often.

    Each drive is combined with each path, speed and direction. A pass is one of these drawings.
    """

    # A block of 1 g hardly touches; the scale of the force ends at 10 N.
    load_n: Annotated[
        Positive, Field(ge=0.01, le=10, description="weight of the block and of what lies on it")
    ] = 0.56
    contact_m: Annotated[
        Positive, Field(ge=0.001, le=0.1, description="length of beam under the block")
    ] = 0.010
    voltage_v: Annotated[Positive, Field(description="amplitude (peak) of every driven pass")] = (
        100.0
    )
    # Friction at 23,200 Hz, the paper's only drive, hardly depends on the damping: a fit needs
    # passes on both sides of the resonance.
    frequencies: Annotated[
        tuple[Relative, ...],
        Field(
            max_length=50,
            description="frequencies of the drives, relative to the measured resonance",
        ),
    ] = _AROUND_RESONANCE
    frequencies_hz: Annotated[
        tuple[Annotated[Positive, Field(ge=1_000, le=100_000)], ...],
        Field(max_length=50, description="fixed frequencies of further drives, in Hz"),
    ] = (23_200.0,)
    references: Annotated[
        Whole,
        Field(
            le=50,
            description="how often the block is drawn without a drive (0 V), spread from first to "
            "last",
        ),
    ] = 3
    repeats: Annotated[
        Count,
        Field(
            le=20,
            description="how often each driven pass is made; all come once before one comes again",
        ),
    ] = 1
    directions: Annotated[
        tuple[Direction, ...],
        Field(min_length=1, max_length=2, description="directions of the block"),
    ] = ("right",)
    # A hand keeps no lower speed, and at 1 m/s a pass is over at once.
    speeds_m_s: Annotated[
        tuple[Annotated[Positive, Field(ge=0.001, le=1)], ...],
        Field(min_length=1, max_length=10, description="speeds of the mark that paces the block"),
    ] = (0.005,)
    paths_m: Annotated[
        tuple[Way, ...],
        Field(
            min_length=1,
            max_length=20,
            description="where the block is drawn (its right edge, clamp at 0): the whole way, or "
            "parts around places of interest",
        ),
    ] = ((0.010, 0.081),)
    beam: Annotated[Name | None, Field(description="one of `[beams]`, instead of `touch.beam`")] = (
        None
    )

    @model_validator(mode="after")
    def _has_passes(self) -> Self:
        if not self.frequencies and not self.frequencies_hz:
            raise ValueError("frequencies must hold some where frequencies_hz has none, got none")
        listed = ("frequencies", "frequencies_hz", "directions", "speeds_m_s", "paths_m")
        for key in listed:
            values = getattr(self, key)
            if twice := [value for value in values if values.count(value) > 1]:
                raise ValueError(f"{key} must hold no value twice, got {twice[0]} twice")
        if self.passes > MOST_PASSES:
            raise ValueError(f"must have at most {MOST_PASSES} passes, got {self.passes}")
        lengths_m = [right_m - left_m for left_m, right_m in self.paths_m]
        shortest_s = min(lengths_m) / max(self.speeds_m_s)
        longest_s = max(lengths_m) / min(self.speeds_m_s)
        if shortest_s < SHORTEST_S or longest_s > LONGEST_S:
            raise ValueError(
                f"a pass must take {SHORTEST_S:g} to {LONGEST_S:g} s, "
                f"got {shortest_s:.4g} to {longest_s:.4g} s"
            )
        return self

    @property
    def passes(self) -> int:
        """How often the block is drawn, references included."""
        drives = len(self.frequencies) + len(self.frequencies_hz)
        ways = len(self.paths_m) * len(self.speeds_m_s) * len(self.directions)
        return ways * (self.references + drives * self.repeats)

    def finger(self, usual: TouchDefaults) -> TouchDefaults:
        """Return how the block touches; lead-in and beam are those of the study's `usual` touch."""
        return usual.model_copy(
            update={
                "force_n": self.load_n,
                "contact_m": self.contact_m,
                "sliding_speed_m_s": self.speeds_m_s[0],
                "path_m": self.paths_m[0],
                "beam": self.beam or usual.beam,
            }
        )


class SlidePass(Touch):
    """One drawing of the block; its duration follows from path and speed."""

    path_m: Annotated[Way, Field(description="where the block is drawn")]
    frequency_hz: Annotated[
        Positive | None, Field(description="instead of `frequency`: a drive wherever it resonates")
    ] = None
    voltage_v: Annotated[NotNegative, Field(description="amplitude (peak), 0 in a reference")]

    @property
    def own_path_m(self) -> tuple[float, float]:
        """Ends of the block's way, m."""
        return self.path_m

    @property
    def fixed_hz(self) -> float | None:
        """Drive that does not follow the resonance, Hz."""
        return self.frequency_hz
