"""What a terminal shows of hostile files and devices: characters that it would obey, as escapes."""

import ast
import json
import os
import pty
import socket
import sqlite3
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import chain as joined
from pathlib import Path

import pytest

from device.simulator.device import SimulatedDevice
from protocol.journal.events import DeviceArmed, DeviceOff, NoteTaken, SessionOpened
from protocol.study_file.loading import template
from runner.journal.opening import open_journal, read_journal
from runner.people.terminal import visible, visible_json
from tests.analysis.chains import chain, scored_session
from tests.runner.command_line import TOUCHBEAM
from tests.runner.journal.tampering import tampering

pytestmark = pytest.mark.waits

ROOT = Path(__file__).parents[2]
ATTACKS = ("\x1b]0;pwned\x07", "\x1b[2J", "\x9b2J", "\x7f", "\u202e", "\u2066", "\u200f", "\u061c")
HOSTILE = "P1" + "".join(ATTACKS)
SHOWN = r"P1\x1b]0;pwned\x07\x1b[2J\x9b2J\x7f\u202e\u2066\u200f\u061c"


TABLE_ALONE = {"status": (), "verify": (), "report": ("--sections", "table4")}
"""Commands; a report prints the same without its fits and figures."""


def on_terminal(*arguments: str | Path, typed: str = "") -> tuple[int, str]:
    """Run a command on a terminal; return its exit code and what it wrote."""
    keyboard, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "2000", "LINES": "50"}
    process = subprocess.Popen(
        [TOUCHBEAM, *map(str, arguments)],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        env=environment,
        start_new_session=True,
    )
    os.close(terminal)
    os.write(keyboard, typed.encode())
    written = b"".join(_until_closed(keyboard))
    os.close(keyboard)
    return process.wait(), written.decode()


def _until_closed(keyboard: int) -> Iterator[bytes]:
    try:
        while data := os.read(keyboard, 65536):
            yield data
    except OSError:  # the last program that had the terminal has ended
        return


