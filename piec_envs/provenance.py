"""What a result was made with: versions and sources, as records carry them."""

from piec_envs.sources import git_answer, source
from piec_envs.versions import install_command, versions

__all__ = ["git_answer", "install_command", "source", "versions"]
