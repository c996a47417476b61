"""The device's real output during a touch: every stimulus programme, over the real byte path."""

from typing import Any

import pytest

from protocol.plan.plan import plan
from protocol.study_file.loading import parsed_study
from runner.launch.rehearsal import rehearse

STUDY = """
[study]
name = "programmes"

[[opening]]
kind = "baseline"
touches = [{{ place = "smooth", voltage_v = 0 }}]

[[condition]]
name = "programme"
question = "strength"
expected = "stronger"
touches = [{{ place = "smooth", {touch} }}]
"""


def driven(touch: str) -> tuple[list[dict[str, Any]], float]:
    """Return the read-backs during `touch`, in order, and the beam's resonance, Hz."""
    text = STUDY.format(touch=touch)
    study = parsed_study(text)
    events = rehearse(text, plan(study, 0), study.study.seed).events
    found = [event.payload for event in events if event.tag == "resonance-measured"]
    ended = [event.payload for event in events if event.tag == "touch-ended"]
    return ended[-1]["read_back"], found[-1]["frequency_hz"]


Ends = tuple[float, float]


def programme(volts: Ends, frequency: Ends, duration_s: float) -> str:
    """Return a touch with a ramp if the amplitude changes, and a sweep if the frequency does."""
    touch = f"voltage_v = {volts[0]}, frequency = {frequency[0]}, duration_s = {duration_s}"
    touch += f", ramp_to_v = {volts[1]}" * (volts[0] != volts[1])
    return touch + f", sweep_to = {frequency[1]}" * (frequency[0] != frequency[1])


@pytest.mark.parametrize(
    ("volts", "frequency", "duration_s"),
    [
        ((150, 150), (1, 1), 2),
        ((0, 200), (1, 1), 6),
        ((100, 100), (0.98, 1.02), 4),
        ((0, 200), (0.98, 1), 6),
        ((200, 20), (1, 0.98), 6),
        ((100, 100), (0.95, 1.05), 0.5),
        ((50, 50.001), (1, 1), 4),
    ],
)
def test_amplitude_and_frequency_change_linearly(
    volts: Ends, frequency: Ends, duration_s: float
) -> None:
    read_back, resonance_hz = driven(programme(volts, frequency, duration_s))
    began_s = read_back[0]["device_time_s"]
    lasted_s = read_back[-1]["device_time_s"] - began_s
    assert (len(read_back) > 2) == (volts[0] != volts[1] or frequency[0] != frequency[1])
    for entry in read_back:
        share = (entry["device_time_s"] - began_s) / lasted_s
        expected_v = volts[0] + share * (volts[1] - volts[0])
        assert entry["monitor_v"] == pytest.approx(expected_v, abs=4)
        expected_hz = frequency[0] + share * (frequency[1] - frequency[0])
        step = abs(frequency[1] - frequency[0]) / 10
        assert entry["frequency_hz"] / resonance_hz == pytest.approx(expected_hz, abs=step + 1e-6)
    assert read_back[0]["frequency_hz"] / resonance_hz == pytest.approx(frequency[0], abs=1e-6)
    assert read_back[-1]["frequency_hz"] / resonance_hz == pytest.approx(frequency[1], abs=1e-6)