def assert_harmless(written: str) -> None:
    found = [attack for attack in ATTACKS if attack in written]
    assert not found, f"{found!r} in {written!r}"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study whose journal somebody else has made."""
    (tmp_path / "study.toml").write_text(template("paper"))
    conditions = (HOSTILE, "[red]voltage[/]", "touch 触觉")
    with open_journal(tmp_path / "study.db") as journal, journal.alone():
        for name, scores in (
            (HOSTILE, (5, 6, 7)),
            ("P02\nok  P03/1", (4, 8, 9)),
            ("P4", (6, 6, 9)),
        ):
            scored = scored_session(name, zip(conditions, scores, strict=True), conditions)
            opening = scored[0]
            assert isinstance(opening, SessionOpened)
            events = [
                replace(opening, consent=HOSTILE),
                DeviceArmed.from_json({"idn": HOSTILE}),
                *scored[1:-1],
                NoteTaken(text=HOSTILE),
                DeviceOff(confirmed=True, why=HOSTILE),
                scored[-1],
            ]
            for stored in chain(events):
                journal.append(f"{name}/1", stored)
    return tmp_path


@pytest.mark.parametrize("command", TABLE_ALONE)
def test_names_in_a_journal_are_shown_as_escapes(study: Path, command: str) -> None:
    code, written = on_terminal(command, study, *TABLE_ALONE[command])
    assert code == 0, written
    assert_harmless(written)
    assert SHOWN in written
    assert r"P02\nok  P03" in written, "a name does not begin a line of its own"
    if command == "report":
        assert "[red]voltage[/]" in written
        assert "触觉" in written


@pytest.mark.parametrize("command", TABLE_ALONE)
def test_json_on_a_terminal_is_the_same_document_with_escapes(study: Path, command: str) -> None:
    _, written = on_terminal(command, study, "--json", *TABLE_ALONE[command])
    assert_harmless(written)
    document = json.loads(written)
    if command != "report":
        assert HOSTILE in [session["participant"] for session in document["sessions"]]


def test_a_broken_chain_is_named_in_escapes(study: Path) -> None:
    with tampering(study / "study.db") as journal:
        journal.execute("UPDATE event SET utc = '2026-01-01T12:00:00+00:00' WHERE seq = 1")
    for command in ("verify", "report"):
        _, written = on_terminal(command, study, *TABLE_ALONE[command])
        assert_harmless(written)
        assert SHOWN in written


def test_a_damaged_event_is_named_in_escapes(study: Path) -> None:
    with closing(sqlite3.connect(study / "study.db")) as journal, journal:
        journal.execute(
            "INSERT INTO event (session, seq, tag, utc, monotonic_s, payload_sha256, hash, payload)"
            " VALUES (?, 0, 'note', '2026-01-01T12:00:00+00:00', 0, '', '', '[')",
            (f"{HOSTILE}/2",),
        )
    for command in ("status", "verify", "report"):
        code, written = on_terminal(command, study)
        assert code == 1
        assert_harmless(written)


@pytest.mark.parametrize("command", ["check", "report", "run"])
def test_a_key_of_a_study_file_is_shown_as_escapes(study: Path, command: str) -> None:
    file = study / "study.toml"
    file.write_text(
        f'"\\u001b[2J\\u202eX" = 1\n["\\u001b]0;pwned\\u0007"]\nx = 2\n{file.read_text()}'
    )
    more = ("--participant", "P01", "--ratings", "virtual") if command == "run" else ()
    code, written = on_terminal(command, study, *more)
    assert code == 2
    assert_harmless(written)
    assert r"\x1b[2J\u202eX" in written


def test_a_traceback_shows_escapes(tmp_path: Path) -> None:
    for debug in ((), ("--debug",)):
        _, written = on_terminal("report", tmp_path / "\x1b[2J", *debug)
        assert_harmless(written)
        assert r"\x1b[2J: no s" in written


@contextmanager
def hostile_device(answers: dict[str, str]) -> Iterator[str]:
    """Yield the address of a simulated board that gives `answers` to these queries."""
    device = SimulatedDevice(seed=1)

    def serve() -> None:
        with server:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:  # closed: the test is over
                    return
                with connection, connection.makefile("rwb") as lines:
                    for line in lines:
                        asked = line.decode().strip()
                        answer = answers.get(asked) or device.answer(asked, 0.0)
                        if answer is not None:
                            lines.write(answer.encode() + b"\n")
                            lines.flush()

    server = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"socket://127.0.0.1:{server.getsockname()[1]}"
    finally:
        server.shutdown(socket.SHUT_RDWR)
        thread.join(timeout=5)


@pytest.mark.parametrize(
    "answers",
    [
        {"*IDN?": HOSTILE},
        {"*IDN?": f"touchbeam,board,{HOSTILE},1"},
        {"SYST:ERR?": f'1,"{HOSTILE}"'},
    ],
    ids=["foreign", "name", "error"],
)
@pytest.mark.parametrize("command", ["probe", "sweep", "run"])
def test_a_device_cannot_write_to_the_terminal(
    study: Path, command: str, answers: dict[str, str]
) -> None:
    with hostile_device(answers) as url:
        if command == "run":
            of = ("--participant", "P09", "--ratings", "console", "--device", url)
            _, written = on_terminal("run", study, *of, typed="\x05\n")
        else:
            _, written = on_terminal("device", command, url)
    assert written
    assert_harmless(written)


def test_a_console_session_shows_typed_characters_as_escapes(tmp_path: Path) -> None:
    """The terminal itself echoes them as `^[`."""
    (tmp_path / "study.toml").write_text(template("paper"))
    of = ("--participant", "P01", "--ratings", "console", "--rehearsal")
    code, written = on_terminal("run", tmp_path, *of, typed=f":{HOSTILE[2:8]}\n:e\n")
    assert code == 1
    assert_harmless(written)


@pytest.mark.parametrize("answer", ["n", "", "yes please"])
def test_a_person_on_the_simulated_device_is_confirmed(tmp_path: Path, answer: str) -> None:
    (tmp_path / "study.toml").write_text(template("paper"))
    of = ("--participant", "P01", "--ratings", "console", "--consent", "C-1")
    code, written = on_terminal("run", tmp_path, *of, typed=f"{answer}\n")
    assert code == 2
    for said in ("P01/1 will be a rehearsal", "Go on? [y/N]", "nothing was done; add --rehearsal"):
        assert said in written
    assert not (tmp_path / "study.db").exists()


def test_a_confirmed_rehearsal_begins(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"))
    of = ("--participant", "P01", "--ratings", "console")
    code, _ = on_terminal("run", tmp_path, *of, typed="y\n:e\n")
    assert code == 1
    with read_journal(tmp_path / "study.db") as journal:
        assert journal.sessions() == ["P01/1 (rehearsal)"]


@pytest.mark.parametrize("code", [*range(0x20), *range(0x7F, 0xA0), 0x2028, 0x2029, 0xD800, 0xDFFF])
def test_every_character_that_a_terminal_obeys_is_shown(code: int) -> None:
    assert visible(chr(code)) == ascii(chr(code))[1:-1]
    assert json.loads(visible_json(json.dumps(chr(code), ensure_ascii=False))) == chr(code)


def test_ordinary_text_stays() -> None:
    text = "触觉 é ñ العربية \U0001f469\u200d\U0001f52c – ‘x’ \\x1b"
    assert visible(text) == text


PRINTERS = {"print", "echo", "secho", "showwarning"}


def _printing(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield what prints, except under `if __name__ == "__main__"`."""
    body = [node for node in tree.body if not _is_main(node)]
    for node in joined.from_iterable(map(ast.walk, body)):
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in PRINTERS | {"input"}:
                yield node
            case ast.Attribute(attr=name) if name in PRINTERS:
                yield node
            case ast.Attribute(value=ast.Name(id="typer" | "click"), attr="confirm" | "prompt"):
                yield node
            case ast.Attribute(
                value=ast.Attribute(attr="stdout" | "stderr"), attr="write" | "buffer"
            ):
                yield node
            case ast.Attribute(value=ast.Name(id="sys"), attr="__stdout__" | "__stderr__"):
                yield node
            case ast.Import(names=names) if any(name.name == "logging" for name in names):
                yield node


def _is_main(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and "__main__" in ast.unparse(node.test)


def test_one_module_prints() -> None:
    """All others hand their text to it, so no text can reach a terminal unescaped.

    What the processes of the window and of the list of screens print goes to touchbeam alone; in a
    program of one's own there are no commands, and what a rig says is made visible where it stands.
    """
    printing = {
        str(path.relative_to(ROOT))
        for package in ("protocol", "device", "runner", "analysis", "touchbeam")
        for path in (ROOT / package).rglob("*.py")
        if any(_printing(ast.parse(path.read_text(encoding="utf-8"))))
    }
    to_touchbeam = {"runner/window/server.py", "runner/screen_list.py"}
    assert printing == {"touchbeam/cli/output.py", "touchbeam/held_rigs.py", *to_touchbeam}
