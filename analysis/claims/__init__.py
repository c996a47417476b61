"""The paper's claims, each with a check that a machine makes under every friction law.

Public face: `audit.audit`, `claim.Claim`.
"""
