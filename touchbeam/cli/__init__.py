"""The command line, which connects runner, analysis, device and protocol.

Public face: `app.app`. `main` is the entry point of the installed command.
"""


def main() -> None:
    """Run touchbeam's command line."""
    # Imported here to keep the import of this package cheap, and signals first: Ctrl-C must not
    # end in a traceback while the rest is imported.
    try:
        import gc
        import signal

        # Almost everything that imports and journals make stays: looking through it again and
        # again for cycles takes a tenth of the time of a short command.
        gc.set_threshold(20_000, 20, 20)

        signal.signal(signal.SIGINT, _stop)
        from touchbeam.cli.app import main as run
    except KeyboardInterrupt:
        _stop()
    try:
        run()
    finally:
        # Python would look through it once more at its end: a quarter of a short command's time.
        gc.freeze()


def _stop(*_: object) -> None:
    """End the process before a command begins, when there is nothing to clean up."""
    import os

    os.write(2, b"touchbeam: stopped by SIGINT\n")
    os._exit(1)
