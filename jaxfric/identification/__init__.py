"""Friction and inertia of one recording, or of a batch: rows, grid, refinement, uncertainty."""
