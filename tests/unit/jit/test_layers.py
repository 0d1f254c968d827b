"""Kernels that captured agents need are compiled once for any number of layers."""

import sys

from numba.core.dispatcher import Dispatcher

from crowdsim.crowd.simulation import Simulation
from crowdsim.jit import kernel_name
from crowdsim.scenario.loader import parse_scenario

TEXT = """\
crowdsim: 1
name: few
seed: 1
duration: 60
floor: {{rectangle: [0, 0, 9, 2.6]}}
layers: [{layers}]
obstacles: [{{name: cupboard, box: {{center: [4.5, 0.5], size: [0.6, 1.0]}}, top: 1.8}}]
agents:
  - {{name: east, locomotion: captured, count: 1, start: {{point: [0.6, 1.6]}}, goal: {{point: [8.4, 1.6]}}}}
  - {{name: west, locomotion: captured, count: 1, start: {{point: [8.4, 1.6]}}, goal: {{point: [0.6, 1.6]}}}}
"""
LAYERS = (
    "{name: legs, low: 0.1, high: 2.0}",
    "{name: torso, low: 0.65, high: 1.5}",
    "{name: head, low: 1.5, high: 1.9}",
)


def types_after_walking(layers: int) -> dict[str, list[str]]:
    """Walk with so many layers; return the types of which each kernel of the process is compiled."""
    with Simulation(parse_scenario(TEXT.format(layers=", ".join(LAYERS[:layers])))) as simulation:
        simulation.run(None)
        assert simulation.arrived == 2
    modules = [module for name, module in sys.modules.items() if name.startswith("crowdsim.")]
    functions = [function for module in modules for function in vars(module).values()]
    kernels = [function for function in functions if isinstance(function, Dispatcher) and kernel_name(function)]
    return {str(kernel_name(kernel)): sorted(map(str, kernel.signatures)) for kernel in kernels if kernel.signatures}


def test_more_layers_compile_no_kernel_anew() -> None:
    usual = types_after_walking(2)
    for layers in (1, 3):
        after = types_after_walking(layers)
        anew = [name for name, types in after.items() if types != usual.get(name, types)]
        assert anew == []
        assert {"follower/follow_kernels.follow", "systems/choose_kernels.go_on"} <= set(after)
