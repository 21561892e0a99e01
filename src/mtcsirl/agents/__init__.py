"""Agents: the SAC learner, its memory, the training loop and the policies it leaves behind."""
