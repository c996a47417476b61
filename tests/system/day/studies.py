"""The studies of the days: small, so that a session takes milliseconds, and not alike."""

import random
import re

from device.simulator.models.generator_model import AMPLIFIER_GAIN, MOST_EMF_VPP
from tests.protocol.surfaces import ALUMINIUM, MEASURED

_STUDY = """
[study]
name = "day"
seed = {seed}
[rig]
device = "COM1"
dialect = "{dialect}"
{amplifier}
max_voltage_v = {max_v}
max_frequency_hz = {max_hz}
ramp_v_per_s = {ramp}
max_slew_v_per_us = {slew}
{cool}
watchdog_s = {watchdog_s}
{channel}
[touch]
beam = "a"
path_m = [0.010, 0.081]
smooth_place_m = 0.0414
hold_s = {hold_s}
lead_in_s = {lead_in_s}
sliding_speed_m_s = 0.2
[beams]
a = 0.001
b = 0.0
[design]
order = "{order}"
sessions = 2
{between}
{assigned}
practice_trials = {practice}
catch_trials = {catch}
repeats = {repeats}
break_every_blocks = {breaks}
break_s = 0.2
[as_instructed]
retries = {retries}
[timing]
between_touches_s = 0.1
inter_trial_s = 0.2
[rating]
score_when = "{score_when}"
[session]
operator_asks = {asks}
practise_again = "{again}"
{questions}
{factor}
{groups}
{track}
[[opening]]
kind = "baseline"
touches = [{{place = "smooth", voltage_v = 0}}]
[[condition]]
name = "ramp"
question = "roughness"
expected = "smoother"
touches = [{{place = "smooth", voltage_v = 20, ramp_to_v = {ramp_to_v}}}]
[[condition]]
name = "slide"
question = "strength"
expected = "stronger"
touches = [
    {{place = "path", voltage_v = {low_v}, sweep_to = 1.02}},
    {{place = "path", direction = "left", voltage_v = {high_v}, {drive}{beam}}},
]
{surface}
"""
PAPERS = "the paper's beam"
SURFACES = {
    PAPERS: "",
    "beam": ALUMINIUM,
    "measured": MEASURED,
    "given": '[surface]\nkind = "given"\nlength_m = 0.12\npicture = "none"\n',
}
_QUESTION = """
[[question]]
name = "own_{when}"
kind = "choice"
when = "{when}"
text = {{ en = "What was it like {when}?", zh = "怎么样？" }}
labels = [
    {{ value = "good", en = "good", zh = "好" }}, {{ value = "bad", en = "bad", zh = "不好" }},
]
{asked_if}
"""
AFTER_HIGH = '{ question = "score", at_least = 1 }'
_ASKED_IF = {
    "before": "",
    "trial": 'asked_if = { question = "noticed", is = ["yes"] }',
    "block": "",
    "after": 'asked_if = { question = "own_before", is = ["good"] }',
}
_GROUPS = """
[[group]]
name = "young"
size = 4
[[group]]
name = "old"
size = 2
"""
_FACTOR = """
[[factor]]
name = "press"
varies = "press"
values = [1, 1.5]
touches = "all"
"""
_TRACK = """
[[track]]
name = "felt"
task = "two intervals"
method = "staircase"
axis = "voltage"
levels = { from = 10, to = 100, count = 11 }
standard = { place = "smooth", voltage_v = 0 }
comparison = { place = "smooth" }
rule = "2 down 1 up"
step_levels = [2, 1]
trials = 4
stop = { reversals = 2 }
catch = 1
"""
_AMPLIFIER = f"amplifier_gain = {AMPLIFIER_GAIN}\ngenerator_max_vpp = {MOST_EMF_VPP}"


def drawn_study(
    stream: random.Random, dialect: str, surface: str = PAPERS, *, rated: bool = False
) -> str:
    """Return the text of a study; there are few, so that each has to be checked only once.

    `surface` is one of `SURFACES`; of a `rated` study conditions have no question.
    """
    max_v = stream.choice((120, 150))
    kind = stream.randrange(4)
    asked = _STUDY.format(
        seed=kind,
        dialect=dialect,
        amplifier="" if dialect == "board" else _AMPLIFIER,
        max_v=max_v,
        max_hz=(30_000, 25_500)[kind % 2],
        slew=(26, 24)[kind % 2],
        cool=("max_temperature_c = 60", "")[kind % 2],
        ramp=(400, 1000)[kind // 2],
        watchdog_s=((1.0, 0.6) if dialect == "board" else (1.5, 1.0))[kind % 2],
        channel="[force_channel]\nrate_hz = 200" if kind == 3 and dialect == "board" else "",
        hold_s=(0.4, 0.6)[kind % 2],
        lead_in_s=(0.0, 0.3, 0.0, 0.2)[kind],
        order=("williams", "blocks")[kind % 2],
        practice=(1, 0, 1, 0)[kind],
        catch=(0, 1, 0, 0)[kind],
        repeats=(1, 1, 1, 2)[kind],
        breaks=(0, 0, 1, 1)[kind],
        retries=(0, 1, 2, 1)[kind],
        score_when=("agrees", "always", "noticed", "always")[kind],
        between=("", "hours_between = [0, 48]")[kind // 2],
        factor=("", "", _FACTOR, "")[kind],
        track=("", _TRACK)[kind % 2],
        groups=("", _GROUPS)[kind // 2],
        assigned=("", 'assign_groups = "at random"')[kind // 2],
        drive=("frequency = 0.99", "frequency_hz = 24000")[kind % 2],
        asks=('["skin state"]', "[]")[kind // 2],
        again=("on resume", "never")[kind // 2],
        ramp_to_v=max_v,
        low_v=(40, 60)[kind // 2],
        high_v=max_v - 10 * kind,
        questions="".join(
            _QUESTION.format(when=when, asked_if=rule) for when, rule in _ASKED_IF.items()
        )
        if kind % 2
        else "",
        beam=(', beam = "b"', "")[kind % 2],
        surface=SURFACES[surface],
    )
    return as_rated(asked) if rated else asked


def as_rated(text: str) -> str:
    """Return a study without the questions of its conditions, on a scale with negative scores."""
    scale = "[rating]\nminimum = -3\nmaximum = 3"
    scored = text.replace('{ question = "noticed", is = ["yes"] }', AFTER_HIGH)
    return re.sub(r"(?m)^(question|expected|score_when) = .*\n", "", scored).replace(
        "[rating]", scale, 1
    )
