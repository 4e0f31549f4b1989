# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene's render settings as plain values, for what judges them without Blender."""

from typing import Any

from .expressions import plain_properties

_PLUMBING = {
    *("CompositorNodeRLayers", "CompositorNodeComposite", "CompositorNodeViewer"),
    *("NodeGroupInput", "NodeGroupOutput", "NodeReroute", "NodeFrame"),
}


def render_settings(bl_scene: Any) -> dict[str, Any]:
    """Return the settings of `bl_scene` by their path, such as ``cycles.samples``.

    Beside Blender's own: ``compositor``, the labels of nodes that may change the picture;
    ``sequencer``, whether it has strips; ``material_override`` of the layer that renders.
    """
    blocks = {
        "cycles": bl_scene.cycles,
        "render": bl_scene.render,
        "render.image_settings": bl_scene.render.image_settings,
        "view_settings": bl_scene.view_settings,
    }
    found = {
        f"{path}.{name}": value
        for path, block in blocks.items()
        for name, value in plain_properties(block).items()
    }
    layers = bl_scene.view_layers
    override = next((layer for layer in layers if layer.use), layers[0]).material_override
    editor = bl_scene.sequence_editor
    strips = getattr(editor, "strips", None) or getattr(editor, "sequences", None)
    return found | {
        "compositor": _compositing(bl_scene) if bl_scene.render.use_compositing else "",
        "sequencer": bool(bl_scene.render.use_sequencer and strips),
        "material_override": override.name if override else "",
    }


def _compositing(bl_scene: Any) -> str:
    if hasattr(bl_scene, "compositing_node_group"):  # from Blender 5
        tree = bl_scene.compositing_node_group
    else:
        tree = bl_scene.node_tree if bl_scene.use_nodes else None
    nodes = (n for n in (tree.nodes if tree else ()) if not n.mute)
    return ", ".join(sorted({n.bl_label for n in nodes if n.bl_idname not in _PLUMBING}))
