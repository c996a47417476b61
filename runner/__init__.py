"""Sessions: loop, journal, people, participant's window, and the command line."""
