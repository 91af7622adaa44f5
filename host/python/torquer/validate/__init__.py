"""Measured shapes of a wire beside those that a scene gives (torquer-validate).

    python3 -m torquer.validate --scene phantom.toml --shapes shapes.csv --out result
"""
