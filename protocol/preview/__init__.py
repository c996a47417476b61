"""What a study will do, before anybody sits down: trials, duration, limits, precision.

Public face: `preview.preview`, `preview.preview_record`, `text.preview_lines`.
"""
