"""Mathematics without physics: interval arithmetic, phi functions, Newton's method, least squares, spectral peaks, quantisation
steps, batched evaluation."""
