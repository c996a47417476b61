"""Force gauges on ports of their own, one dialect a file: other sources of the force channel.

Public face: `owner.open_gauge`, `owner.GaugeOwner`.
"""
