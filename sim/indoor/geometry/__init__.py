"""Triangles and the tree over them; what is near and what is hit."""
