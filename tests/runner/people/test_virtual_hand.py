"""A virtual hand: smooth along its path, wrong as it says, and the same for the same seed."""

import random
from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from protocol.study.rules import TouchRules
from runner.people.virtual_hand import Hand, drawn_hand
from runner.people.virtual_participant import Character, VirtualParticipant
from runner.screens import Notice, Pacing
from tests.runner.fakes import FakeClock

RIGHT = Pacing(start_m=0.01, end_m=0.08, duration_s=2.0, force_n=0.5, direction="right")
LEFT = Pacing(start_m=0.08, end_m=0.01, duration_s=2.0, force_n=0.5, direction="left")
HELD = Pacing(start_m=0.04, end_m=0.04, duration_s=2.0, force_n=0.5, direction="right")
WRONG = Hand(force_factor=1.2, speed_factor=0.8, place_offset_m=1e-3, tremor=0.05)
TICK_S = 0.05


@dataclass
class Beam:
    """A beam that feels every touch: force, place, direction and speed."""

    felt: list[tuple[float, float, str, float]] = field(default_factory=list)

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = -1.0
    ) -> float:
        self.felt.append((force_n, position_m, direction, speed_m_s))
        return 0.4

    def lift(self) -> None: ...


def touched(pacing: Pacing, hand: Hand | None) -> list[tuple[float, float, str, float]]:
    beam, clock = Beam(), FakeClock()
    virtual = VirtualParticipant(
        control=beam,
        clock=clock,
        character=Character(bias=2.0, gain=5.0),
        random_stream=random.Random(1),
        hand=hand,
        tremor_stream=random.Random(2),
    )
    virtual.show(pacing)
    for _ in range(round(pacing.duration_s / TICK_S)):
        clock.sleep(TICK_S)
        virtual.poll()
    virtual.show(Notice(text="touch.end"))
    return beam.felt


@pytest.mark.parametrize("pacing", [RIGHT, LEFT, HELD])
def test_each_place_is_where_the_speed_has_brought_the_finger(pacing: Pacing) -> None:
    felt = touched(pacing, WRONG)
    sign = 1 if pacing.direction == "right" else -1
    for (_, before_m, _, speed_m_s), (_, after_m, _, _) in pairwise(felt):
        assert after_m == pytest.approx(before_m + sign * speed_m_s * TICK_S, abs=1e-9)


def test_the_hand_is_wrong_as_it_says() -> None:
    felt = touched(RIGHT, WRONG)
    assert felt[0][1] == pytest.approx(RIGHT.start_m + 1e-3)
    assert {round(speed, 6) for *_, speed in felt} == {0.028}
    forces = [force for force, *_ in felt]
    mean = sum(forces) / len(forces)
    assert mean == pytest.approx(1.2 * 0.5, rel=0.03)
    assert max(forces) > 1.03 * mean > 0.97 * mean > min(forces)


def test_a_fast_finger_stops_where_the_mark_will() -> None:
    felt = touched(RIGHT, Hand(speed_factor=1.5))
    assert felt[-1][1] == RIGHT.end_m
    assert felt[-1][3] == 0


def test_without_a_hand_of_its_own_it_does_as_instructed() -> None:
    felt = touched(RIGHT, None)
    assert {force for force, *_ in felt} == {0.5}
    assert {speed for *_, speed in felt} == {-1.0}, "no speed is given"
    assert (felt[0][1], felt[-1][1]) == (0.01, 0.08)


def test_hands_follow_from_the_seed_and_mostly_comply() -> None:
    assert drawn_hand(1, "P01", 1)[0] == drawn_hand(1, "P01", 1)[0]
    hands = [drawn_hand(seed, "P01", 1)[0] for seed in range(500)]
    assert len(set(hands)) == len(hands)
    rules = TouchRules()
    for hand in hands:
        assert abs(hand.force_factor - 1) < rules.force_within / 2
        assert abs(hand.place_offset_m) < rules.place_within_m
        assert abs(hand.speed_factor - 1) < rules.path_within
        assert hand.skin > 0
        assert hand.mu0 > 0
    skins = sorted(hand.skin for hand in hands)
    assert skins[250] == pytest.approx(1, abs=0.05)
