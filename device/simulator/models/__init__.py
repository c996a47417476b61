"""The simulated instruments behind the wire: dialects, power stage and beam.

Public face: `dialect.Dialect`, `board_model.BoardDialect`, `keysight_model.KeysightDialect`,
`beam_and_finger.SimulatedBeam`.
"""
