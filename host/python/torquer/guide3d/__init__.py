"""Public Guide3D data to shapes for torquer-validate (torquer convert guide3d FOLDER).

Jianu et al., Guide3D, arXiv 2410.22224: two X-ray cameras see a wire in a phantom.

    torquer.guide3d.convert("guide3d", "shapes")
"""

from ._convert import convert

__all__ = ["convert"]
