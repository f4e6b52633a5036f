"""Recordings: what a log holds, how it is read, which column is what, how it is cleaned."""
