"""What a maker's manual says of a generator that speaks SCPI: its simulated double follows from it.

Commands stand here as manuals write them, and not as the driver beside them sends them, so that a
driver that sends a wrong one is answered with an error.
"""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace


@dataclass(frozen=True)
class Setting:
    """What a channel keeps: a number with `unit` (`V`, `s`) and range, one of `words`, a switch.

    `name` is the attribute of the simulated channel that keeps it, '' for one that is only kept.
    """

    header: str
    _: KW_ONLY
    name: str = ""
    default: float | str | bool = False
    lowest: float = 0.0
    highest: float = 0.0
    unit: str = ""
    words: tuple[str, ...] = ()


UNIT = Setting("VOLTage:UNIT", name="unit", words=("VPP", "VRMS"))


def function(*words: str) -> Setting:
    """Return the setting of the wave, which is one of `words`."""
    return Setting("FUNCtion[:SHAPe]", name="function", words=words)


def limits(header: str) -> tuple[Setting, Setting]:
    """Return the settings of the voltage limits, which begin with `header`."""
    high = Setting(f"{header}:HIGH", name="limit_high_v", lowest=-10.0, highest=10.0, unit="V")
    return high, replace(high, header=f"{header}:LOW", name="limit_low_v")


@dataclass(frozen=True, kw_only=True)
class Model:
    """A model of a generator.

    Attributes:
        digits: of a number in an answer, after its first one.
        limit_switch: the command for the voltage limits, '' where there are none.
        modulation: the setting for frequency modulation, and its value while that is on.
        addition: the same for the signal that is added to that of channel 1; that signal is the
            one of channel `added_channel`.
        switches: how it answers that something is off, and on.
        plus: what stands before a number that is not negative.
        load: the commands for the load.
        applies: whether `APPLy` sets everything at once.
        answers: what it answers to further queries, whatever is set.
    """

    idn: str
    channels: int
    digits: int
    least_emf_vpp: float
    most_hz: float
    modulation: tuple[str, str | bool]
    addition: tuple[str, str | bool]
    added_channel: int = 2
    settings: tuple[Setting, ...] = ()
    limit_switch: str = ""
    switches: tuple[str, str] = ("0", "1")
    plus: str = ""
    load: tuple[str, ...] = ("LOAD",)
    applies: bool = False
    answers: Mapping[str, str] = field(default_factory=dict)
