"""Files: the one way to them, checkpoints, where a run came from."""
