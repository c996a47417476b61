"""A simulated device, which speaks over the same byte path as a real one.

Public face: `server.simulate`, `client.simulator_process`, `device.SimulatedDevice`,
`in_process.InProcessDevice`, `faults.FAULTS`.
"""
