"""What runs in the window's process: its pipes, and the line it says when it cannot open."""

import os
import sys
import threading
from collections.abc import Mapping
from typing import Any, TextIO

from protocol.errors import WorkFailed
from runner.window.serving import Mailbox, Serving
from runner.window.wire import line_of, message_of, settings_of


def serve_window() -> None:
    """Open the window that the first line of standard input describes and serve it until the end.

    Standard output belongs to the session: whatever a library prints goes to standard error.
    """
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def send(message: Mapping[str, Any]) -> None:
        answers.write(line_of(message))
        answers.flush()

    settings = settings_of(message_of(sys.stdin.readline()))
    try:
        from runner.window.drawing import PsychopyCanvas

        canvas = PsychopyCanvas(settings)
    except WorkFailed as error:
        return send({"failed": str(error)})
    except Exception as error:
        display = os.environ.get("DISPLAY", "this screen")
        why = f"the participant's window cannot open on {display} ({_first_line(error)})"
        return send({"failed": why})
    try:
        Serving(canvas, settings, _mailbox(sys.stdin), send).run()
    except Exception as error:
        return send({"broken": _first_line(error)} if canvas.is_there() else {"closed": True})
    return canvas.close()


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__


def _mailbox(source: TextIO) -> Mailbox:
    """Messages as they come, read by a thread so that no frame waits for them."""
    mailbox: Mailbox = Mailbox()

    def read() -> None:
        for line in source:
            mailbox.put(message_of(line))
        mailbox.put({"end": True})

    threading.Thread(target=read, name="screens", daemon=True).start()
    return mailbox
