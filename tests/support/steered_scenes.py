"""Scenarios of steered agents, as text."""

HEAD = "crowdsim: 1\nname: steered\nseed: {seed}\nduration: {duration}\n"


def steered_scene(*groups: str, floor: str, rest: str = "", seed: int = 1, duration: float = 60.0) -> str:
    """Return a scenario of groups (YAML mappings without braces), all steered, on a floor."""
    agents = "".join(f"  - {{locomotion: steered, {group}}}\n" for group in groups)
    return f"{HEAD.format(seed=seed, duration=duration)}floor: {floor}\n{rest}agents:\n{agents}"
