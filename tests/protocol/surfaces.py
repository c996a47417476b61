"""Studies of surfaces that are not the paper's beam: their files, by name."""

import re
from collections.abc import Mapping
from math import cos, exp, pi

from protocol.study_file.loading import template, template_pictures

ALUMINIUM = """
[surface]
length_m = 0.12
thickness_m = 0.003
width_m = 0.01
youngs_modulus_pa = 70e9
density_kg_m3 = 2700
poisson_ratio = 0.33
damping_ratio = 0.005
supports = ["clamped", "clamped"]
mode = 6

[[surface.patch]]
centre_m = 0.072
length_m = 0.010
width_m = 0.005
thickness_m = 0.0003
youngs_modulus_pa = 76.5e9
density_kg_m3 = 7500
poisson_ratio = 0.31
stress_constant_c_m2 = 2.0
"""
ALUMINIUM_HZ = 19_394.0
MEASURED = """
[surface]
kind = "measured"
length_m = 0.12
table = "friction.csv"
"""


def paper_on(surface: str, *changes: tuple[str, str]) -> str:
    """Return the paper's study on another surface."""
    text = template("paper")
    for old, new in (("participants = 9", "participants = 2"), *changes):
        assert old in text
        text = text.replace(old, new, 1)
    return text + surface


def friction_csv(volts: tuple[int, ...] = (0, 50, 100, 150, 200), places: int = 121) -> str:
    """Return a table of friction that falls with the voltage, more at some places."""
    rows = ["voltage_v,place_m,direction,friction"]
    for volt in volts:
        for place in range(places):
            x_m = 0.12 * place / (places - 1)
            for direction, sign in (("right", 1), ("left", -1)):
                drop = 0.002 * volt * (1 + sign * 0.8 * cos(2 * pi * x_m / 0.02))
                rows.append(f"{volt},{x_m:.4f},{direction},{0.5 * exp(-drop):.6f}")
    return "\n".join(rows) + "\n"


def study_files(name: str) -> Mapping[str, str | bytes]:
    """Return the files of a study on an aluminium `beam`, a table or something without a model."""
    if name == "beam":
        hz = ("nominal_resonance_hz = 24221", f"nominal_resonance_hz = {ALUMINIUM_HZ:.0f}")
        return {"study.toml": paper_on(ALUMINIUM, hz, ("0.0414", "0.042"))}
    if name == "measured":
        return {"study.toml": paper_on(MEASURED), "friction.csv": friction_csv()}
    assert name in {"stated", "given"}
    text = asked_plate()
    if name == "given":
        text = re.sub(r", friction = [\d.]+", "", text)
    return {"study.toml": text, **template_pictures("plate")}


def asked_plate() -> str:
    """Return the study of a plate with conditions that ask what changed, for two participants."""
    head, *rest = template("plate").split("\n[[")
    conditions = "".join(
        f'\n[[condition]]\nname = "{name}"\nquestion = "roughness"\nexpected = "smoother"\n'
        'touches = [\n  { place = "path", voltage_v = 0, friction = 0.60 },\n'
        f'  {{ place = "path", voltage_v = {volts}, friction = {friction} }},\n]\n'
        for name, volts, friction in (("weak", 50, 0.45), ("strong", 100, 0.3))
    )
    head = head.replace("[design]\n", "[design]\nparticipants = 2\n", 1)
    texts = "[texts.en]" + rest[-1].split("[texts.en]")[1]
    return f"{head}\n{conditions}\n{texts}"


SURFACES = ("beam", "measured", "stated", "given")
