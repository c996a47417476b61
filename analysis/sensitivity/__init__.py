"""Models of how strongly each person's ratings follow the predicted contrast.

Public face: `linear_model.linear_sensitivity`, `ordinal_model.ordinal_sensitivity`,
`two_stage_model.first_stage`, `two_stage_model.two_stage_posterior`, `lines.Ratings`.
"""
