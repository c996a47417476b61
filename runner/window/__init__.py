"""The participant's window: a process of its own that a session sends screens to and polls."""
