"""The result of a sliding experiment: the JSON that others rely on, the lines, and the page."""

import json
from html.parser import HTMLParser

import pytest

from analysis.sliding.experiment import Cell, DrawnSession, PlannedPass
from analysis.sliding.result import SlidingResult, sliding_result
from protocol.errors import BadInput
from protocol.journal.events import ResonanceMeasured
from tests.analysis.sliding.rigs import Setting, default_plan, passes, rig

OWN = rig(1)
PLAN = default_plan(OWN.measured_hz)
FEW = [*PLAN[1:6:2], PLAN[-1]]
"""Three drives around the resonance and a reference, for speed."""


def cell(setting: Setting) -> Cell:
    frequency = round(setting.frequency_hz / OWN.measured_hz, 6) if setting.voltage_v else 0.0
    return Cell(setting.voltage_v, frequency, setting.direction, setting.speed_m_s)


def drawn() -> DrawnSession:
    made = passes(OWN, FEW, seed=1)
    return DrawnSession(
        session="slide/1",
        rehearsal=True,
        planned=tuple(map(cell, PLAN)),
        passes=tuple(
            PlannedPass(
                index=index, drive=f"{one.frequency_hz:.0f} Hz", cell=cell(setting), made=one
            )
            for index, (setting, one) in enumerate(zip(FEW, made, strict=True))
        ),
        left_out=((4, "the block <tilted>"),),
        resonance=ResonanceMeasured(frequency_hz=OWN.measured_hz, tip_m_per_v=1e-8),
        idn="a board",
    )


@pytest.fixture(scope="module")
def result() -> SlidingResult:
    return sliding_result(drawn())


def test_the_json_has_what_others_rely_on(result: SlidingResult) -> None:
    found = json.loads(json.dumps(result.record(), allow_nan=False))
    assert len(found["passes"]) == 4
    mu = found["mu"]
    assert len(mu["x_m"]) == len(mu["mu"]) == len(mu["error"]) > 100
    assert abs(found["setting"]["frequency_hz"] - OWN.measured_hz) < 1
    for place in (*found["troughs"], *found["peaks"]):
        low, high = place["ci"]
        assert low <= place["x_m"] <= high
    assert len(found["troughs"]) >= 3
    for name in ("damping_ratio", "resonance_hz"):
        low, high = found["fit"][name]["ci"]
        assert low <= found["fit"][name]["value"] <= high
    assert all(each.keys() in ({"value", "ci"}, {"reason"}) for each in found["fit"].values())
    assert {"law", "rung", "rmse"} <= found["models"][0].keys()
    laws = {one["law"] for one in found["models"]}
    assert laws == {"printed", "consistent", "coulomb"}


def test_the_result_is_told_in_a_few_lines(result: SlidingResult) -> None:
    lines = list(result.lines())
    assert lines[0].split() == ["property", "value", "95%", "interval"]
    assert any(line.startswith("damping ratio ") for line in lines)
    (unknown,) = (line for line in lines if line.startswith("Not told by these passes: "))
    assert "sliding speed, mass of the bodies, gain of the force sensor (the page" in unknown
    assert "Left out: pass 5, the block <tilted>." in lines
    assert lines[-1].startswith("Closest: law consistent on rung ")
    assert len(lines) < 15


def test_the_page_and_its_figure_need_no_network(result: SlidingResult) -> None:
    files = result.files()
    assert set(files) == {f"slide.{end}" for end in ("html", "json", "svg", "pdf", "png")}
    page = files["slide.html"].decode()
    HTMLParser().feed(page)
    assert "http-equiv" in page
    assert "src=" not in page
    assert "This is no evidence about a rig." in page
    assert "the block &lt;tilted&gt;" in page
    assert page.count("<svg") == 1
    assert files["slide.png"].startswith(b"\x89PNG")
    assert json.loads(files["slide.json"]) == json.loads(json.dumps(result.record()))


def test_the_same_passes_give_the_same_bytes(result: SlidingResult) -> None:
    assert sliding_result(drawn()).files() == result.files()


def test_passes_without_a_drive_tell_nothing() -> None:
    made = drawn()
    rest = tuple(each for each in made.passes if each.made.voltage_v == 0)
    only = DrawnSession(**{**vars(made), "passes": rest})
    with pytest.raises(BadInput, match="slide/1: no pass was driven"):
        sliding_result(only)
