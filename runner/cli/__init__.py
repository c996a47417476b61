"""The command line, which connects runner, analysis, device and protocol.

Public face: `app.app`. `main` is the entry point of the installed command.
"""


def main() -> None:
    """Run touchbeam's command line."""
    # Imported here to keep the import of this package cheap.
    from runner.cli.app import main as run

    run()
