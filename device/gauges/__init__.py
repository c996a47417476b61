"""Force gauges on ports of their own, one dialect a file: other sources of the force channel.

Public face: `discovery.open_gauge`, `owner.GaugeOwner`.
"""
