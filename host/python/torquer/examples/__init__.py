"""Example scripts: each prints results and draws a picture. The README explains them.

    python3 -m torquer.examples.friction_sweep picture.png
    torquer.examples.friction_sweep.main("picture.png")      # after import torquer.examples.friction_sweep
"""
