# SPDX-License-Identifier: GPL-3.0-or-later
"""BSDFs: a file a kind; see `Lobe` for what each offers, and `lobes` for nodes made of them."""

from ._base import BSDFS, Frame, Inputs, Lobe, Mixture, lobes

__all__ = ["BSDFS", "Frame", "Inputs", "Lobe", "Mixture", "lobes"]
