"""Machines with known faults, the questions put to the command line, and the scores."""
