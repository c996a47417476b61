"""How strongly each person's ratings follow what the friction model predicts."""
