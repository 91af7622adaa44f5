"""Scripts to begin from: each prints what it finds and draws a picture; README says what they show.

    python3 -m torquer.examples.friction_sweep picture.png
    torquer.examples.friction_sweep.main("picture.png")      # after import torquer.examples.friction_sweep
"""
