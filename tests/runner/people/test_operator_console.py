"""The operator's console: keys, lines, and the panel on wide and narrow terminals."""

import io

import pytest

from protocol.journal.records import ReadBack
from runner.people.operator_console import OperatorConsole, PlainDisplay, panel_lines
from runner.people.operator_keys import OperatorKeys
from runner.people.terminal import visible
from runner.screens import Note, OperatorView

ON = ReadBack(
    output=True,
    voltage_v=200,
    frequency_hz=24_221,
    monitor_v=199.7,
    force_n=0.5,
    position_m=0.04,
    device_time_s=3,
)


def view(**changes: object) -> OperatorView:
    fields: dict[str, object] = {
        "session": "P01/1",
        "kind": "rehearsal",
        "state": "touching",
        "trial": "voltage",
        "next_trial": "pressure",
        "watchdog_s": 0.5,
        "done": 3,
        "total": 7,
        "left_s": 130.0,
        "device": ON,
        "busy": "",
        "last_answer": "smoother, score 8",
        "warning": "",
    }
    return OperatorView(**{**fields, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("key", "order"),
    [
        ("p", "pause"),
        ("s", "stop"),
        ("r", "repeat"),
        ("e", "emergency stop"),
        (" ", "emergency stop"),
    ],
)
def test_each_order_is_one_key(key: str, order: str) -> None:
    keys = OperatorKeys()
    keys.feed(key)
    assert keys.order() == order
    assert keys.order() is None


def test_other_keys_do_nothing() -> None:
    keys = OperatorKeys()
    keys.feed("xq\t\x00漢\n")
    assert keys.order() is None


def test_an_emergency_stop_overtakes_earlier_orders() -> None:
    keys = OperatorKeys()
    keys.feed("ppre")
    assert keys.order() == "emergency stop"
    assert keys.order() is None


def test_a_note_is_typed_corrected_and_finished() -> None:
    keys = OperatorKeys()
    keys.feed("nskn\x7fin dry\r")
    assert keys.order() == Note(text="skin dry")


def test_a_note_can_be_cancelled() -> None:
    keys = OperatorKeys()
    keys.feed("nski\x1bp")
    assert keys.order() == "pause"


def test_a_line_that_answers_a_question_is_not_an_order() -> None:
    keys = OperatorKeys()
    keys.expect_answer()
    keys.feed("pers\n")
    assert keys.answer() == "pers"
    assert keys.order() is None


def test_the_panel_shows_what_the_device_really_does() -> None:
    text = "\n".join(panel_lines(view(warning="no watchdog"), "", None))
    assert "ON 200 V 24221 Hz (monitor 200 V)" in text
    assert "3 of 7 trials, about 2 min left" in text
    assert "no watchdog" in text
    assert "next: pressure" in text
    assert "watchdog 0.5 s" in text
    assert "output: [bold green]off" in "\n".join(panel_lines(view(device=None), "", None))


@pytest.mark.parametrize("changes", [{"state": "idle"}, {"unknown": True}])
def test_an_output_not_read_back_is_not_shown_as_off(changes: dict[str, object]) -> None:
    first = panel_lines(view(device=None, **changes), "", None)[0]
    assert first.startswith("output: [bold red]")
    assert "off" not in first


def test_typed_markup_is_shown_as_text() -> None:
    lines = panel_lines(view(last_answer="[red]x"), "", "[bold]note")
    assert "\\[red]x" in lines[-1]
    assert "\\[bold]note" in lines[1]


def test_the_panel_shows_what_a_terminal_would_obey_as_escapes() -> None:
    texts = ("session", "trial", "next_trial", "last_answer", "warning")
    lines = panel_lines(view(**dict.fromkeys(texts, "\x1b[2J\n\u202e")), "\x9b", "\x1b")
    assert [line for line in lines if visible(line) != line] == []
    assert sum(line.count(r"\x1b[2J\n\u202e") for line in lines) == len(texts)


def test_plain_lines_are_printed_only_when_something_changes() -> None:
    said: list[str] = []
    console = OperatorConsole(lambda _: "", PlainDisplay(said.append))
    for _ in range(3):
        console.show(view())
    assert said == [
        "P01/1 touching voltage; 3 of 7 trials, about 2 min left; "
        "output ON 200 V 24221 Hz (monitor 200 V)"
    ]


def test_a_question_waits_for_enter() -> None:
    typed = iter(["", "d", "ry", "\n"])
    console = OperatorConsole(lambda _: next(typed), PlainDisplay(lambda _: None))
    console.ask("skin state?")
    assert [console.answered() for _ in range(3)] == [None, None, "dry"]


def test_without_an_operator_the_answer_is_empty_and_the_beam_is_swapped() -> None:
    swapped: list[str] = []
    console = OperatorConsole(
        lambda _: "", PlainDisplay(lambda _: None), swapped.append, alone=True
    )
    console.mount("1.5 mm")
    assert console.answered() == ""
    assert swapped == ["1.5 mm"]


def test_an_emergency_stop_is_one_key_away_while_a_line_is_typed() -> None:
    keys = OperatorKeys()
    keys.feed("n ")
    assert keys.order() == "emergency stop"
    keys.feed("skin\x05")
    assert keys.order() == "emergency stop"


@pytest.mark.parametrize(("line", "order"), [("e\n", "emergency stop"), ("s\n", "stop")])
def test_an_order_never_answers_a_question(line: str, order: str) -> None:
    typed = iter(["", f":{line}", "", "dry\n"])
    console = OperatorConsole(lambda _: next(typed), PlainDisplay(lambda _: None))
    console.ask("skin state?")
    assert console.answered() is None
    assert console.order() == order
    assert console.answered() == "dry"


@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("n skin dry\n", Note(text="skin dry")),
        ("note skin dry\n", Note(text="skin dry")),
        ("NOTE skin dry\n", Note(text="skin dry")),
        ("N\n", None),
        ("P\n", "pause"),
        ("nskin dry\n", Note(text="skin dry")),
        (" n skin dry\n", Note(text="skin dry")),
        (" p\n", "pause"),
        ("stop\n", "stop"),
        (" \n", "emergency stop"),
        ("\x05\n", "emergency stop"),
        ("n\n", None),
        ("\n", None),
        ("x\n", None),
        ("resume\n", None),
        ("ee\n", "emergency stop"),
        ("E\n", "emergency stop"),
        ("e!\n", "emergency stop"),
        ("estop\n", "emergency stop"),
        ("EMERGENCY STOP\n", "emergency stop"),
        ("skip\n", None),
        ("repeat\n", "repeat"),
    ],
)
def test_a_typed_line_gives_one_order(line: str, order: object) -> None:
    keys = OperatorKeys()
    keys.feed_order(line)
    assert keys.order() == order
    assert keys.order() is None
    assert keys.line is None


