"""A simulated device in a process of its own, which speaks over the same byte path.

Public face: `server.simulate`, `client.simulator_process`, `device.simulated_device`,
`faults.FAULTS`.
"""
