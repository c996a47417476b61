"""Claims about the paper's sliding-friction experiment (Section 5.1, Fig 16)."""

import numpy as np

from analysis.claims.claim import Claim, Finding, without_law
from device.beam import Beam
from device.conditions import PATH_M, SMOOTH_PLACE_M
from device.friction import friction_coefficient
from device.rungs import RUNG_NAMES, rung_field, rung_resonance_hz
from device.scenes import Drive, Scene, Touch


def _sliding_frequency() -> Finding:
    resonances = {
        name: rung_resonance_hz(name, Beam(), 6) for name in RUNG_NAMES if name != "modes:N"
    }
    near = [abs(23200.0 / value - 1) <= Beam().damping_ratio for value in resonances.values()]
    return Finding(parts=tuple(near), computed=resonances)


def _sliding_same_frequency() -> Finding:
    apart = abs(23200.0 / 24221.0 - 1)
    bandwidth = 2 * Beam().damping_ratio
    return Finding(
        parts=(apart < bandwidth,), computed={"apart": apart, "half_power_bandwidth": bandwidth}
    )


def _sliding_variation(law: str) -> Finding:
    """Whether theory at the experiment's own drive and load still varies as at 24,221 Hz.

    If it does not, nothing that varies can match it; if it does, the measured curve must decide.
    """
    path = np.linspace(*PATH_M, 711)
    touch = Touch(finger_load_n=0.56, x_m=SMOOTH_PLACE_M)
    drive = Drive(frequency_hz=23200.0)
    own = friction_coefficient(Scene(drive=drive, touch=touch), law=law, x_m=path)
    paper = friction_coefficient(Scene(), law=law, x_m=path)
    swings = float(np.ptp(own)) / 2, float(np.ptp(paper)) / 2
    varies = swings[0] > 0.5 * swings[1]
    return Finding(
        parts=(None,) if varies else (False,),
        computed={"swing_at_23200_hz_0.56_n": swings[0], "swing_in_fig12": swings[1]},
    )


def _sliding_load() -> Finding:
    return Finding(
        parts=(abs(0.56 / 400.0 - 1) < 0.5,),
        computed={"block_n": 0.56, "load_in_theory_n": 400.0},
    )


def _speed_below_tip_speed() -> Finding:
    field = rung_field("mode", Beam(), Drive())
    tip = float(field.tip_speed_m_s(3.5e-3))
    return Finding(
        parts=(tip > Touch().sliding_speed_m_s,),
        computed={"tip_speed_m_s": tip, "finger_m_s": Touch().sliding_speed_m_s},
    )


CLAIMS = (
    Claim(
        id="sliding-drive-near-resonance",
        place="Section 5.1",
        claim="the sliding experiment's 23,200 Hz drives the operating mode",
        check="within the half-power bandwidth of mode 6 on every rung",
        expected="near resonance",
        find=without_law(_sliding_frequency),
        lawless=True,
    ),
    Claim(
        id="sliding-same-drive",
        place="Section 5.1, Fig 16",
        claim="experiment (23,200 Hz) and theory (24,221 Hz) are at the same operating point",
        check="their distance against the half-power bandwidth 2ζ",
        expected="closer than the bandwidth",
        find=without_law(_sliding_same_frequency),
        remark="damping ratio 0.005 is assumed",
        lawless=True,
    ),
    Claim(
        id="sliding-same-load",
        place="Section 5.1, Table 3",
        claim="the 0.56 N block is the load of the theory",
        check="0.56 N against 20 bodies of 20 N, within a factor of two",
        expected="comparable",
        find=without_law(_sliding_load),
        lawless=True,
    ),
    Claim(
        id="sliding-matches-theory",
        place="Section 5.1, Fig 16",
        claim="the friction measured varies as the theory says",
        check="swing of μ' along the path at 23,200 Hz and 0.56 N: under half of Fig 12's it fails",
        expected="very close",
        find=_sliding_variation,
        remark="the measured curve is not printed as numbers: only whether theory leaves anything "
        "to match can be checked",
    ),
    Claim(
        id="bodies-outrun-the-finger",
        place="Section 2",
        claim="bodies push a slowly moving finger along",
        check="the bodies' tip speed against the finger's",
        expected="bodies faster",
        find=without_law(_speed_below_tip_speed),
        remark="the finger's speed is assumed, as the paper gives none",
        lawless=True,
    ),
)