def test_a_colon_in_a_note_is_part_of_it() -> None:
    typed = iter(["n", "at 3", ":", "15\n"])
    console = OperatorConsole(lambda _: next(typed), PlainDisplay(lambda _: None))
    assert [console.order() for _ in range(4)] == [None, None, None, Note(text="at 3:15")]


def test_the_search_for_the_resonance_is_shown_as_on() -> None:
    assert view(device=None, busy="10 V at most, searching").output().startswith("ON")


@pytest.mark.parametrize("enter", ["\n", "\r"])
def test_enter_confirms_a_beam(enter: str) -> None:
    keys = OperatorKeys()
    keys.expect_confirmation()
    keys.feed(enter)
    assert (keys.answer(), keys.order()) == ("", None)


@pytest.mark.parametrize("line", ["yes\n", "1\n", "mounted\r"])
def test_a_line_confirms_a_beam_only_if_input_is_piped(line: str) -> None:
    for any_line, answer in ((False, None), (True, "")):
        keys = OperatorKeys()
        keys.expect_confirmation(any_line=any_line)
        keys.feed(line)
        assert (keys.answer(), keys.order()) == (answer, None)


@pytest.mark.parametrize(
    ("typed", "order"),
    [
        ("s", "stop"),
        ("s\n", "stop"),
        ("p", "pause"),
        ("r\n", "repeat"),
        (" ", "emergency stop"),
        (" \n", "emergency stop"),
        ("  \n", "emergency stop"),
        ("  ", "emergency stop"),
        ("ee\n", "emergency stop"),
        ("EMERGENCY\n", "emergency stop"),
        ("mounted\x05\n", "emergency stop"),
        ("stop\n", "stop"),
        ("pause\n", "pause"),
        ("x", None),
        ("x \n", None),
    ],
)
def test_an_order_does_not_confirm_a_beam(typed: str, order: object) -> None:
    keys = OperatorKeys()
    keys.expect_confirmation()
    keys.feed(typed)
    ordered = keys.order()
    assert (ordered, keys.answer()) == (order, None)
    keys.feed("\n")
    assert keys.answer() == ""


