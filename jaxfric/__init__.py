"""Friction of drive axes identified without mass and without acceleration, and explained."""
