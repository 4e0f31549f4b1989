# SPDX-License-Identifier: GPL-3.0-or-later
"""Sockets behind nodes that are not known here: what Blender is to be asked, a slot each."""

from dataclasses import dataclass, field
from typing import Any

from ..textures import Expression
from .expressions import NUMBERS, Groups, behind

Place = tuple[tuple[str, ...], str, str]  # names of the group nodes and the node, and the socket
NORMAL: Place = ((), "", "Normal")  # the shading normal, as displacement bends it


@dataclass
class Asking:
    """What is asked of one material, by calls with a socket."""

    bl_material: Any  # not evaluated
    slots: dict[Place, int] = field(default_factory=dict[Place, int])
    names: list[str] = field(default_factory=list[str])  # of the sockets, for people

    def __call__(self, socket: Any, groups: Groups) -> Expression | None:
        """Return what stands for the value that a socket gets, None where there is not one."""
        if any(map(_by_chance, behind(socket, groups))):
            return None
        place = tuple(group.name for group in groups), socket.node.name, socket.identifier
        width = 1 if socket.type in NUMBERS else 3
        return self._slot(place, f"{socket.name} of {socket.node.name}", width)

    def normal(self, displacement: Any) -> Expression | None:
        """Return what stands for the shading normal that a `displacement` socket bends."""
        if any(map(_by_chance, behind(displacement))):
            return None
        return self._slot(NORMAL, "Bump from displacement", 3)

    def _slot(self, place: Place, name: str, width: int) -> Expression:
        if place not in self.slots:
            self.slots[place] = len(self.slots)
            self.names.append(name)
        return Expression("MEASURED", settings={"slot": self.slots[place], "width": width})


def _by_chance(found: tuple[Any, Groups]) -> bool:
    """Return whether an output is a mean over rays, or changes with the size of a pixel."""
    node = found[0].node
    mean = node.bl_idname in {"ShaderNodeAmbientOcclusion", "ShaderNodeBevel"}
    return mean or getattr(node, "use_pixel_size", False)
