"""The byte path to a device: ports, lines, queries with a deadline, resynchronisation.

Public face: `link.open_link`, `link.Link`, `port.open_port`, `codec.number_text`.
"""
