"""What is asked: studies, conditions, trials, orders, ratings. Pure; imports no other package."""
