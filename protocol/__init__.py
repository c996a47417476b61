"""What is asked: studies, conditions, trials, orders and ratings. Pure; knows no other package."""
