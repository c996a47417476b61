"""The command line: the one place where runner, analysis, device and protocol are put together."""


def main() -> None:
    """Run the command line."""
