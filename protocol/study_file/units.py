"""Hints for values that were entered in the wrong unit."""

from dataclasses import dataclass

from protocol.errors import Path


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit, the one that is taken for it, what that one is in it, and an example in that one."""

    name: str
    mistaken: str
    worth: float
    example: float

    def hint(self, value: object, *, too_large: bool) -> str:
        """Return the unit, and what `value` would be if it were in the mistaken one.

        >>> METRE.hint(41.4, too_large=True)
        'in m: 41.4 mm is 0.0414'
        """
        shown = self.example
        if isinstance(value, int | float) and too_large == (self.worth < 1):
            shown = value if 1e-3 <= abs(value) <= 1e5 else shown
        return f"in {self.name}: {shown:g} {self.mistaken} is {shown * self.worth:.5g}"


METRE = Unit(name="m", mistaken="mm", worth=1e-3, example=10)
_BY_ENDING = {
    "_m_s": Unit(name="m/s", mistaken="mm/s", worth=1e-3, example=40),
    "_m": METRE,
    "_s": Unit(name="s", mistaken="ms", worth=1e-3, example=500),
    "_n": Unit(name="N", mistaken="g", worth=9.80665e-3, example=50),
    "_hz": Unit(name="Hz", mistaken="kHz", worth=1e3, example=24.221),
    "_nf": Unit(name="nF", mistaken="pF", worth=1e-3, example=2200),
    "_ma": Unit(name="mA", mistaken="A", worth=1e3, example=0.1),
    "_vpp": Unit(name="V", mistaken="mV", worth=1e-3, example=500),
}
_HINTS = {
    "frequency": "relative to the resonance: 1.0 drives the beam there",
    "frequencies": "relative to the resonance: 1.0 drives the beam there",
    "sweep_to": "relative to the resonance: 1.0 drives the beam there",
    "press": "relative to touch.force_n: 1.5 presses half as hard again",
    "levels": "amplitudes are multiplied by it: 0.5 halves them",
    "amplifier_gain": "volts out per volt in: 26 dB is 20",
    "rate_hz": "samples per second",
}


def unit_hint(path: Path, value: object = None, *, too_large: bool = True) -> str:
    """Return which unit the number at `path` of a study file is in, empty where it has none.

    The `value` there is `too_large`, or else too small.
    """
    if path[0] == "beams":
        return METRE.hint(value, too_large=too_large)
    key = next((part for part in reversed(path) if isinstance(part, str)), "")
    if key in _HINTS:
        return _HINTS[key]
    found = (unit for ending, unit in _BY_ENDING.items() if key.endswith(ending))
    unit = None if key.endswith("_per_s") else next(found, None)
    return unit.hint(value, too_large=too_large) if unit else ""
