"""What a run does: one file per stage of the DAG."""
