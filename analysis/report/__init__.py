"""The report of a study: its page, JSON, tables and figures.

Public face: `report.report`, `report.write_report`, `page.page_html`.
"""
