"""Exported recordings: whole, on the session's clock, described, and valid by the validator."""

import gzip
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from analysis.export.bids import bids_export, bids_recordings
from analysis.export.csv_tables import csv_recordings
from analysis.export.dataset import Dataset, dataset
from analysis.export.formats import EXPORTS, RECORDINGS
from analysis.export.recordings import DRIVEN, MEASURED
from protocol.journal.events import TouchRecorded
from protocol.journal.records import CHANNELS
from protocol.study.columns import names_of
from protocol.study_file.loading import parsed_study
from tests.analysis.export.data_slips import csv_rows
from tests.analysis.export.test_formats import NOBODY_SAID, as_pybids_reads, warnings
from tests.analysis.hostile_study import Written, study_text

RATE_HZ, SAMPLES = 500.0, 700
SCALE = (1e-4, 2e-4, 2.5e-6)
TARE_N = (0.01, 0.02)
COUNTS = np.vstack([np.arange(SAMPLES) + 100 * channel for channel in range(3)]).astype("<i2")


class Recording(Written):
    """A session that records its touches; `spoilt` ones are not those that were recorded."""

    tare_n: tuple[float, float] | None = TARE_N
    spoilt = False

    def touch(self, number: int) -> None:
        drive = {"voltage_v": 100.0, "frequency_hz": 24_000.0}
        self.add("touch-started", touch=number, commanded={**drive, "ramp_v_per_s": 400.0})
        told = TouchRecorded.packed(
            COUNTS.tobytes(),
            touch=number,
            source="board",
            rate_hz=RATE_HZ,
            first_s=5.0,
            scale=SCALE,
            clock_offset_s=100.0,
            clock_error_s=0.0004,
            moved_s=(105.4, 106.2),
            tare_n=self.tare_n,
            saturated=0,
        ).to_json()
        told |= {"sha256": "0" * 64} if self.spoilt else {}
        self.add("touch-recorded", **told)
        read = [
            {**drive, "output": True, "device_time_s": 5.4},
            {**drive, "voltage_v": 60.0, "output": True, "device_time_s": 6.2},
        ]
        self.add("touch-ended", touch=number, read_back=read, trace=[])


def data(*sessions: Written) -> Dataset:
    chains = [session.events for session in sessions]
    return dataset(chains, parsed_study(study_text()), "0", rehearsals=False)


def recorded(who: str = "P-01", number: int = 1) -> Recording:
    session = Recording(who, number)
    session.whole({})
    return session


def rows(packed: bytes) -> list[list[str]]:
    return [line.split("\t") for line in gzip.decompress(packed).decode().splitlines()]


def put(files: Mapping[str, bytes], folder: Path) -> Path:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def test_the_official_validator_and_pybids_read_recordings(tmp_path: Path) -> None:
    told = data(recorded(), recorded("=P02"), recorded("P03", 2))
    texts = {name: text.encode() for name, text in bids_export(told).items()}
    folder = put({**texts, **bids_recordings(told)}, tmp_path / "bids")
    assert warnings(folder) == NOBODY_SAID
    layout = as_pybids_reads(folder)
    samples = layout.get(suffix="physio", extension=".tsv.gz")
    assert len(samples) == sum(name.endswith("physio.tsv.gz") for name in bids_recordings(told))
    assert samples[0].get_metadata()["SamplingFrequency"] == RATE_HZ


def test_each_touch_has_its_samples_beside_its_drive() -> None:
    session = recorded()
    files = bids_recordings(data(session))
    touches = sum(len(trial.touches) for trial in session.plan.trials)
    assert len(files) == 4 * touches
    stem = "sub-P01/beh/sub-P01_task-touch1_recording-trial1touch0_"
    physio, stim = (rows(files[f"{stem}{suffix}.tsv.gz"]) for suffix in ("physio", "stim"))
    assert len(physio) == len(stim) == SAMPLES
    zeros = np.array([*TARE_N, 0.0])
    expected = (COUNTS * np.array(SCALE)[:, None]).T - zeros
    assert np.array(physio, float) == pytest.approx(expected, abs=1e-7)
    before, during, after = stim[0], stim[400], stim[-1]
    assert (before, after) == (["n/a", "n/a", "0"],) * 2
    assert float(during[0]) == pytest.approx(80, abs=0.1)
    assert during[1:] == ["24000", "1"]
    for suffix, columns in (("physio", MEASURED), ("stim", DRIVEN)):
        sidecar = json.loads(files[f"{stem}{suffix}.json"])
        assert sidecar["SamplingFrequency"] == RATE_HZ
        assert sidecar["StartTime"] == 105.0, "on the session's clock"
        assert sidecar["Columns"] == names_of(columns)
        assert all(sidecar[name]["Description"] for name in sidecar["Columns"])
    told = json.loads(files[f"{stem}physio.json"])
    assert "less 0.02 N" in told["normal_n"]["Description"]
    assert {told[name]["Units"] for name in CHANNELS} == {"N", "m"}


def test_the_table_has_the_same_samples() -> None:
    files = csv_recordings(data(recorded(), recorded("P02")))
    assert sorted(files) == [
        "recordings/P01_session-1.csv",
        "recordings/P02_session-1.csv",
        "recordings/recordings.json",
    ]
    table = csv_rows(files["recordings/P01_session-1.csv"].decode())
    mine = [row for row in table if (row["trial_index"], row["touch"]) == ("1", "0")]
    assert len(mine) == SAMPLES
    assert (mine[0]["t_s"], mine[0]["voltage_v"], mine[0]["mark_moves"]) == ("105.000000", "", "0")
    assert float(mine[-1]["position_m"]) == pytest.approx((SAMPLES + 199) * SCALE[2])
    assert list(table[0]) == [
        "trial_index",
        "touch",
        *json.loads(files["recordings/recordings.json"]),
    ]


def test_forces_without_a_tare_are_told_as_the_sensor_gave_them() -> None:
    session = Recording("P01")
    session.tare_n = None
    session.whole({})
    files = bids_recordings(data(session))
    stem = "sub-P01/beh/sub-P01_task-touch1_recording-trial0touch0_physio"
    assert rows(files[f"{stem}.tsv.gz"])[0][0] == "0"
    assert "as the sensor gave it" in json.loads(files[f"{stem}.json"])["normal_n"]["Description"]


def test_of_a_trial_that_came_again_the_last_attempt_is_exported() -> None:
    session = Recording("P01")
    session.arm()
    first = session.plan.trials[0]
    session.start(first)
    session.abort(first, "stopped")
    session.start(first)
    session.answer(first, None)
    files = bids_recordings(data(session))
    assert len(files) == 4 * len(first.touches)


def test_samples_that_were_changed_are_not_exported() -> None:
    session = Recording("P01")
    session.spoilt = True
    session.whole({})
    assert bids_recordings(data(session)) == csv_recordings(data(session)) == {}


@pytest.mark.parametrize("name", RECORDINGS)
def test_nothing_recorded_gives_no_file_and_the_withdrawn_give_none(name: str) -> None:
    plain, gone = Written("P01"), recorded("W01")
    plain.whole({})
    gone.add("withdrawn")
    assert RECORDINGS[name](data(plain, gone)) == {}
    assert list(RECORDINGS) == list(EXPORTS)


@pytest.mark.parametrize("name", RECORDINGS)
def test_the_same_recordings_give_the_same_bytes(name: str) -> None:
    assert RECORDINGS[name](data(recorded())) == RECORDINGS[name](data(recorded()))
