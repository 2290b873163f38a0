"""What becomes of the neighbours' parameters: rules, weights, compression, robustness, loss."""
