"""What large tables and journals cost: time and memory of import, export, report and loading."""

import json
import os
import random
import sqlite3
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from time import process_time

import pandas as pd
from pytest_benchmark.fixture import BenchmarkFixture

import touchbeam
from benchmarks.compared import compare, tell
from benchmarks.large_studies import large_study

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
MOST_GB = 2.0
MOST_REPORT_GB = 1.0
MOST_RATIO = 2.5
"""Of the time for twice as much, less the time to start."""


def _measured(*arguments: str | Path) -> tuple[float, float]:
    """Run a command; return its processor time, s, and its peak memory, GB."""
    command = [TOUCHBEAM, *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024**2


def _table(folder: Path, subjects: int) -> Path:
    """A table of whole scores of five conditions."""
    stream = random.Random(1)
    names = ("frequency", "structure", "voltage", "direction", "pressure")
    rows = (
        [f"P{number}", *(str(stream.randint(0, 10)) for _ in names)] for number in range(subjects)
    )
    file = folder / f"scores-{subjects}.csv"
    file.write_text("".join(",".join(row) + "\n" for row in (["subject", *names], *rows)))
    return file


def _told(
    benchmark: BenchmarkFixture, work: str, start_s: float, took: list[tuple[float, float]]
) -> tuple[float, float]:
    """Record the figures of two sizes; return the ratio of the times and the most memory."""
    (half_s, half_gb), (whole_s, whole_gb) = took
    ratio = (whole_s - start_s) / (half_s - start_s)
    tell(
        benchmark,
        f"{work}, and half of it",
        processor_time=f"{whole_s:.1f} s, {ratio:.2f} times that of the half",
        memory=f"{whole_gb:.2f} GB, of the half {half_gb:.2f} GB",
    )
    return ratio, whole_gb


def test_100_000_rows_are_imported_in_proportion(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    start_s, _ = _measured("import", _table(tmp_path, 10), tmp_path / "few")
    tables = [_table(tmp_path, subjects) for subjects in (50_000, 100_000)]

    def imported() -> list[tuple[float, float]]:
        return [_measured("import", table, tmp_path / table.stem) for table in tables]

    took = benchmark.pedantic(imported, rounds=1)
    ratio, most_gb = _told(benchmark, "import 100,000 rows", start_s, took)
    assert ratio <= MOST_RATIO
    assert most_gb <= MOST_GB


def test_100_000_trials_are_exported_in_proportion(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    options = ("--format", "csv")
    few = large_study(tmp_path / "few", 2)
    start_s, _ = _measured("export", few, tmp_path / "few-out", *options)
    studies = [large_study(tmp_path / str(count), count) for count in (1021, 2042)]

    def exported() -> list[tuple[float, float]]:
        return [
            _measured("export", study, tmp_path / f"{study.name}-out", *options)
            for study in studies
        ]

    took = benchmark.pedantic(exported, rounds=1)
    ratio, most_gb = _told(benchmark, "export 100,000 trials as CSV", start_s, took)
    tables = [pd.read_csv(path) for path in sorted((tmp_path / "2042-out").glob("*.csv"))]
    assert max(map(len, tables)) > 100_000
    began_s = process_time()
    for number, table in enumerate(tables):
        table.to_csv(tmp_path / f"{number}.csv", index=False)
    pandas_s = process_time() - began_s
    compare(
        benchmark,
        "verify a journal of 100,000 trials, and export all of it as CSV",
        "pandas.to_csv of the same tables, once made",
        [took[1][0]],
        [pandas_s],
        f"at most {most_gb:.2f} GB",
    )
    assert ratio <= MOST_RATIO
    assert most_gb <= MOST_GB


def test_a_report_on_500_participants_is_written_in_proportion(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    """Both sizes have more than 8,000 trials; what a report on a few costs is the same for all."""
    start_s, _ = _measured(
        "report", large_study(tmp_path / "few", 10), "--out", tmp_path / "few-out"
    )
    studies = [large_study(tmp_path / str(count), count) for count in (250, 500)]

    def reported() -> list[tuple[float, float]]:
        return [
            _measured("report", study, "--out", tmp_path / f"{study.name}-out") for study in studies
        ]

    took = benchmark.pedantic(reported, rounds=1)
    ratio, most_gb = _told(benchmark, "report 500 participants x 49 trials", start_s, took)
    assert ratio <= MOST_RATIO
    assert most_gb <= MOST_REPORT_GB


def test_data_frames_of_1000_participants_take_at_most_3_times_what_reading_the_csv_takes(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    """From a study that is loaded; reading and verifying the journal is told apart."""
    folder = large_study(tmp_path / "study", 1000)
    out = tmp_path / "out"
    _measured("export", folder, out, "--format", "csv")
    began_s = process_time()
    study = touchbeam.load(folder)
    loaded_s = process_time()
    assert [len(table) for table in (study.trials, study.touches)] == [49_000, 94_550]
    assert len(study.traces()) == 8 * 94_550
    framed_s = process_time()

    def read() -> float:
        started_s = process_time()
        assert len(pd.read_csv(out / "trials.csv")) == 49_000
        return process_time() - started_s

    read()  # the first time also imports the reader
    read_s = benchmark.pedantic(read, rounds=1)
    compare(
        benchmark,
        "data frames of 1,000 participants, once the study is loaded",
        "pandas.read_csv of their trials alone",
        [framed_s - loaded_s],
        [read_s],
        f"loading and verifying the journal takes {(loaded_s - began_s) / read_s:.0f} x the peer",
    )
    assert framed_s - loaded_s <= 3 * read_s


def test_loading_takes_at_most_6_times_what_reading_the_payloads_takes(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    folder = large_study(tmp_path / "study", 100)

    def loaded() -> float:
        began_s = process_time()
        assert len(touchbeam.load(folder).recorded.attempts) == 4_900
        return process_time() - began_s

    def read() -> float:
        began_s = process_time()
        with sqlite3.connect(folder / "study.db") as rows:
            for salt, body in rows.execute("SELECT salt, payload FROM event"):
                assert json.loads(body) is not None
                assert sha256(salt + body.encode()).digest()
        rows.close()
        return process_time() - began_s

    loaded()  # the first time also imports what loads
    took, peer = zip(*((loaded(), read()) for _ in range(5)), strict=True)
    benchmark.pedantic(loaded, rounds=1)
    most_gb = getrusage(RUSAGE_SELF).ru_maxrss / 1024**2
    ratio = compare(
        benchmark,
        "verify and load the journal of 100 participants x 49 trials",
        "SQLite, json.loads and SHA-256 of the same payloads",
        took,
        peer,
        f"at most {most_gb:.2f} GB",
    )
    assert ratio <= 6
