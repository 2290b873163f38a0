"""The network: who is here, who talks to whom, what is agreed.

Knows Zenoh and numpy; knows no learning algorithm, no torch and no drone.
"""
