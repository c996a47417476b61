"""Sessions that record their touches: killed, stopped, withdrawn; over pseudo-terminal and TCP."""

import re
import signal
import sqlite3
import subprocess
import threading
import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import pytest

from device.simulator.client import ControlClient, Endpoints, simulator_process
from protocol.journal.events import Event, StoredEvent, TouchEnded, TouchRecorded, TouchStarted
from runner.journal.opening import open_journal
from tests.device.rigs import until
from tests.runner.command_line import TOUCHBEAM, typed
from tests.runner.window.person import Person
from tests.runner.window.sessions import Seat, short_study, tiny_study
from tests.system.test_sigkill import killed_and_resumed

pytestmark = pytest.mark.waits

CHANNEL = "\n[force_channel]\nrate_hz = 1000\n"
RECORDED = short_study() + CHANNEL
OFF_WITHIN_S = 0.25
"""From a signal, or from the end of a session's process plus its watchdog, to 0 V."""


def records(events: Sequence[StoredEvent]) -> list[Event]:
    return [event.record for event in events]


def require_whole(events: Sequence[StoredEvent]) -> int:
    """Each touch that ended has one recording, whole and just before; return how many."""
    told = records(events)
    ended = 0
    for before, event in pairwise(told):
        if isinstance(event, TouchEnded):
            ended += 1
            assert isinstance(before, TouchRecorded)
            assert before.touch == event.touch
        if isinstance(event, TouchRecorded):
            assert isinstance(before, TouchStarted)
            begin_s, end_s = event.moved_s
            first_s = event.first_s + event.clock_offset_s
            assert len(event.counts()) == 6 * event.count
            assert first_s <= begin_s < end_s
            lasted_s = event.count / event.rate_hz
            assert lasted_s >= end_s - first_s - 0.1 - event.clock_error_s
    return ended


def is_ended(event: StoredEvent) -> bool:
    return event.tag == TouchEnded.TAG


def rehearsed(folder: Path) -> list[StoredEvent]:
    with open_journal(folder / "study.db") as journal:
        return journal.events("P01/1 (rehearsal)")


@pytest.mark.parametrize("draw", range(2))
def test_a_session_killed_while_it_records_keeps_whole_touches(tmp_path: Path, draw: int) -> None:
    killed_and_resumed(tmp_path, draw, RECORDED)
    assert require_whole(rehearsed(tmp_path)) >= 12


@pytest.mark.soak
@pytest.mark.parametrize("draw", range(100, 200))
def test_sessions_killed_at_100_instants_keep_whole_touches(tmp_path: Path, draw: int) -> None:
    killed_and_resumed(tmp_path, draw, RECORDED)
    assert require_whole(rehearsed(tmp_path)) >= 12


