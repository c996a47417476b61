"""Sessions: loop, journal, people, and the participant's window."""
