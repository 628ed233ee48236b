"""Stable-Baselines3 on the native VectorEnvs: needs the extra `rl`, and imports nothing of it by itself."""
