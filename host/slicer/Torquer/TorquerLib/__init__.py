"""Parts of the 3D Slicer module Torquer that need neither Slicer nor the package torquer, in Python 3.9."""