def test_a_note_does_not_confirm_a_beam() -> None:
    keys = OperatorKeys()
    keys.expect_confirmation()
    keys.feed("n")
    keys.feed("beam is loose\r")
    assert (keys.order(), keys.answer()) == (Note(text="beam is loose"), None)
    keys.feed("\r")
    assert keys.answer() == ""


def test_input_typed_before_a_question_does_not_answer_it() -> None:
    typed, forgotten = iter(["\n\n", "", "\n"]), []
    console = OperatorConsole(
        lambda _: next(typed), PlainDisplay(lambda _: None), forget=lambda: forgotten.append(True)
    )
    console.mount("1 mm")
    assert forgotten == [True]
    assert [console.answered() for _ in range(2)] == [None, ""]


def test_a_withdrawn_question_is_neither_shown_nor_answered() -> None:
    said: list[str] = []
    typed = iter(["", "dr", "", "\n"])
    console = OperatorConsole(lambda _: next(typed), PlainDisplay(said.append))
    console.show(view(device=None))
    console.ask("skin state?")
    assert console.answered() is None
    console.withdraw_question()
    console.show(view())
    assert said.count("skin state?") == 1
    assert "skin state?" not in said[said.index("skin state?") + 1 :]
    assert console.answered() is None
    assert console.answered() is None


def test_a_question_is_printed_once_whatever_else_is_shown() -> None:
    said: list[str] = []
    console = OperatorConsole(lambda _: "", PlainDisplay(said.append))
    console.show(view())
    console.ask("skin state?")
    for _ in range(3):
        console.show(view())
    console.show(view(done=4))
    assert said.count("skin state?") == 1
    assert len(said) == 3


def test_an_unknown_order_is_reported() -> None:
    said: list[str] = []
    typed = iter([":resume\n"])
    console = OperatorConsole(lambda _: next(typed), PlainDisplay(said.append))
    console.show(view())
    assert console.order() is None
    assert said[-1].startswith("warning: ':resume' is not an order; use :p pause or continue")


def test_the_panel_explains_the_keys_that_work_while_a_line_is_typed() -> None:
    typing, mounting = panel_lines(view(), "skin state?", "dr"), panel_lines(view(), "Mount", None)
    assert "Ctrl-E EMERGENCY STOP" in typing[2]
    assert "r repeat" not in "".join(typing)
    assert "r repeat" in mounting[2]


def test_a_small_terminal_shows_the_output_and_the_question() -> None:
    from rich.console import Console
    from rich.panel import Panel

    terminal = Console(width=30, height=16, force_terminal=True, file=io.StringIO())
    lines = panel_lines(view(warning="no watchdog"), "Mount the beam '1 mm', then Enter.", None)
    shown = terminal.render_lines(Panel("\n".join(lines)))[:15]
    text = "".join("".join(part.text for part in line) for line in shown)
    for needed in ("output: ON", "200 V", "Mount the beam", "EMERGENCY"):
        assert needed in text
