"""The worlds.  Importing this package registers every environment with Gymnasium.

``gymnasium.make("sim:GridWorld-v0", ...)`` imports it by itself.  Imports nothing of ours.
"""
