"""The model of a study: what its file may say, as frozen and validated records.

Public face: `study.Study`, `study.Condition`, `touch.Touch`, `rules.Rating`,
`rig_settings.Rig`, `participant_texts.study_wording`, `languages.built_in`.
"""
