"""A plugin file that Python cannot read."""

from shadowbench.method import Method


class Broken(Method)
    name = "broken"
