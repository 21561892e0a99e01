"""What happens in episodes: policies, environments in lockstep, evaluation, gates, demonstrations."""