def test_a_withdrawal_erases_the_samples_from_the_disk(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(RECORDED)
    run = ("run", str(tmp_path), "--participant", "P01", "--ratings", "virtual")
    assert typed(*run) == 0
    kept = [event for event in records(rehearsed(tmp_path)) if isinstance(event, TouchRecorded)]
    assert len(kept) == 12
    # Longer texts may lie across pages of the file.
    pieces = [piece for touch in kept for piece in re.findall(".{48}", touch.samples)]
    digests = [touch.sha256 for touch in kept]
    assert sum(piece in raw(tmp_path) for piece in pieces) > 0.9 * len(pieces)
    assert typed("withdraw", str(tmp_path), "--participant", "P01", "--yes") == 0
    left = raw(tmp_path)
    assert not any(piece in left for piece in [*pieces, *digests])
    assert typed("verify", str(tmp_path)) == 0


def raw(folder: Path) -> str:
    """Return the bytes of all files of a study but its file, each as a character."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".toml"]
    return "".join(path.read_bytes().decode("latin-1") for path in files)


@pytest.fixture(params=["pty", "tcp"])
def simulator(request: pytest.FixtureRequest) -> Iterator[Endpoints]:
    with simulator_process((TOUCHBEAM,), seed=1, wire=request.param, keep=True) as endpoints:
        yield endpoints


def started(folder: Path, url: str, text: str) -> "subprocess.Popen[str]":
    """A dry run on the device at `url`, in real time."""
    (folder / "study.toml").write_text(text)
    run = [TOUCHBEAM, "run", str(folder), "--participant", "P01", "--ratings", "virtual"]
    return subprocess.Popen(
        [*run, "--device", url],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_dry_run_in_real_time_records_each_touch(tmp_path: Path, simulator: Endpoints) -> None:
    with started(tmp_path, simulator.url, tiny_study() + CHANNEL) as process:
        said, complaint = process.communicate(timeout=180)
    assert process.returncode == 0, complaint
    assert "is complete" in said
    events = rehearsed(tmp_path)
    assert require_whole(events) == len(list(filter(is_ended, events))) >= 3
    assert "the force channel felt no finger" in said, "nobody touches the beam"
    for touch in records(events):
        if isinstance(touch, TouchRecorded):
            assert touch.clock_error_s < 0.1
            assert touch.tare_n is not None
            assert abs(touch.tare_n[1]) < 0.02


@pytest.mark.parametrize(
    ("simulator", "number"),
    [("pty", signal.SIGINT), ("tcp", signal.SIGKILL)],
    indirect=["simulator"],
)
def test_the_output_goes_off_as_fast_while_touches_are_recorded(
    tmp_path: Path, simulator: Endpoints, number: int
) -> None:
    text = (
        short_study()
        .replace("watchdog_s = 5", "watchdog_s = 0.5")
        .replace("hold_s = 0.25", "hold_s = 5")
    )
    with (
        started(tmp_path, simulator.url, text + CHANNEL) as process,
        ControlClient(simulator.control) as control,
    ):
        assert until(lambda: control.state()["voltage_v"] > 20, within_s=60)
        time.sleep(0.3)
        process.send_signal(number)
        sent_s = time.monotonic()
        assert until(lambda: control.state()["voltage_v"] == 0, within_s=3)
        took_s = time.monotonic() - sent_s
        process.communicate(timeout=30)
    allowed_s = OFF_WITHIN_S + (0.5 if number == signal.SIGKILL else 0.0)
    assert took_s < allowed_s
    events = rehearsed(tmp_path)
    assert sum(event.tag == "touch-recorded" for event in events) == sum(
        event.tag == "touch-ended" for event in events
    ), "nothing half is kept"


LASTS_S = 60
SPEED_M_S = 0.001
NOISES = ("jitter", "tangential_noise_n", "normal_noise_n", "position_noise_m", "drift_n_per_min")


@pytest.mark.soak
def test_a_minute_is_recorded_whole_while_the_window_draws(
    tmp_path: Path, simulator: Endpoints, small_display: str
) -> None:
    first = '{ place = "smooth", voltage_v = 0'
    text = tiny_study().replace(first, f"{first}, duration_s = {LASTS_S}", 1)
    assert f"duration_s = {LASTS_S}" in text
    with ControlClient(simulator.control) as control:
        for noise in NOISES:
            control.sensor(noise, 0.0)
        limits = f"max_drive_s = {2 * LASTS_S}"
        text = re.sub(r"\[rig\]", f"[rig]\n{limits}", re.sub(r"max_drive_s = \S+", "", text))
        seat = Seat(tmp_path / "study", small_display, study=text + CHANNEL)
        with seat.start("--device", simulator.url) as session:
            slides = threading.Thread(target=slide_once, args=(seat, control), daemon=True)
            slides.start()
            code = session.attend(Person(small_display, "keyboard", [0] * 9, [5] * 9))
            assert code == 0, session.complaint
            slides.join()
    touch = next(event for event in records(seat.events()) if isinstance(event, TouchRecorded))
    assert touch.moved_s[1] - touch.moved_s[0] == pytest.approx(LASTS_S, abs=0.2)
    require_complete(touch)


def slide_once(seat: Seat, control: ControlClient) -> None:
    """Slide slowly along the beam from the beginning of the first touch on."""
    while not begun(seat.folder / "study.db"):
        time.sleep(0.2)
    control.touch(0.5, 0.01, "right", SPEED_M_S)


def begun(journal: Path) -> bool:
    """Return whether a touch has begun, read while another process writes the journal."""
    try:
        with closing(sqlite3.connect(f"{journal.as_uri()}?mode=ro", uri=True)) as reader:
            found = reader.execute("SELECT 1 FROM event WHERE tag = 'touch-started'").fetchone()
    except sqlite3.OperationalError:
        return False
    return found is not None


def require_complete(touch: TouchRecorded) -> None:
    """Each sample is there once: the finger moves on by the same way from each to the next."""
    counts = array("h", touch.counts())
    places_m = [touch.scale[2] * count for count in counts[2 * touch.count :]]
    begins = next(number for number, place_m in enumerate(places_m) if place_m > 0)
    assert touch.count - begins > 1000 * (LASTS_S - 1)
    for number, place_m in enumerate(places_m[begins:]):
        moved_m = place_m - places_m[begins]
        assert moved_m == pytest.approx(SPEED_M_S * number / 1000, abs=1.1 * touch.scale[2])
