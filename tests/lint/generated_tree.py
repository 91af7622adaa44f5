"""Helpers of the tests of this folder: a script as a module, and a folder with generated files."""

import importlib.machinery
import importlib.util
import os
import tempfile
import unittest

import include_graph

HERE = os.path.dirname(os.path.abspath(__file__))


def load(script: str):
    """A script of this folder as a module."""
    loader = importlib.machinery.SourceFileLoader(script, os.path.join(HERE, script))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(script, loader))
    loader.exec_module(module)
    return module


class Tree(unittest.TestCase):
    """A folder with files."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = folder.name
        for cached in (include_graph.read, include_graph.include_lines, include_graph.resolve):
            cached.cache_clear()

    def write(self, name: str, text: str) -> None:
        path = os.path.join(self.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        for cached in (include_graph.read, include_graph.include_lines, include_graph.resolve):
            cached.cache_clear()
