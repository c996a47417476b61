"""A virtual participant's hand, which is wrong in known ways, and its finger's skin."""

import random
from dataclasses import dataclass

from runner.screens import Pacing


@dataclass(frozen=True, kw_only=True)
class Hand:
    """How a hand follows the instructions, and how its skin differs; the defaults do not.

    Attributes:
        force_factor: mean force, relative to the instructed one.
        speed_factor: speed, relative to the mark's.
        place_offset_m: how far right of the mark the finger begins.
        tremor: SD of the force, relative to its mean.
        skin: what multiplies the change of log friction that the model predicts.
        mu0: what multiplies the friction at rest.
    """

    force_factor: float = 1.0
    speed_factor: float = 1.0
    place_offset_m: float = 0.0
    tremor: float = 0.0
    skin: float = 1.0
    mu0: float = 1.0

    def place_m(self, pacing: Pacing, passed_s: float) -> tuple[float, float]:
        """Return place and speed (m/s) of the finger `passed_s` after the mark began to move.

        It stops where the mark does.
        """
        way_m = pacing.end_m - pacing.start_m
        speed_m_s = self.speed_factor * abs(way_m) / pacing.duration_s
        gone_m = speed_m_s * passed_s
        if gone_m >= abs(way_m):
            return pacing.end_m + self.place_offset_m, 0.0
        sign = 1 if way_m > 0 else -1
        return pacing.start_m + self.place_offset_m + sign * gone_m, speed_m_s


def drawn_hand(seed: int, participant: str, session: int) -> tuple[Hand, random.Random]:
    """Return the hand of a session's virtual participant, and the stream of its tremor.

    A stream of its own leaves answers and scores alone. The finger remains on the beam, and most
    touches as instructed.
    """
    stream = random.Random(f"hand/{seed}/{participant}/{session}")
    hand = Hand(
        force_factor=stream.uniform(0.85, 1.15),
        speed_factor=stream.uniform(0.9, 1.1),
        place_offset_m=stream.uniform(-1e-3, 1e-3),
        tremor=0.03,
        skin=stream.lognormvariate(0.0, 0.2),
        mu0=stream.lognormvariate(0.0, 0.15),
    )
    return hand, stream
