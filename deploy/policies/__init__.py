"""What a run has learned: scores, evaluation flights, export."""
