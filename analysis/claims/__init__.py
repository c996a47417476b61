"""The paper's claims, each with a computed check under every friction law.

Public face: `audit.audit`, `claim.PaperClaim`.
"""
