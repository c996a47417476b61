"""Whole cohorts of virtual people without processes, ports or a journal.

Public face: `simulation.Simulation`, whose people answer as they do in sessions of the same seed.
"""
