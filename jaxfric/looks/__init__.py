"""How results look: text, HTML for notebooks, and pictures, all of them from plain numbers."""
