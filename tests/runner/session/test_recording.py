"""Recorded touches: their zero, their samples in the journal, and what the operator hears."""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from device.errors import DeviceError
from device.force_channel.recording import Samples
from protocol.errors import WorkFailed
from protocol.journal.events import Event, TouchRecorded
from protocol.study_file.loading import template
from runner.clock import Clock
from runner.journal.opening import open_journal
from runner.journal.store import Journal
from runner.screens import Note, Notice, Order
from runner.session.loop import run
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant, context

RATE_HZ = 200
PLAIN = template("paper")
TEXT = PLAIN.replace("[touch]", f"[force_channel]\nrate_hz = {RATE_HZ}\n[touch]")
SCALE = (1e-3, 1e-3, 1e-5)
TOUCHES = 12
TAKES_S = 1 / RATE_HZ


@dataclass
class Recording(FakeDevice):
    """Records as long as it is asked to, by the session's clock, from which its own is 100 s off.

    `zeros` are the normal forces of its tares in turn, mN; the last one stays.
    """

    clock: Clock = field(default_factory=FakeClock)
    zeros: Sequence[int] = (5,)
    touches_n: float = 0.5
    saturated: int = 0
    records: int = 0
    """How many recordings were finished."""
    mounted: list[str] = field(default_factory=list)
    weighs: int = 0
    """What each beam that is mounted adds to the zero, mN."""
    _began_s: float = 0.0

    def record(self, rate_hz: int, clock_s: Callable[[], float] | None = None) -> None:
        super().record(rate_hz)
        assert clock_s == self.clock.monotonic_s
        self._began_s = self.clock.monotonic_s()

    def recorded(self) -> Samples:
        told = super().recorded()
        self.records += 1
        count = round((self.clock.monotonic_s() - self._began_s) * told.rate_hz)
        # The first of all is the session's tare, then come pairs of tare and touch.
        zero = self.zeros[min(self.records // 2, len(self.zeros) - 1)]
        zero += self.weighs * len(self.mounted)
        touching = self.records > 1 and self.records % 2 == 1
        normal = zero + round(1e3 * self.touches_n) if touching else zero
        return Samples(
            **{
                **vars(told),
                "first_s": self._began_s + 100,
                "clock_offset_s": -100.0,
                "scale": SCALE,
                "counts": array("h", [300] * count + [normal] * count + [4000] * count).tobytes(),
                "saturated": self.saturated,
            }
        )


def carried_out(
    journal: Journal,
    device: FakeDevice,
    text: str = TEXT,
    orders: list[tuple[str, Order | Note]] | None = None,
) -> FakeOperator:
    operator = FakeOperator(device, orders or [])
    made = context(journal, device, FakeParticipant(), text, operator)
    if isinstance(device, Recording):
        device.clock, device.mounted = made.clock, operator.mounts
    run(made)
    return operator


def recorded_by(folder: Path, device: FakeDevice, text: str = TEXT) -> tuple[list[Event], str]:
    """Return the events of a session, and all warnings."""
    with open_journal(folder / "study.db") as journal:
        operator = carried_out(journal, device, text)
        events = [event.record for event in journal.events("P01/1")]
    return events, "\n".join(view.warning for view in operator.seen)


def recordings(events: list[Event]) -> list[TouchRecorded]:
    return [event for event in events if isinstance(event, TouchRecorded)]


def test_each_touch_is_recorded_before_it_ends(tmp_path: Path) -> None:
    device = Recording()
    events, warnings = recorded_by(tmp_path, device)
    tags = [event.TAG for event in events]
    assert tags.count("touch-recorded") == tags.count("touch-ended") == TOUCHES
    for place in (place for place, tag in enumerate(tags) if tag == "touch-ended"):
        assert tags[place - 2 : place] == ["touch-started", "touch-recorded"]
    assert "force channel" not in warnings
    assert device.calls[device.calls.index("drive") :][:2] != ["record"], "before it is driven"


def test_a_recording_holds_lead_in_and_touch_on_the_sessions_clock(tmp_path: Path) -> None:
    events, _ = recorded_by(tmp_path, Recording())
    for touch in recordings(events):
        begin_s, end_s = touch.moved_s
        first_s = touch.first_s + touch.clock_offset_s
        assert begin_s - first_s == pytest.approx(3.0, abs=TAKES_S), "the lead-in"
        assert touch.count / touch.rate_hz >= end_s - first_s - TAKES_S
        assert touch.tare_n == pytest.approx((0.3, 0.005))
        counts = array("h", touch.counts())
        assert set(counts[touch.count : 2 * touch.count]) == {505}


def test_the_output_is_off_before_a_recording_is_kept(tmp_path: Path) -> None:
    device = Recording()
    recorded_by(tmp_path, device)
    calls = [call for call in device.calls if call not in {"beat", "arm", "resonance"}]
    assert calls[:2] == ["record", "recorded"], "the zero, before anybody touches the beam"
    touch = ["record", "recorded", "record", "drive", "off", "recorded"]
    assert calls[2:8] == touch


def test_a_study_that_records_nothing_asks_for_nothing(tmp_path: Path) -> None:
    device = FakeDevice()
    events, _ = recorded_by(tmp_path, device, PLAIN)
    assert recordings(events) == []
    assert not {"record", "recorded"} & set(device.calls)


@pytest.mark.parametrize(
    ("zeros", "said", "tares"),
    [
        ((5, 12, 20), "", [(0.3, 0.012), (0.3, 0.02)]),
        ((5, 5, 35, 35), "the zero of the force channel moved by +30 mN", [(0.3, 0.005)]),
        ((5, 5, -25), "the zero of the force channel moved by -30 mN", [(0.3, 0.005)]),
        ((5, 505, 5), "moved by +500 mN: something touches the surface, or the s", [None]),
    ],
)
def test_a_zero_that_moves_is_told(
    tmp_path: Path, zeros: tuple[int, ...], said: str, tares: list[tuple[float, float] | None]
) -> None:
    events, warnings = recorded_by(tmp_path, Recording(zeros=zeros))
    assert said in warnings
    assert ("zero of the force" in warnings) == bool(said)
    assert warnings.count("zero of the force") <= 1, "said once, then it is the zero"
    found = [touch.tare_n for touch in recordings(events)]
    assert found[: len(tares)] == [tare and pytest.approx(tare) for tare in tares]
    assert found[-1] == pytest.approx((0.3, zeros[-1] / 1e3)), "the next one counts again"


@pytest.mark.parametrize(
    ("device", "said"),
    [
        (Recording(touches_n=0.01), "the force channel felt no finger"),
        (Recording(saturated=3), "the force channel was at its limit in 3 samples"),
    ],
)
def test_what_is_wrong_with_a_recording_is_told(
    tmp_path: Path, device: Recording, said: str
) -> None:
    events, warnings = recorded_by(tmp_path, device)
    assert warnings.count(said) == len(recordings(events)) == TOUCHES
    assert {touch.saturated for touch in recordings(events)} == {device.saturated}


@pytest.mark.parametrize("call", ["record", "recorded"])
def test_a_channel_that_fails_ends_the_session_which_can_be_resumed(
    tmp_path: Path, call: str
) -> None:
    device = Recording(fails=call)
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(DeviceError, match=f"{call} failed") as caught:
            carried_out(journal, device)
        assert "run the same command again to resume" in caught.value.__notes__
        assert not device.on
        carried_out(journal, Recording())
        tags = [event.tag for event in journal.events("P01/1")]
    assert tags.count("touch-recorded") == TOUCHES


@pytest.mark.parametrize("order", ["stop", "repeat", "emergency stop"])
def test_a_touch_that_is_broken_off_leaves_no_recording(tmp_path: Path, order: Order) -> None:
    device = Recording()
    with open_journal(tmp_path / "study.db") as journal:
        if order == "repeat":
            carried_out(journal, device, orders=[("touching", order)])
        else:
            with pytest.raises(WorkFailed, match="stop"):
                carried_out(journal, device, orders=[("touching", order)])
            carried_out(journal, Recording())
        tags = [event.tag for event in journal.events("P01/1")]
    assert "trial-aborted" in tags
    assert tags.count("touch-recorded") == tags.count("touch-ended")
    assert tags.count("touch-started") == tags.count("touch-ended") + 1


def test_a_zero_that_is_found_twice_is_believed(tmp_path: Path) -> None:
    events, warnings = recorded_by(tmp_path, Recording(zeros=(5, 505, 510)))
    assert warnings.count("something touches the surface") == 1
    assert warnings.count("the zero of the force channel moved by +505 mN") == 1
    assert [touch.tare_n for touch in recordings(events)][:2] == [
        None,
        pytest.approx((0.3, 0.51)),
    ]


def test_a_beam_that_is_mounted_has_a_zero_of_its_own(tmp_path: Path) -> None:
    """Beams differ in weight: the first zero on a new one is believed."""
    device = Recording(weighs=300)
    events, warnings = recorded_by(tmp_path, device)
    assert len(device.mounted) > 2
    assert "zero of the force channel" not in warnings
    found = sorted({round(touch.tare_n[1], 3) for touch in recordings(events) if touch.tare_n})
    assert found == [round(0.305 + 0.3 * beam, 3) for beam in range(len(device.mounted))]


def test_the_operator_sees_the_zero_and_that_touches_are_recorded(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        seen = carried_out(journal, Recording()).seen
    assert all(view.records for view in seen)
    assert seen[-1].zero_n == pytest.approx((0.3, 0.005))


def test_the_tare_is_measured_before_the_participant_is_instructed(tmp_path: Path) -> None:
    """Nobody rests a finger on the beam before the instruction to do so."""

    class Watching(FakeParticipant):
        at: list[tuple[str, int]]

        def show(self, screen: object) -> None:
            super().show(screen)  # type: ignore[arg-type]
            if not isinstance(screen, Notice):
                self.at.append((type(screen).__name__, device.records))

    device, participant = Recording(), Watching()
    participant.at = []
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, participant, TEXT)
        device.clock = made.clock
        run(made)
    shown = [entry for entry in participant.at if entry[0] in {"Instruction", "LeadIn"}]
    assert shown[0] == ("Instruction", 2)
    assert shown[1] == ("LeadIn", 2)
