"""The simulated instruments behind the wire, one dialect a file.

Public face: `dialect.Dialect`, `board_model.BoardDialect`, `generator_model.GeneratorDialect`.
"""
