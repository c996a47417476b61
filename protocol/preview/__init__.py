"""What a study will do, before anybody sits down: trials, duration, limits, balance.

Public face: `preview.preview`, `preview.preview_record`, `text.preview_lines`.
"""
