"""Virtual people: what they are like, what they feel, and how they answer; no device, no window.

Public face: `person.Person` and `People`, `person.Population` and `people_of`,
`people_file.people_in`, and `answering`. A session and the simulation of
whole cohorts use the same functions, which take one person or many.
"""
