"""A plugin file that takes its process down."""

import os

os.abort()
