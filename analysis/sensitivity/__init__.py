"""How strongly each person's ratings follow what the friction model predicts.

Public face: `linear_model.linear_sensitivity`, `ordinal_model.ordinal_sensitivity`,
`joint_model.joint_sensitivity`, `ratings.Ratings`.
"""
