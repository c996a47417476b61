"""Prints what reaches the participant's window, a line each, until the standard input ends.

    python -m tests.runner.window.listening

After each round of events it says whether keys reach the window and whether it is shown, if that
has changed.
"""

import select
import sys
import time

from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.window.canvas import PsychopyCanvas
from runner.window.elements import Key, Typed
from runner.window.messages import Settings


def main() -> None:
    """Open the window, then print."""
    wording = study_wording(parsed_study(template("paper")), "en")
    canvas = PsychopyCanvas(Settings(wording=wording, windowed=True))
    canvas.flip()
    print("open", flush=True)
    told: dict[str, bool] = {}
    while not select.select([sys.stdin], [], [], 0)[0]:
        canvas.flip()
        for _, given in canvas.inputs():
            match given:
                case Key(name=name, repeated=repeated):
                    print("again" if repeated else "key", name, flush=True)
                case Typed(text=text, repeated=repeated):
                    print("more" if repeated else "text", text, flush=True)
                case _:
                    print(type(given).__name__, flush=True)
        if told != canvas.state:
            told = dict(canvas.state)
            print("state", *told.values(), flush=True)
        time.sleep(0.005)


if __name__ == "__main__":
    main()
