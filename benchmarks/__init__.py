"""Programs that print speed against error, side by side with a peer in the same run."""
