"""What an operator may see of a session."""

from protocol.study.rig_settings import Rig
from runner.screens import OperatorView, PlanLine

LABELS = ("baseline", "signal", "frequency", "voltage", "pressure", "structure", "direction")
ANSWERS = ("felt", "smoother", *["stronger, score 8"] * 5)


def plan(answered: int) -> tuple[PlanLine, ...]:
    """The plan of seven trials of which the first are answered and the next one runs."""
    return tuple(
        PlanLine(
            label=label,
            answer=ANSWERS[number] if number < answered else None,
            running=number == answered,
        )
        for number, label in enumerate(LABELS)
    )


def view(**changes: object) -> OperatorView:
    fields: dict[str, object] = {
        "session": "P01/1",
        "kind": "participant",
        "state": "touching",
        "plan": plan(3),
        "left_s": 130.0,
        "device": None,
        "rig": Rig(),
        "kept_by": "watchdog",
        "identity": "touchbeam,BOARD,SIM,1.1",
        "resonance_hz": 24_068.0,
        "beam": "1 mm",
    }
    return OperatorView(**{**fields, **changes})  # type: ignore[arg-type]
