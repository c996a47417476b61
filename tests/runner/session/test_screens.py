"""What the participant sees in turn, and how far the session is."""

from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.screens import Instruction, Screen
from runner.session.loop import run
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context

PAGE = '\n[[page]]\ntext = { en = "Please sit upright.", zh = "请坐直。" }\n'


@dataclass
class Following(FakeParticipant):
    """A participant who writes down what happens to the window."""

    device: FakeDevice = field(default_factory=FakeDevice)
    told: list[str] = field(default_factory=list)

    def show(self, screen: Screen) -> None:
        super().show(screen)
        self.told.append(f"{type(screen).__name__} {getattr(screen, 'text', '')}")

    def progress(self, number: int, total: int) -> None:
        self.told.append(f"{number} of {total}")

    def saved(self) -> None:
        self.told.append("saved")


def followed(folder: Path, text: str, *, repeats: bool = False) -> Following:
    participant = Following()
    orders = [("touching", "repeat")] if repeats else []
    operator = FakeOperator(participant.device, orders)
    with open_journal(folder / "study.db") as journal:
        run(context(journal, participant.device, participant, text, operator))
    return participant


def test_a_session_begins_with_its_page_and_ends_with_thanks(tmp_path: Path) -> None:
    told = followed(tmp_path, template("paper") + PAGE).told
    assert told.count("Instruction page.0") == 1
    assert told.index("Welcome ") < told.index("Instruction page.0") < told.index("1 of 7")
    assert told[-1] == "Notice thanks"
    assert "Notice stopped" not in told


def test_the_window_knows_which_trial_it_is_and_when_its_answers_are_safe(tmp_path: Path) -> None:
    told = followed(tmp_path, template("paper")).told
    counted = [text for text in told if " of 7" in text or text == "saved"]
    assert counted == [text for n in range(1, 8) for text in (f"{n} of 7", "saved")]


def test_participants_read_which_of_several_touches_of_a_trial_comes(tmp_path: Path) -> None:
    participant = FakeParticipant()
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), participant, template("paper"))
        run(made)
    paths = [it.touch for it in participant.shown if isinstance(it, Instruction) and it.touch]
    planned = [len(trial.touches) for trial in made.session.plan.trials]
    numbers = [range(1, many + 1) if many > 1 else (0,) for many in planned]
    assert {1, 2} <= {*planned}
    assert [path.interval for path in paths] == [*chain.from_iterable(numbers)]


def test_who_touches_is_asked_to_let_go_before_a_trial_is_repeated(tmp_path: Path) -> None:
    told = followed(tmp_path, template("paper"), repeats=True).told
    first = told.index("1 of 7")
    assert told[first + 1 : first + 6] == [
        "Instruction touch.smooth", "LeadIn touch.smooth", "Notice touch.end", "Notice wait.touch",
        "1 of 7",
    ]  # fmt: skip
