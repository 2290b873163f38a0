"""The drone experiment: Table 1 and Fig. 3, from swarms that really learn and fly.

runs.py (which runs there are, and how far they are)  ->  training.py (starts and resumes them)
->  record.py (what is kept of them)  ->  table.py (claims, matrices)  ->  curves.py (Fig. 3).
"""
