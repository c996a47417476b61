"""The operator's console: keys, orders, questions, messages and plain lines."""

from collections.abc import Iterable

import pytest

from protocol.journal.records import ReadBack
from runner.people.operator_console import (
    NO_ORDER,
    Frame,
    OperatorConsole,
    OperatorKeys,
    PlainDisplay,
    line_help,
)
from runner.screens import Correction, Note, WindowState
from tests.runner.views import plan, view

ON = ReadBack(
    output=True,
    voltage_v=200,
    frequency_hz=24_221,
    monitor_v=199.7,
    force_n=0.5,
    position_m=0.04,
    device_time_s=3,
)


def console(typed: Iterable[str] = (), said: list[str] | None = None) -> OperatorConsole:
    """A console of plain lines, whose operator types `typed`, one piece at a time."""
    pieces = iter(typed)
    say = (lambda _: None) if said is None else said.append
    return OperatorConsole(lambda _: next(pieces, ""), PlainDisplay(say))


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


@pytest.mark.parametrize("typed", ["teacher", "e e e", " ", "spring", "never sure\r", "n c e"])
def test_no_letter_is_an_order_while_the_participant_types(typed: str) -> None:
    keys = OperatorKeys()
    keys.participant_types = True
    keys.feed(typed)
    assert (keys.order(), keys.line) == (None, None)
    keys.feed("\x05")
    assert keys.order() == "emergency stop"
    keys.participant_types = False
    keys.feed("e")
    assert keys.order() == "emergency stop"


def test_a_note_goes_on_while_the_participant_types() -> None:
    keys = OperatorKeys()
    keys.feed("n")
    keys.participant_types = True
    keys.feed(" eager\r")
    assert keys.order() == Note(text="eager")


def test_an_order_in_a_line_of_its_own_counts_while_the_participant_types() -> None:
    keys = OperatorKeys()
    keys.participant_types = True
    assert keys.feed_order("e\n")
    assert keys.order() == "emergency stop"


def test_the_console_says_once_that_letters_are_no_orders() -> None:
    said: list[str] = []
    operator = console(["teach", "er", "\x05"], said)
    operator.show(view())
    operator.page("question job", typed=True)
    assert [operator.order() for _ in range(3)] == [None, None, "emergency stop"]
    assert said.count(NO_ORDER) == 1
    operator.window(WindowState(has_keys=True, is_shown=True))
    operator.window(WindowState(has_keys=False, is_shown=False))
    assert said[-2:] == [
        "keys go to the participant's window",
        "the participant's window is minimised",
    ]


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


def test_no_control_character_comes_into_an_answer_and_escape_begins_it_anew() -> None:
    keys = OperatorKeys()
    keys.expect_answer()
    keys.feed("yester\x1btod\x01\tay\n")
    assert keys.answer() == "today"


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
    console.show(view(plan=plan(4)))
    assert said.count("skin state?") == 1
    assert len(said) == 3


def test_plain_lines_are_printed_only_when_something_changes() -> None:
    said: list[str] = []
    operator = console(said=said)
    for _ in range(3):
        operator.show(view(device=ON))
    assert said == [
        "P01/1 touching: voltage; 3 of 7 trials, about 2 min left; "
        "output ON 200 V 24221 Hz (monitor 200 V)"
    ]


def test_a_terminal_shared_with_the_participant_does_not_tell_the_stimulus() -> None:
    said: list[str] = []
    PlainDisplay(said.append, shared=True).show(Frame(view=view(device=ON)))
    assert said == [
        "P01/1 touching: trial 4; 3 of 7 trials, about 2 min left; output ON, as commanded"
    ]


@pytest.mark.parametrize(("left_s", "said"), [(130, ", about 2 min"), (20, ", less than 1 min")])
def test_the_time_left_is_never_0_before_the_end(left_s: float, said: str) -> None:
    assert view(left_s=left_s).progress() == f"3 of 7 trials{said} left"
    assert view(left_s=0).progress() == "3 of 7 trials"


def test_the_running_track_is_told_but_not_before_the_participant() -> None:
    said: list[str] = []
    PlainDisplay(said.append).show(Frame(view=view(track="stairs: level 3 (20 V)")))
    assert said[0].endswith("; stairs: level 3 (20 V)")
    PlainDisplay(said.append, shared=True).show(Frame(view=view(track="stairs: level 3 (20 V)")))
    assert "stairs" not in said[1]


def test_the_search_for_the_resonance_is_shown_as_on() -> None:
    assert view(busy="10 V at most, searching").output().startswith("ON")


def test_an_unknown_order_is_reported() -> None:
    said: list[str] = []
    operator = console([":resume\n"], said)
    operator.show(view())
    assert operator.order() is None
    assert said[-1] == "':resume' is not an order; :help lists the orders"


