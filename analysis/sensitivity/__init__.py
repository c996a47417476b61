"""How strongly each person's answers and ratings follow the predicted contrast.

Public face: `answers_model.sensitivity`, `lines.Ratings`.
"""
