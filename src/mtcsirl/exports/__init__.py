"""Results for other tools: stable-baselines3, Minari, videos."""
