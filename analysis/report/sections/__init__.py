"""Sections of the report, each with its tables, sentences, figures and data.

`SECTIONS` in `analysis/report/page.py` lists the functions that make them.
"""
