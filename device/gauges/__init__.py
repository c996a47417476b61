"""Force gauges on ports of their own, one dialect a file: other sources of the force channel.

Public face: `known_gauges.open_gauge`, `owner.GaugeOwner`.
"""
