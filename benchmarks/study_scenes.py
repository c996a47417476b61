"""Six thousand scenes as an experimenter's study has them, as a CSV text for `predict`.

A hundred rigs, each with its own damping: touches at the smooth place and along the path at
resonance, at every amplitude, finger load and direction; and the paper's frequency condition at
100 V, the drive rising towards resonance, its frequencies as numbers.
"""

import random

from device.friction.scenes import FingerContact
from protocol.study.touch import TouchDefaults

RIGS = 100
SCENES_PER_RIG = 60
RESONANT_PER_RIG = 40
TOP_RESONANCE_HZ = 21624.85
_APPROACH = (0.70, 0.80, 0.88, 0.94, 0.98)


def study_scenes(seed: int = 1) -> str:
    """The scenes, rig by rig."""
    draw = random.Random(seed)
    header = "voltage_v,frequency_hz,x_m,contact_m,finger_load_n,direction,damping_ratio"
    rows = [row for _ in range(RIGS) for row in _rig_rows(draw)]
    return "\n".join([header, *rows]) + "\n"


def _rig_rows(draw: random.Random) -> list[str]:
    """One rig's scenes: forty at resonance, twenty on the way to it."""
    resonance_hz = TOP_RESONANCE_HZ * (1 + draw.gauss(0, 1e-4))
    damping = draw.uniform(0.003, 0.012)
    rows = []
    for index in range(SCENES_PER_RIG):
        resonant = index < RESONANT_PER_RIG
        cells = (
            draw.choice((0.0, 25.0, 50.0, 100.0, 150.0, 200.0)) if resonant else 100.0,
            "resonance" if resonant else resonance_hz * _APPROACH[index % len(_APPROACH)],
            FingerContact().x_m if draw.random() < 0.5 else draw.uniform(*TouchDefaults().path_m),
            draw.uniform(0.008, 0.014),
            draw.uniform(0.3, 0.9),
            "left" if draw.random() < 0.25 else "right",
            damping,
        )
        rows.append(",".join(str(cell) for cell in cells))
    return rows
