"""A virtual finger: how hard, how fast and where it touches, and when it feels."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.people.person import People
from protocol.study.touch import Mark

_SLIDE = np.linspace(0.0, 1.0, 25)
_HOLD = np.array([0.0, 1.0])
TOUCH_NUMBERS = 2
"""Random numbers per touch: for force and speed."""
_LEAST = 0.2
"""Of force and speed, relative to the instructed ones: a finger touches, and moves."""
_LENGTH_M = Beam().length_m


def fractions(mark: Mark) -> FloatArray:
    """Return the parts of a touch's time at which a finger notes what it feels.

    They are the same however often it is looked at.
    """
    return _SLIDE if mark.slides else _HOLD


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """A touch as people make it: force, speed (m/s, 0 without a slide) and way, shape (people,).

    `speed_factor` is relative to the mark's, `offset_m` how far right of it the finger is.
    """

    mark: Mark
    force_n: FloatArray
    speed_factor: FloatArray
    offset_m: FloatArray

    @property
    def speed_m_s(self) -> FloatArray:
        """The speed of a slide."""
        return self.speed_factor * abs(self.mark.end_m - self.mark.start_m) / self.mark.duration_s

    def places_m(self, parts: FloatArray) -> FloatArray:
        """Return where the finger is at parts of the touch's time, shape (people, parts).

        It stops after the length of the mark's way, and at the ends of the beam.
        """
        gone = np.minimum(self.speed_factor[:, None] * parts, 1.0)
        way_m = self.mark.end_m - self.mark.start_m
        places_m = self.mark.start_m + self.offset_m[:, None] + way_m * gone
        return np.asarray(np.clip(places_m, 0.0, _LENGTH_M))


def course(people: People, u: FloatArray, mark: Mark) -> Course:
    """Return how people make a touch.

    `u` are their random numbers for it, shape (people, TOUCH_NUMBERS).
    """
    force = people.force_factor * (1 + people.force_error * ndtri(u[:, 0]))
    speed = people.speed_factor * (1 + people.speed_error * ndtri(u[:, 1]))
    return Course(
        mark=mark,
        force_n=mark.force_n * np.maximum(force, _LEAST),
        speed_factor=np.maximum(speed, _LEAST),
        offset_m=people.place_offset_m,
    )
