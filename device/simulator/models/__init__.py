"""The simulated instruments behind the wire, one dialect a file.

Public face: `dialect.Dialect`, `board_model.BoardDialect`, `keysight_model.KeysightDialect`.
"""
