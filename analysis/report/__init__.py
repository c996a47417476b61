"""The report of a study: its page, JSON, tables and figures.

Public face: `report.report`, `report.report_files`, `page.page_html`.
"""
