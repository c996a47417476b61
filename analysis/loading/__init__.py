"""From a journal's events to tables of trials and scores.

Public face: `study_data.load_study_data`, `sessions.load_sessions`.
"""
