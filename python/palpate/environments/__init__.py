"""Environments of Gymnasium; importing this registers them (``pip install "palpate[robots]"``)."""

try:
    import gymnasium
except ModuleNotFoundError:
    raise ModuleNotFoundError('palpate.environments needs Gymnasium: pip install "palpate[robots]"') from None

from palpate.environments.find_nodule import FindNodule
from palpate.environments.searcher import ScriptedSearcher, search

gymnasium.register("palpate/FindNodule-v0", "palpate.environments.find_nodule:FindNodule", max_episode_steps=4000)

__all__ = ["FindNodule", "ScriptedSearcher", "search"]
