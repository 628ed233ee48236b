"""One batch of episodes behind the single env, the VectorEnv and rollouts."""
