"""Mathematical tools that know no physics: interval arithmetic, least squares, quantisation steps, batched evaluation."""
