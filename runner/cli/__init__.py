"""The command line: the place where runner, analysis, device and protocol are put together.

Public face: `app.app`. `main` is the address of the installed command.
"""


def main() -> None:
    """Run touchbeam's command line."""
    # Imported here, so that importing a room costs nothing.
    from runner.cli.app import main as run

    run()
