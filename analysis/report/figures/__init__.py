"""The kinds of figures of the report."""
