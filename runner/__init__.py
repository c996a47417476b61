"""A session: its loop, journal, participants and console. `runner.cli` puts everything together."""