@pytest.mark.parametrize("key", ["?", "h", ":help\n", ":?\n"])
def test_help_lists_every_order(key: str) -> None:
    said: list[str] = []
    operator = console([key], said)
    operator.show(view())
    assert operator.order() is None
    assert said[1:] == line_help()
    assert {line.split()[0] for line in said[2:]} == {
        ":p",
        ":r",
        ":n",
        ":c",
        ":s",
        ":a",
        ":help",
        ":e",
    }


def test_help_in_lines_speaks_of_passes_while_a_block_is_drawn() -> None:
    said: list[str] = []
    operator = console([":help\n"], said)
    operator.show(view(unit="pass"))
    assert operator.order() is None
    assert said[2:4] == [
        "  :p  pause before the next pass, or continue after a pause",
        "  :r  break the running pass off and repeat it",
    ]


@pytest.mark.parametrize("key", ["x", "漢", "\t", "\x13", "\x1b[A", "\x1bOS", "\x1b[15~"])
def test_a_key_without_a_meaning_says_so_and_is_no_order(key: str) -> None:
    said: list[str] = []
    operator = console([key], said)
    operator.show(view())
    assert operator.order() is None
    assert said[1:] == ["that key does nothing here; ? shows the keys"]


@pytest.mark.parametrize(("key", "order"), [("E", "emergency stop"), ("P", "pause")])
def test_keys_work_with_caps_lock_too(key: str, order: str) -> None:
    assert console([key]).order() == order


def test_a_call_is_counted_until_it_is_answered() -> None:
    frames: list[Frame] = []

    class Shown:
        def show(self, frame: Frame) -> None:
            frames.append(frame)

    keys = iter(["", "a", "a"])
    operator = OperatorConsole(lambda _: next(keys, ""), Shown(), time_of_day=lambda: "14:03:22")
    operator.show(view())
    for _ in range(2):
        operator.participant_called()
    operator.show(view(plan=plan(4)))
    operator.order()
    assert frames[-1].calls == 2
    operator.order()
    assert frames[-1].calls == 0
    operator.order()
    assert [text for _, text in frames[-1].messages] == [
        *["the participant is calling you (Escape)"] * 2,
        "you answered the participant's call",
        "nobody is calling",
    ]


def test_a_warning_stays_among_the_messages() -> None:
    said: list[str] = []
    operator = console(said=said)
    operator.show(view(warning="no watchdog"))
    operator.show(view())
    operator.pausing(True)
    operator.pausing(False)
    assert said[1:] == [
        "warning: no watchdog",
        "pausing before the next trial",
        "no pause: the session goes on",
    ]


def test_a_dry_run_says_so_first() -> None:
    said: list[str] = []
    operator = console(said=said)
    for _ in range(2):
        operator.show(view(kind="rehearsal"))
    assert said[0] == "DRY RUN: a rehearsal, no participant's data"
    assert len(said) == 2


@pytest.mark.parametrize(
    ("characters", "name", "answer", "note"),
    [
        ("cage 31\n", "age", "31", ""),
        ("cage 31 because misheard\n", "age", "31", "misheard"),
        ("cremark sticky because of sweat\n", "remark", "sticky", "of sweat"),
        ("cag\x7fge 31\n", "age", "31", ""),
        ("cremark\n", "remark", "", ""),
    ],
)
def test_a_correction_is_typed_after_its_key(
    characters: str, name: str, answer: str, note: str
) -> None:
    keys = OperatorKeys()
    keys.feed(characters)
    assert keys.order() == Correction(name=name, answer=answer, note=note)
    assert keys.line is None


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("answer age 31", Correction(name="age", answer="31")),
        ("Answer age 31 because misheard", Correction(name="age", answer="31", note="misheard")),
        ("c age 31", Correction(name="age", answer="31")),
        ("answer", None),
        ("answer age 31\x05", "emergency stop"),
    ],
)
def test_a_correction_is_one_line(line: str, wanted: Correction | str | None) -> None:
    keys = OperatorKeys()
    assert keys.feed_order(line)
    assert keys.order() == wanted
    assert keys.line is None, "the next line is no part of it"


def test_an_emergency_stop_ends_a_correction_and_escape_drops_it() -> None:
    keys = OperatorKeys()
    keys.feed("cage 3\x1b")
    assert (keys.line, keys.order()) == (None, None)
    keys.feed("cage\x05")
    assert keys.order() == "emergency stop"


def test_plain_lines_do_not_repeat_what_was_told_before_an_interruption() -> None:
    said: list[str] = []
    operator = console((), said)
    operator.recall([("09:00:00", "noted: skin dry")])
    operator.show(view())
    operator.notify("noted: skin moist")
    assert "noted: skin dry" not in said
    assert said[-1] == "noted: skin moist"
