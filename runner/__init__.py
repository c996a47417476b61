"""A session: its loop, journal, people, window and the command line."""
